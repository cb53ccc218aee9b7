# SPDX-License-Identifier: Apache-2.0
"""The demonstrations of the toolbox assembly: a worker reaches, a person leads the arm."""

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from experiments.recording import (
    Content,
    known_of,
    metadata_stamp,
    metadata_vector,
    pose_and_joint_messages,
    recorded_at_ns,
)
from experiments.teaching.demonstration import (
    TEST_COUNTS,
    TRAINING_COUNTS,
    WristDemonstration,
    demonstration_rng,
    plan_demonstration,
)
from experiments.teaching.lesson import TaughtArm, teach
from experiments.teaching.path import TeachingPath, plan_teaching
from intent_recognition.kinematics import hand_position
from sim_bridge.coworker import TASKS
from sim_bridge.scenarios.toolbox import handover_point

SETS = {"train": (0, TRAINING_COUNTS), "test": (1, TEST_COUNTS)}


@dataclass(frozen=True)
class ToolboxOrder:
    """One demonstration to make: which set ("train" or "test"), task and index, from which seed."""

    seed: int
    purpose: str
    task: str
    index: int

    @property
    def name(self) -> str:
        """Name of the bag, such as plate_handover_03."""
        return f"{self.task}_{self.index:02d}"

    @property
    def folder(self) -> PurePosixPath:
        """Where the bag goes, below the folder for all bags."""
        return PurePosixPath("toolbox", self.purpose, self.name)

    @property
    def start_ns(self) -> int:
        """Stamp of the first sample: one demonstration a minute, from a fixed day on."""
        minute = 1000 * SETS[self.purpose][0] + 100 * TASKS.index(self.task) + self.index
        return recorded_at_ns(minute)


@dataclass(frozen=True)
class ToolboxDemonstration:
    """One demonstration: the worker, where the arm was led, and what its sensors said."""

    order: ToolboxOrder
    wrist: WristDemonstration
    path: TeachingPath
    arm: TaughtArm

    @property
    def teaching_error_m(self) -> float:
        """Distance of the measured hand at the arrival from where the rule puts it."""
        arrived = round(self.wrist.arrival_s * 100.0)
        point = handover_point(self.order.task, self.wrist.reach.goal_m)
        return float(np.linalg.norm(hand_position(self.arm.positions_rad[arrived]) - point))


def orders(seed: int) -> list[ToolboxOrder]:
    """Every demonstration: 48 for training, 12 for testing."""
    return [
        ToolboxOrder(seed, purpose, task, index)
        for purpose, (_, counts) in SETS.items()
        for task, count in counts.items()
        for index in range(count)
    ]


def demonstrate(order: ToolboxOrder) -> ToolboxDemonstration:
    """Simulate one demonstration: the worker reaches, a person leads the arm."""
    rng = demonstration_rng(order.seed, SETS[order.purpose][0], order.task, order.index)
    wrist = plan_demonstration(rng, order.task)
    length = float(wrist.samples.times_s[-1])
    path = plan_teaching(
        rng, order.task, wrist.reach.goal_m, wrist.onset_s, wrist.arrival_s, length
    )
    return ToolboxDemonstration(
        order, wrist, path, teach(rng, path, wrist.samples.true_positions_m)
    )


def metadata(shown: ToolboxDemonstration) -> dict[str, str]:
    """Entries of metadata.yaml under custom_data."""
    wrist, times = shown.wrist, shown.path.times

    return {
        "task": shown.order.task,
        "simulated": "true",  # before the set, as in the shipped files
        "set": shown.order.purpose,
        **known_of(shown.order.seed, shown.order.index),
        "human_onset_ns": metadata_stamp(shown.order.start_ns, wrist.onset_s),
        "human_end_ns": metadata_stamp(shown.order.start_ns, wrist.end_s),
        "robot_start_ns": metadata_stamp(shown.order.start_ns, times.start_s),
        "robot_taught_ns": metadata_stamp(shown.order.start_ns, times.taught_s),
        "robot_arrival_ns": metadata_stamp(shown.order.start_ns, times.arrival_s),
        "tempo_s": f"{wrist.reach.nominal_s:.6f}",
        "hesitations": str(len(wrist.reach.hesitations)),
        "start_m": metadata_vector(wrist.reach.start_m),
        "goal_m": metadata_vector(wrist.reach.goal_m),
        "handover_point_m": metadata_vector(handover_point(shown.order.task, wrist.reach.goal_m)),
        "teaching_error_m": f"{shown.teaching_error_m:.6f}",
        "strongest_pull_n": f"{shown.arm.strongest_pull_n:.3f}",
    }


def content(order: ToolboxOrder, _: Path) -> Content:
    """Simulate one recording: its metadata and its messages."""
    shown = demonstrate(order)
    said = pose_and_joint_messages(order.start_ns, shown.wrist.samples, shown.arm)
    return metadata(shown), said
