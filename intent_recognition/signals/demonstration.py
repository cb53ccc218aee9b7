# SPDX-License-Identifier: Apache-2.0
"""One recorded demonstration, and the reason why a recording did not become one."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from intent_recognition.signals.signal import Signal


@dataclass(frozen=True)
class Demonstration:
    """What both agents did in one recording, as it was measured.

    Attributes:
        name: name of the bag; in a session "<bag>#<index>".
        source: path of the bag.
        task: label, None when the recording has none.
        observed: one signal per observed entry of the DOF file, in its order.
        controlled: one signal per controlled entry, in its order.
        start_ns: first stamp over the observed signals; in a session the start marker.
        end_ns: last stamp over the observed signals; in a session the end marker.
        metadata: further labels of the bag.
        rejected: number of messages dropped, by reason.
    """

    name: str
    source: str
    task: str | None
    observed: tuple[Signal, ...]
    controlled: tuple[Signal, ...]
    start_ns: int
    end_ns: int
    metadata: Mapping[str, str] = field(default_factory=dict)
    rejected: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self):
        object.__setattr__(self, "metadata", dict(self.metadata))
        object.__setattr__(self, "rejected", dict(self.rejected))

    @property
    def duration_s(self) -> float:
        """Length of the demonstration in seconds."""
        return (self.end_ns - self.start_ns) * 1e-9


@dataclass(frozen=True)
class Rejection:
    """Why a recording, or a part of a session, is left out.

    Attributes:
        path: the bag.
        topic: the topic at fault, "" when it is the whole bag.
        stamp_ns: when in the recording, 0 when unknown.
        reason: one sentence.
    """

    path: str
    topic: str
    stamp_ns: int
    reason: str

    def __str__(self) -> str:
        topic = f" topic {self.topic}" if self.topic else ""
        time = f" at {self.stamp_ns} ns" if self.stamp_ns else ""
        return f"{self.path}{topic}{time}: {self.reason}"
