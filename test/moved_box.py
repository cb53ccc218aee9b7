# SPDX-License-Identifier: Apache-2.0
"""Handovers at a box that stands elsewhere each time: the wrist turns to it late."""

from functools import cache

import numpy as np
from bag_builder import POSE
from model_builder import ROBOT, WRIST
from simulation import START_NS, minimum_jerk

from intent_recognition.demonstrations import DofEntry, DofSpec
from intent_recognition.learning import Trained, TrainingSettings, learn_with_report
from intent_recognition.signals import Demonstration, Signal

BOX = DofEntry(
    "box/pose", POSE, fields=("pose.position.x", "pose.position.y"), unit="m", context=True
)
DOFS = DofSpec((WRIST,), (ROBOT,), context=(BOX,))
SETTINGS = TrainingSettings(n_basis=10, n_aligned_basis=10)
GOALS = {"give": np.array([0.5, 0.1, 0.3]), "take": np.array([0.1, 0.6, -0.2])}
JOINT_GAIN = np.random.default_rng(3).normal(size=(2, 7))
"""How the robot's last joints follow the box [rad/m]."""


def hand_over(task: str, seed: int, box=None, turns_at: float = 0.5) -> Demonstration:
    """One recording at 50 Hz, with rest before and after.

    Args:
        task: `give` or `take`.
        seed: of everything random.
        box: where it stands, (2,) [m]; None for at random.
        turns_at: share of the movement after which the wrist shows where.
    """
    rng = np.random.default_rng(seed)
    box = rng.normal(size=2) * 0.15 if box is None else np.asarray(box)
    duration_s = 1.6 * np.exp(0.1 * rng.normal())
    times_s = np.arange(0.0, duration_s + 1.6, 0.02)
    phase = (times_s - 0.8) / duration_s
    late = minimum_jerk((phase - turns_at) / (1.0 - turns_at))[:, None]
    goal = GOALS[task] + 0.01 * rng.normal(size=3)
    wrist = minimum_jerk(phase)[:, None] * goal + late * np.r_[box, 0.0]
    wrist += 0.001 * rng.normal(size=wrist.shape)
    place = np.full(7, 0.3 if task == "give" else -0.4) + box @ JOINT_GAIN
    robot = minimum_jerk(phase)[:, None] * (place + 0.01 * rng.normal(size=7))
    stamps_ns = START_NS + np.round(times_s * 1e9).astype(np.int64)
    return Demonstration(
        f"{task}_{seed:02d}",
        "",
        task,
        (Signal(WRIST.names, stamps_ns, wrist, "m"),),
        (Signal(ROBOT.names, stamps_ns, robot, "rad"),),
        int(stamps_ns[0]),
        int(stamps_ns[-1]),
        context=(Signal(BOX.names, stamps_ns[:1], box[None], "m"),),
    )


def demonstrations(per_task: int = 8) -> list[Demonstration]:
    """As many of each task, always the same."""
    return [hand_over(task, k) for k in range(per_task) for task in GOALS]


@cache
def learned() -> Trained:
    """What is learned from eight of each."""
    return learn_with_report(demonstrations(), SETTINGS).trained
