# SPDX-License-Identifier: Apache-2.0
"""The recordings of pointing: nine spots to learn from, nine others to test on.

In a training recording the person points and holds, and then the arm is led to point at the same
spot. In a test recording the arm stands at home. The marker is put on once per set.
"""

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from experiments.pointing.lesson import TaughtPointing, plan_path, stand, teach
from experiments.pointing.person import PersonPointing, marker_placement, point
from experiments.pointing.scene import SPOTS_M, TASK, spot
from experiments.recording import (
    Content,
    known_of,
    metadata_stamp,
    metadata_vector,
    pose_and_joint_messages,
    recorded_at_ns,
)
from intent_recognition.array_types import Floats

PURPOSES = ("train", "test")
_STREAM = 31
"""Keeps this scenario's random numbers apart from those of others with the same seed."""
SETTLE_S = 0.6
"""How long a recording goes on after the arm has arrived [s]."""
TEST_HOLD_S = 1.5
"""How long the person holds in a test recording [s]."""


@dataclass(frozen=True)
class PointingOrder:
    """One recording to make: of which set ("train" or "test") and spot, from which seed."""

    seed: int
    purpose: str
    index: int

    @property
    def name(self) -> str:
        """Name of the bag, such as pointing_03."""
        return f"{TASK}_{self.index:02d}"

    @property
    def folder(self) -> PurePosixPath:
        """Where the bag goes, below the folder for all bags."""
        return PurePosixPath(TASK, self.purpose, self.name)

    @property
    def start_ns(self) -> int:
        """Stamp of the first sample: one recording a minute, from a fixed day on."""
        minute = 3000 + 100 * PURPOSES.index(self.purpose) + self.index
        return recorded_at_ns(minute)

    def rng(self, index: int) -> np.random.Generator:
        """Random generator of recording `index` of this set; index 99 is the set's own."""
        return np.random.default_rng([self.seed, _STREAM, PURPOSES.index(self.purpose), index])


@dataclass(frozen=True)
class PointingRecording:
    """One recording: the person, the arm, and when the arm moved (None if it stood)."""

    order: PointingOrder
    spot_m: Floats
    placement_m: Floats
    person: PersonPointing
    arm: TaughtPointing
    led_s: tuple[float, float] | None


def orders(seed: int) -> list[PointingOrder]:
    """Every recording: nine for training, nine for testing."""
    return [PointingOrder(seed, p, k) for p in PURPOSES for k in range(len(SPOTS_M[p]))]


def record(order: PointingOrder) -> PointingRecording:
    """Simulate one recording."""
    target = spot(order.purpose, order.index)
    placement = marker_placement(order.rng(99))
    rng = order.rng(order.index)
    if order.purpose == "test":
        person = point(rng, target, placement, TEST_HOLD_S)
        arm = stand(rng, len(person.samples.times_s))
        return PointingRecording(order, target, placement, person, arm, None)
    pause, led = rng.uniform(0.25, 0.4), rng.uniform(2.2, 2.8)
    person = point(rng, target, placement, pause + led + SETTLE_S)
    start = person.end_s + pause
    length = float(person.samples.times_s[-1])
    path = plan_path(rng, target, start, start + led, length)
    arm = teach(rng, path, len(person.samples.times_s))
    return PointingRecording(order, target, placement, person, arm, (start, start + led))


def metadata(shown: PointingRecording) -> dict[str, str]:
    """Entries of metadata.yaml under custom_data."""
    known = {
        "task": TASK,
        "set": shown.order.purpose,
        **known_of(shown.order.seed, shown.order.index),
        "spot_m": metadata_vector(shown.spot_m),
        "marker_placement_m": metadata_vector(shown.placement_m),
        "human_onset_ns": metadata_stamp(shown.order.start_ns, shown.person.onset_s),
        "human_end_ns": metadata_stamp(shown.order.start_ns, shown.person.end_s),
    }
    if shown.led_s is None:
        return known
    return known | {
        "robot_start_ns": metadata_stamp(shown.order.start_ns, shown.led_s[0]),
        "robot_arrival_ns": metadata_stamp(shown.order.start_ns, shown.led_s[1]),
        "robot_pointed_m": metadata_vector(shown.arm.pointed_m),
        "teaching_error_m": f"{np.linalg.norm(shown.arm.pointed_m - shown.spot_m):.6f}",
        "strongest_pull_n": f"{shown.arm.strongest_pull_n:.3f}",
    }


def content(order: PointingOrder, _: Path) -> Content:
    """Simulate one recording: its metadata and its messages."""
    shown = record(order)
    said = pose_and_joint_messages(order.start_ns, shown.person.samples, shown.arm)
    return metadata(shown), said
