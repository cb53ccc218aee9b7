# SPDX-License-Identifier: Apache-2.0
"""The recordings of pouring: ten kinesthetic demonstrations with one pair of containers.

Only the arm is recorded. What moves in the warped space follows from its joints and from how it
holds the cup, which stand in the metadata.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from experiments.pouring.person import draw_habit, plan_pour
from experiments.pouring.pour import Poured, pour
from experiments.recording import (
    ANGLE_STEP_RAD,
    JOINT_TOPIC,
    JOINT_TYPE,
    RATE_STEP_RAD_S,
    SAMPLE_NS,
    TORQUE_STEP_NM,
    Content,
    Message,
    joint_fields,
    known_of,
    metadata_vector,
    recorded_at_ns,
    to_counts,
)
from experiments.teaching.lesson import SENSOR_NOISE
from intent_recognition.warping import References
from sim_bridge.arm import ArmState
from sim_bridge.containers import CONTAINER_SEED, Container, make_container
from sim_bridge.scenarios.pouring import N_BALLS, OPENING_M, TASK, half_full_radius_m

CUP, SECOND = "tall_mug", "shallow_bowl"
N_DEMONSTRATIONS = 10
"""Demonstrated pours, as many as in Brandl et al. 2014."""
_STREAM = 61
"""Keeps this scenario's random numbers apart from those of others with the same seed."""


@dataclass(frozen=True)
class DemonstrationOrder:
    """One demonstration to make, from which seed."""

    seed: int
    index: int

    @property
    def name(self) -> str:
        """Name of the bag, such as pouring_03."""
        return f"{TASK}_{self.index:02d}"

    @property
    def folder(self) -> PurePosixPath:
        """Where the bag goes, below the folder for all bags."""
        return PurePosixPath(TASK, "train", self.name)

    @property
    def start_ns(self) -> int:
        """Stamp of the first sample: one recording a minute, from a fixed day on."""
        return recorded_at_ns(6000 + self.index)

    def rng(self) -> np.random.Generator:
        """All that is random in the demonstration."""
        return np.random.default_rng([self.seed, _STREAM, self.index])


def orders(seed: int) -> list[DemonstrationOrder]:
    """Every demonstration."""
    return [DemonstrationOrder(seed, k) for k in range(N_DEMONSTRATIONS)]


def true_references(container: Container) -> References:
    """Reference values measured on the container itself."""
    return References(
        container.opening_radius_m,
        container.inner_volume_m3,
        container.height_m,
        container.tilt_reference_rad,
    )


def record(order: DemonstrationOrder) -> Poured:
    """Simulate one demonstration: a person leads the arm, and forty balls are poured."""
    rng = order.rng()
    cup, second = (make_container(name, CONTAINER_SEED) for name in (CUP, SECOND))
    path = plan_pour(draw_habit(rng), true_references(cup), true_references(second))
    return pour(
        path, cup, second, ball_radius_m=half_full_radius_m(cup), n_balls=N_BALLS, rng=rng, led=True
    )


def metadata(order: DemonstrationOrder, poured: Poured) -> dict[str, str]:
    """Entries of metadata.yaml under custom_data."""
    return {
        "task": TASK,
        "set": "train",
        **known_of(order.seed, order.index),
        **labels_of(make_container(CUP, CONTAINER_SEED), CUP, SECOND, poured),
        "strongest_pull_n": f"{poured.strongest_pull_n:.3f}",
    }


def labels_of(cup: Container, name: str, second: str, poured: Poured) -> dict[str, str]:
    """Labels of any recorded pour: containers, grasp and what became of the balls."""
    return {
        "cup": name,
        "second": second,
        "container_seed": str(CONTAINER_SEED),
        "opening_m": metadata_vector(OPENING_M),
        "lip_m": metadata_vector(cup.lip_point),
        "height_m": f"{cup.height_m:.6f}",
        "balls": str(poured.n_balls),
        "spilled": str(poured.spilled),
        "kept": str(poured.kept),
        "touched_s": f"{poured.touched_s:.3f}",
        "strongest_touch_n": f"{poured.strongest_touch_n:.3f}",
    }


def joint_messages(
    start_ns: int, poured: Poured, noise: np.random.Generator, *, every: int = 1
) -> Iterator[Message]:
    """Yield (topic, type, stamp in ns, fields) of noisy sensors, one of `every` samples."""
    true = ArmState(poured.joints_rad, poured.velocities_rad_s, poured.torques_nm, 0.0)
    said = SENSOR_NOISE.measure(true, noise)
    steps = (ANGLE_STEP_RAD, RATE_STEP_RAD_S, TORQUE_STEP_NM)
    columns = [to_counts(values, step) for values, step in zip(said[:3], steps, strict=True)]
    for k in range(0, len(poured.times_s), every):
        stamp = start_ns + k * SAMPLE_NS
        yield JOINT_TOPIC, JOINT_TYPE, stamp, joint_fields(stamp, *(c[k] for c in columns))


def content(order: DemonstrationOrder, _: Path) -> Content:
    """Simulate one recording: its metadata and its messages."""
    poured = record(order)
    noise = np.random.default_rng([order.seed, _STREAM, order.index, 1])
    return metadata(order, poured), joint_messages(order.start_ns, poured, noise)
