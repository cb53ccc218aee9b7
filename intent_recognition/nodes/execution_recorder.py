# SPDX-License-Identifier: Apache-2.0
"""Recordings of executions: some seconds before a task was recognised, until the arm is home."""

from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from intent_recognition.bags import BagWriter, DiskFullError
from intent_recognition.demonstrations import CORRECTION_TOPIC, CORRECTION_TYPE
from intent_recognition.errors import IntentError
from intent_recognition.model import CORRECTIONS, Executions

BEFORE_NS = 6_000_000_000
"""So much of what came before the execution is recorded with it [ns]. Convention: a rest, and the
reach until it is recognised."""
MOST_MESSAGES = 20_000
"""Messages of that time that are held at most. Convention: ten streams at 300 Hz."""


class _Message(NamedTuple):
    topic: str
    type: str
    data: bytes
    received_ns: int
    sent_ns: int


class ExecutionRecorder:
    """Writes executions to bags, and what becomes known of them to the list of outcomes.

    Args:
        executions: where they go.
        most: recordings of each task that are kept; 0 records none.
        model: tells the present model, relative to the folder.
        reject: called with (reason, text) where a recording fails.
    """

    def __init__(
        self,
        executions: Executions,
        most: int,
        model: Callable[[], str],
        reject: Callable[[str, str], None],
    ) -> None:
        self.executions, self._most, self._model, self._reject = executions, most, model, reject
        self._recent: deque[_Message] = deque(maxlen=MOST_MESSAGES)
        self._writer: BagWriter | None = None
        self._last: dict[str, Path] = {}
        self._values: dict[str, str] = {}
        self._corrected = False

    @property
    def records(self) -> bool:
        """Whether executions are recorded at all."""
        return self._most > 0

    @property
    def is_recording(self) -> bool:
        """Whether one is under way."""
        return self._writer is not None

    def last(self, task: str) -> str:
        """Name of the execution of a task now or last; empty for none."""
        return self._last[task].name if task in self._last else ""

    def take(self, topic: str, kind: str, data: bytes, received_ns: int, sent_ns: int) -> None:
        """Take a message of a recorded topic."""
        if not self._most:
            return
        message = _Message(topic, kind, data, received_ns, sent_ns)
        recent = self._recent
        recent.append(message)
        while recent[0].received_ns < received_ns - BEFORE_NS:
            recent.popleft()
        self._write(message)

    def correct(self, data: bytes, received_ns: int) -> None:
        """Take a corrected path."""
        self._corrected = self._writer is not None
        self._write(_Message(CORRECTION_TOPIC, CORRECTION_TYPE, data, received_ns, received_ns))

    def set_task(self, task: str) -> None:
        """Another task is active, or (empty) none."""
        if self._writer is not None:
            self._end(self._writer)
        if task and self._most:
            try:
                self._writer = BagWriter(self.executions.new_bag(task), {"task": task})
            except IntentError as error:
                self._reject("execution_not_recorded", str(error))
                return
            self._last[task], self._values, self._corrected = self._writer.path, {}, False
            for message in self._recent:
                self._write(message)

    def add(self, task: str, values: Mapping[str, str]) -> str:
        """Note something about the execution of a task now or last; its name, empty for none."""
        bag = self._last.get(task)
        if bag is None:
            return ""
        if self._writer is not None and bag == self._writer.path:
            self._values |= values
        else:
            self.executions.add(bag, values)
        return bag.name

    def close(self) -> None:
        """End the recording, if there is one."""
        if self._writer is not None:
            self._end(self._writer)

    def _end(self, writer: BagWriter) -> None:
        self._writer = None
        with suppress(IntentError):
            writer.close()
        if self._corrected and self._values.get(CORRECTIONS, "0") == "0":
            self._values[CORRECTIONS] = "1"  # the same task began again before the arm was home
        self.executions.add(writer.path, self._values, self._model())
        self.executions.thin(writer.path.parent.name, self._most)

    def _write(self, message: _Message) -> None:
        if self._writer is None:
            return
        try:
            self._writer.write(*message)
        except DiskFullError as error:
            self._reject("execution_not_recorded", str(error))
            self._writer = None
        except IntentError as error:
            self._reject("unwritable", str(error))
