# SPDX-License-Identifier: Apache-2.0
"""Session bags: many demonstrations on end, told apart by markers on the topic `demonstration`."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from intent_recognition.bags import BagMessage, BagReader
from intent_recognition.demonstrations.dofs import relative_topic
from intent_recognition.demonstrations.signals import TopicSamples
from intent_recognition.signals import Rejection

MARKER_TOPIC = "demonstration"
MARKER_TYPE = "std_msgs/msg/String"
SAME_CLOCK_NS = 1_000_000_000


@dataclass(frozen=True)
class SessionPart:
    """One demonstration of a session, in the time of the messages' stamps."""

    index: int
    task: str
    start_ns: int
    end_ns: int


def find_marker_topic(reader: BagReader) -> str | None:
    """Relative name of the marker topic, None when the bag is no session."""
    for name, info in reader.topics.items():
        relative = relative_topic(name)
        named = relative == MARKER_TOPIC or relative.endswith(f"/{MARKER_TOPIC}")
        if named and info.type == MARKER_TYPE and info.message_count:
            return relative
    return None


def split_session(
    markers: Sequence[BagMessage], samples: Mapping[str, TopicSamples], source: str
) -> Iterator[SessionPart | Rejection]:
    """Demonstrations between each label and the empty marker after it.

    Markers have no stamp of their own: their time is that of recording. Where the stamps of the
    data run on another clock (simulated time), it is shifted by the median difference.
    """
    shift_ns = _clock_shift_ns(samples)
    label, start_ns, index = "", 0, 0
    for marker in markers:
        now_ns = marker.log_time_ns - shift_ns
        text = marker.message.data.strip()
        if text and label:
            yield _unended(source, marker, label, "before the next began")
        elif not text and label:
            yield SessionPart(index, label, start_ns, now_ns)
            index += 1
        label, start_ns = text, now_ns
    if label:
        yield _unended(source, markers[-1], label, "before the recording ended")


def _unended(source: str, marker: BagMessage, label: str, when: str) -> Rejection:
    reason = f"truncated: demonstration of {label!r} did not end {when}"
    return Rejection(source, marker.topic, marker.log_time_ns, reason)


def _clock_shift_ns(samples: Mapping[str, TopicSamples]) -> int:
    """Log time minus stamp, where the two are different clocks; 0 where they are one."""
    differences = [topic.log_times_ns - topic.stamps_ns for topic in samples.values()]
    joined = np.concatenate(differences) if differences else np.empty(0)
    shift_ns = int(np.median(joined)) if joined.size else 0
    return shift_ns if abs(shift_ns) > SAME_CLOCK_NS else 0
