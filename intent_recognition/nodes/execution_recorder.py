# SPDX-License-Identifier: Apache-2.0
"""Recordings of executions, from seconds before a task is recognised until the arm is home."""

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
    """Writes executions to bags, and their outcomes to the list of executions.

    The newest `most` recordings of each task are kept; 0 records none. `model` returns the path of
    the present model in the folder; `reject` is called with (reason, text) if a recording fails.
    """

    def __init__(
        self,
        executions: Executions,
        most: int,
        model: Callable[[], str],
        reject: Callable[[str, str], None],
    ) -> None:
        self.executions, self._most, self._model, self._reject = executions, most, model, reject
        self._recent: deque[RawMessage] = deque(maxlen=20_000)  # 6 s of ten streams at 300 Hz
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
        """Whether an execution is being recorded."""
        return self._writer is not None

    def last(self, task: str) -> str:
        """Name of a task's present or last execution; empty if there was none."""
        return self._last[task].name if task in self._last else ""

    def take(self, message: RawMessage) -> None:
        """Take a message of a recorded topic."""
        if not self._most:
            return
        if self._recent and message.log_time_ns < self._recent[-1].log_time_ns - CLOCK_BACK_NS:
            self.close()
            self._recent.clear()
        self._recent.append(message)
        # long enough for a reach and the rest before it
        while self._recent[0].log_time_ns < message.log_time_ns - 6_000_000_000:
            self._recent.popleft()
        self._write(message)

    def correct(self, data: bytes, received_ns: int) -> None:
        """Record a corrected path, a serialized JointTrajectory."""
        self._corrected = self._writer is not None
        times_ns = received_ns, received_ns
        self._write(RawMessage(CORRECTION_TOPIC, CORRECTION_TYPE, *times_ns, data))

    def set_task(self, task: str) -> None:
        """End the recording, and begin one of the task that is active now, if any."""
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
        """Note values of a task's present or last execution; returns its name, empty if none."""
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
            self._values[CORRECTIONS] = "1"  # no outcome says so if the same task begins again
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
