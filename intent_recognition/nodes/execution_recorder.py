# SPDX-License-Identifier: Apache-2.0
"""Recordings of executions: some seconds before a task was recognised, until the arm is home."""

from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from intent_recognition.bags import BagWriter, DiskFullError, RawMessage
from intent_recognition.demonstrations import CORRECTION_TOPIC, CORRECTION_TYPE
from intent_recognition.errors import IntentError
from intent_recognition.model import CORRECTIONS, Executions
from intent_recognition.nodes.runtime import CLOCK_BACK_NS


class ExecutionRecorder:
    """Writes executions to bags, and what becomes known of them to the list of outcomes.

    Of each task `most` recordings are kept; 0 records none. `model` tells the present model,
    relative to the folder; `reject` is called with (reason, text) where a recording fails.
    """

    def __init__(
        self,
        executions: Executions,
        most: int,
        model: Callable[[], str],
        reject: Callable[[str, str], None],
    ) -> None:
        self.executions, self._most, self._model, self._reject = executions, most, model, reject
        self._recent: deque[RawMessage] = deque(maxlen=20_000)  # of ten streams at 300 Hz
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

    def take(self, message: RawMessage) -> None:
        """Take a message of a recorded topic."""
        if not self._most:
            return
        if self._recent and message.log_time_ns < self._recent[-1].log_time_ns - CLOCK_BACK_NS:
            self.close()
            self._recent.clear()
        self._recent.append(message)
        # a reach, and the rest before
        while self._recent[0].log_time_ns < message.log_time_ns - 6_000_000_000:
            self._recent.popleft()
        self._write(message)

    def correct(self, data: bytes, received_ns: int) -> None:
        """Take a corrected path."""
        self._corrected = self._writer is not None
        times_ns = received_ns, received_ns
        self._write(RawMessage(CORRECTION_TOPIC, CORRECTION_TYPE, *times_ns, data))

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
            self._note(bag, values)
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
        self._note(writer.path, self._values, self._model())
        self.executions.thin(writer.path.parent.name, self._most)

    def _note(self, bag: Path, values: Mapping[str, str], model: str = "") -> None:
        try:
            self.executions.add(bag, values, model)
        except IntentError as error:
            self._reject("execution_not_recorded", str(error))

    def _write(self, message: RawMessage) -> None:
        if self._writer is None:
            return
        try:
            self._writer.write_raw(message)
        except DiskFullError as error:
            self._reject("execution_not_recorded", str(error))
            self._writer = None
        except IntentError as error:
            self._reject("unwritable", str(error))
