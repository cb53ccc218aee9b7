# SPDX-License-Identifier: Apache-2.0
"""Node: records demonstrations and sessions, any topic of any installed type, bit for bit."""

from functools import partial
from typing import Any

from intent_recognition.errors import BagError
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.runtime import run
from intent_recognition.nodes.services import serve
from intent_recognition.nodes.topic_recorder import TopicRecorder, check_task


class BagRecorder(TopicRecorder):
    """Subscribes at once, and writes from `~/start`, or at once with `output`, until `~/stop`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("bag_recorder", **kwargs)
        topics: list[str] = declare(self, "bag_recorder")["topics"]
        check_task({"task": self.get_parameter("task").value})
        self.done = False
        self.exit_code = 0
        serve(self, "start", self.start)
        serve(self, "stop", self.stop)
        self.listen(topics)
        self._autostarted = bool(self.get_parameter("output").value)
        if self._autostarted:
            self.start()

    def start(self) -> str:
        """Open the bag named by `output`; returns its path. See `TopicRecorder.open_bag`."""
        output = self.get_parameter("output").value
        task = self.get_parameter("task").value
        if not output and self.recording is None:
            cure = "Set the parameter `output`."
            raise BagError.about("output", "the directory of a new bag", "nothing", cure)
        self.open_bag(output, {"task": task} if task else {})
        return str(output)

    def stop(self) -> str:
        """Close the bag; returns a summary. See `TopicRecorder.close_bag`."""
        writer = self.close_bag()
        return f"{writer.message_count} messages in {writer.path}"

    def gave_up(self) -> None:
        """End the process if it was started to record this bag."""
        if self._autostarted:
            self.exit_code = 1
            self.done = True


main = partial(run, BagRecorder)
