# SPDX-License-Identifier: Apache-2.0
"""Make the simulated demonstrations of the toolbox assembly: `python -m sim_bridge.generate`.

Each demonstration depends on (seed, set, task, index) alone and runs in a physics world of its own:
the same seed gives the same bytes, whatever the number of processes.
"""

import argparse
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from intent_recognition import __version__
from intent_recognition.errors import ArgumentError, IntentError, ResourceBusyError, describe
from intent_recognition.kinematics.forward import hand_position
from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.storage.bag_writer import BagWriter
from sim_bridge.coworker.demonstration import WristDemonstration, plan_demonstration
from sim_bridge.coworker.hardness import TEST_COUNTS, TRAINING_COUNTS, demonstration_rng
from sim_bridge.coworker.styles import TASKS
from sim_bridge.scene import handover_point
from sim_bridge.teaching import TaughtArm, teach
from sim_bridge.teaching_path import TeachingPath, plan_teaching

POSE_TOPIC, POSE_TYPE = "mocap/wrist/pose", "geometry_msgs/msg/PoseStamped"
JOINT_TOPIC, JOINT_TYPE = "joint_states", "sensor_msgs/msg/JointState"
EPOCH_NS = 1_767_225_600_000_000_000  # 2026-01-01 00:00 UTC, the day of all recordings
SAMPLE_NS = 10_000_000

# What the sensors can tell apart, as powers of two: encoders and trackers deliver counts.
ANGLE_STEP_RAD = 2.0**-20
RATE_STEP_RAD_S = 2.0**-16
TORQUE_STEP_NM = 2.0**-10
POSITION_STEP_M = 2.0**-17
QUATERNION_STEP = 2.0**-17

SETS = {"train": (0, TRAINING_COUNTS), "test": (1, TEST_COUNTS)}


@dataclass(frozen=True)
class Order:
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
    def start_ns(self) -> int:
        """Stamp of the first sample: one demonstration a minute, from a fixed day on."""
        minute = 1000 * SETS[self.purpose][0] + 100 * TASKS.index(self.task) + self.index
        return EPOCH_NS + minute * 60_000_000_000


@dataclass(frozen=True)
class Demonstrated:
    """One demonstration: the worker, where the arm was led, and what its sensors said."""

    order: Order
    wrist: WristDemonstration
    path: TeachingPath
    arm: TaughtArm

    @property
    def teaching_error_m(self) -> float:
        """Distance of the measured hand at the arrival from where the rule puts it."""
        arrived = round(self.wrist.arrival_s * 100.0)
        point = handover_point(self.order.task, self.wrist.reach.goal_m)
        return float(np.linalg.norm(hand_position(self.arm.positions_rad[arrived]) - point))


def orders(seed: int, purposes: Sequence[str] = ("train", "test")) -> list[Order]:
    """Every demonstration of the sets: 48 for training, 12 for testing."""
    return [
        Order(seed, purpose, task, index)
        for purpose in purposes
        for task, count in SETS[purpose][1].items()
        for index in range(count)
    ]


def demonstrate(order: Order) -> Demonstrated:
    """Simulate one demonstration: the worker reaches, a person leads the arm.

    Raises:
        ArgumentError: unknown task or set.
    """
    if order.purpose not in SETS:
        raise ArgumentError(
            describe("purpose", f"one of {sorted(SETS)}", order.purpose, "Correct the set.")
        )
    rng = demonstration_rng(order.seed, SETS[order.purpose][0], order.task, order.index)
    wrist = plan_demonstration(rng, order.task)
    length = float(wrist.samples.times_s[-1])
    path = plan_teaching(
        rng, order.task, wrist.reach.goal_m, wrist.onset_s, wrist.arrival_s, length
    )
    return Demonstrated(order, wrist, path, teach(rng, path, wrist.samples.true_positions_m))


def metadata(shown: Demonstrated) -> dict[str, str]:
    """What metadata.yaml says under custom_data."""
    wrist, times = shown.wrist, shown.path.times

    def stamp(seconds: float) -> str:
        return str(shown.order.start_ns + round(seconds * 1e9))

    def vector(values: np.ndarray) -> str:
        return " ".join(f"{value:.6f}" for value in values)

    return {
        "task": shown.order.task,
        "simulated": "true",
        "set": shown.order.purpose,
        "generator": "python -m sim_bridge.generate",
        "generator_version": __version__,
        "seed": str(shown.order.seed),
        "index": str(shown.order.index),
        "human_onset_ns": stamp(wrist.onset_s),
        "human_end_ns": stamp(wrist.end_s),
        "robot_start_ns": stamp(times.start_s),
        "robot_taught_ns": stamp(times.taught_s),
        "robot_arrival_ns": stamp(times.arrival_s),
        "tempo_s": f"{wrist.reach.nominal_s:.6f}",
        "hesitations": str(len(wrist.reach.hesitations)),
        "start_m": vector(wrist.reach.start_m),
        "goal_m": vector(wrist.reach.goal_m),
        "handover_point_m": vector(handover_point(shown.order.task, wrist.reach.goal_m)),
        "teaching_error_m": f"{shown.teaching_error_m:.6f}",
        "strongest_pull_n": f"{shown.arm.strongest_pull_n:.3f}",
    }


def messages(shown: Demonstrated) -> Iterator[tuple[str, str, int, dict]]:
    """Yield (topic, type, stamp in ns, fields), in order of time."""
    samples, arm = shown.wrist.samples, shown.arm
    positions = to_counts(samples.positions_m, POSITION_STEP_M)
    turns = to_counts(samples.orientations, QUATERNION_STEP)
    angles = to_counts(arm.positions_rad, ANGLE_STEP_RAD)
    rates = to_counts(arm.velocities_rad_s, RATE_STEP_RAD_S)
    torques = to_counts(arm.torques_nm, TORQUE_STEP_NM)
    for k in range(len(samples.times_s)):
        stamp = shown.order.start_ns + k * SAMPLE_NS
        if samples.visible[k]:
            yield POSE_TOPIC, POSE_TYPE, stamp, pose_fields(stamp, positions[k], turns[k])
        yield JOINT_TOPIC, JOINT_TYPE, stamp, {
            "header": {"stamp": stamp},
            "name": list(JOINT_NAMES),
            "position": angles[k],
            "velocity": rates[k],
            "effort": torques[k],
        }  # fmt: skip


def write_demonstration(shown: Demonstrated, output: Path) -> Path:
    """Write one demonstration as a bag below `output`/toolbox; return its directory.

    Raises:
        ResourceBusyError: the directory exists already.
    """
    folder = output / "toolbox" / shown.order.purpose / shown.order.name
    with BagWriter(folder, metadata(shown), flush_period_s=None) as bag:
        for topic, kind, stamp, fields in messages(shown):
            bag.write_message(topic, kind, fields, stamp)
    return folder


def generate(
    output: Path,
    seed: int,
    *,
    jobs: int = 2,
    overwrite: bool = False,
    purposes: Sequence[str] = ("train", "test"),
    progress: Callable[[str, int, int], None] = lambda name, done, total: None,
) -> list[Path]:
    """Make and write all demonstrations.

    Args:
        output: the folder that gets toolbox/train and toolbox/test.
        seed: of all variation.
        jobs: number of processes.
        overwrite: replace bags of the same name.
        purposes: which sets to make.
        progress: called with (bag just written, bags written, bags in all).

    Raises:
        ArgumentError: jobs or seed out of range.
        ResourceBusyError: a bag of that name exists and `overwrite` is not set.
    """
    if jobs < 1 or seed < 0:
        raise ArgumentError(
            describe("jobs, seed", "jobs >= 1 and seed >= 0", (jobs, seed), "Give such numbers.")
        )
    todo = orders(seed, purposes)
    for order in todo:
        folder = output / "toolbox" / order.purpose / order.name
        if folder.exists() and not overwrite:
            cure = "Choose another folder or add --overwrite."
            raise ResourceBusyError(describe("output", "no bag of that name", folder, cure))
        if folder.exists():
            shutil.rmtree(folder)
    written = []
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(_make, order, output) for order in todo]
        for future in as_completed(futures):
            written.append(future.result())
            progress(written[-1].name, len(written), len(todo))
    return sorted(written)


def _make(order: Order, output: Path) -> Path:
    return write_demonstration(demonstrate(order), output)


def to_counts(values: np.ndarray, step: float) -> np.ndarray:
    """Values as a sensor of that resolution delivers them."""
    return np.round(values / step) * step


def pose_fields(stamp_ns: int, position: np.ndarray, turn: np.ndarray) -> dict:
    """Fields of a PoseStamped in the world: position (3,) [m], quaternion (4,) xyzw."""
    return {
        "header": {"stamp": stamp_ns, "frame_id": "world"},
        "pose": {
            "position": dict(zip("xyz", position.tolist(), strict=True)),
            "orientation": dict(zip("xyzw", turn.tolist(), strict=True)),
        },
    }


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m sim_bridge.generate",
        description="Simulate the demonstrations and test recordings of the toolbox assembly.",
    )
    parser.add_argument("--output", type=Path, default=Path("bags"), help="folder for the bags")
    parser.add_argument("--seed", type=int, default=1, help="of all variation (default 1)")
    parser.add_argument("--jobs", type=int, default=2, help="number of processes (default 2)")
    parser.add_argument("--overwrite", action="store_true", help="replace bags of the same name")
    parser.add_argument("--sets", nargs="+", choices=sorted(SETS), default=sorted(SETS))
    return parser


def main(args: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    options = _parser().parse_args(args)
    from rich.progress import Progress

    try:
        with Progress() as bar:
            task = bar.add_task("demonstrations", total=len(orders(0, options.sets)))
            written = generate(
                options.output,
                options.seed,
                jobs=options.jobs,
                overwrite=options.overwrite,
                purposes=options.sets,
                progress=lambda name, done, total: bar.update(
                    task, completed=done, total=total, description=name
                ),
            )
    except IntentError as error:
        sys.stderr.write(f"generate: {error}\n")
        return 1
    size = sum(f.stat().st_size for folder in written for f in folder.iterdir())
    sys.stdout.write(f"{len(written)} bags of {len(TASKS)} tasks, {size / 1e6:.1f} MB\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
