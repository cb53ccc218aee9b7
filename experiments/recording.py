# SPDX-License-Identifier: Apache-2.0
"""Topics, clock and sensor resolution of all recordings of the simulation."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from intent_recognition import __version__
from intent_recognition.array_types import Floats
from intent_recognition.bags import BagWriter
from intent_recognition.demonstrations import MARKER_TOPIC, MARKER_TYPE
from intent_recognition.kinematics import JOINT_NAMES
from sim_bridge.coworker import WristSamples

POSE_TOPIC, POSE_TYPE = "mocap/wrist/pose", "geometry_msgs/msg/PoseStamped"
JOINT_TOPIC, JOINT_TYPE = "joint_states", "sensor_msgs/msg/JointState"
EPOCH_NS = 1_767_225_600_000_000_000
"""2026-01-01 00:00 UTC [ns], from which the stamps of all recordings are counted."""
SAMPLE_NS = 10_000_000
"""Time between two samples [ns]: trackers and the arm report 100 times a second."""

# Sensors deliver counts. Powers of two far below the noise, so that files compress well.
ANGLE_STEP_RAD = 2.0**-20
"""Resolution of a joint's encoder [rad]."""
RATE_STEP_RAD_S = 2.0**-16
"""Resolution of a joint's velocity [rad/s]."""
TORQUE_STEP_NM = 2.0**-10
"""Resolution of a joint's torque [Nm]."""
POSITION_STEP_M = 2.0**-17
"""Resolution of a tracked position, 8 micrometres [m]."""
QUATERNION_STEP = 2.0**-17
"""Resolution of a tracked quaternion's components."""

PROVENANCE = {
    "simulated": "true",
    "generator": "python -m experiments.generate",
    "generator_version": __version__,
}
"""Metadata that every recording of the generator carries."""


Message = tuple[str, str, int, dict]
"""Topic, type, stamp in ns, fields."""
Content = tuple[Mapping[str, str], Iterable[Message]]
"""Metadata under custom_data, and messages in order of time."""


def known_of(seed: int, index: int) -> dict[str, str]:
    """Metadata of every numbered recording of a scenario."""
    return {**PROVENANCE, "seed": str(seed), "index": str(index)}


class ArmSamples(Protocol):
    """Measurements of the arm every 10 ms: positions, velocities, torques, each (T, 7)."""

    @property
    def positions_rad(self) -> Floats:
        """Joint angles [rad]."""

    @property
    def velocities_rad_s(self) -> Floats:
        """Joint velocities [rad/s]."""

    @property
    def torques_nm(self) -> Floats:
        """Joint torques [Nm]."""


def pose_and_joint_messages(
    start_ns: int, samples: WristSamples, arm: ArmSamples, topic: str = POSE_TOPIC
) -> Iterator[Message]:
    """Yield the messages of tracker and arm, in order of time; occluded poses are left out."""
    positions = to_counts(samples.positions_m, POSITION_STEP_M)
    turns = to_counts(samples.orientations, QUATERNION_STEP)
    angles = to_counts(arm.positions_rad, ANGLE_STEP_RAD)
    rates = to_counts(arm.velocities_rad_s, RATE_STEP_RAD_S)
    torques = to_counts(arm.torques_nm, TORQUE_STEP_NM)
    for k in range(len(samples.times_s)):
        stamp = start_ns + k * SAMPLE_NS
        if samples.visible[k]:
            yield topic, POSE_TYPE, stamp, pose_fields(stamp, positions[k], turns[k])
        yield JOINT_TOPIC, JOINT_TYPE, stamp, joint_fields(stamp, angles[k], rates[k], torques[k])


def session_messages(
    start_ns: int,
    marks: Iterable[tuple[float, str]],
    bodies: Mapping[str, WristSamples],
    steps: tuple[float, float] = (POSITION_STEP_M, QUATERNION_STEP),
) -> Iterator[Message]:
    """Yield markers and the poses of bodies, in order of time; occluded poses are left out.

    Args:
        start_ns: stamp of the first sample.
        marks: time [s] and label of each marker, "" at the end of a demonstration.
        bodies: samples by topic, as many of each.
        steps: resolution of positions [m], and of quaternions' components.
    """
    waiting = sorted((start_ns + round(at_s * 1e9), label) for at_s, label in marks)
    tracked = [
        (topic, body.visible, to_counts(body.positions_m, steps[0]),
         to_counts(body.orientations, steps[1]))
        for topic, body in bodies.items()
    ]  # fmt: skip
    for k in range(len(tracked[0][1])):
        stamp = start_ns + k * SAMPLE_NS
        while waiting and waiting[0][0] <= stamp:
            at_ns, label = waiting.pop(0)
            yield MARKER_TOPIC, MARKER_TYPE, at_ns, {"data": label}
        for topic, visible, positions, turns in tracked:
            if visible[k]:
                yield topic, POSE_TYPE, stamp, pose_fields(stamp, positions[k], turns[k])


def write_recording(folder: Path, metadata: Mapping[str, str], messages: Iterable[Message]) -> Path:
    """Write a bag; returns its directory."""
    with BagWriter(folder, dict(metadata), flush_period_s=None) as bag:
        for topic, kind, stamp_ns, fields in messages:
            bag.write_message(topic, kind, fields, stamp_ns)
    return folder


def to_counts(values: Floats, step: float) -> Floats:
    """Values as a sensor of that resolution delivers them."""
    return np.round(values / step) * step


def pose_fields(stamp_ns: int, position: Floats, turn: Floats) -> dict:
    """Fields of a PoseStamped in the world: position (3,) [m], quaternion (4,) xyzw."""
    return {
        "header": {"stamp": stamp_ns, "frame_id": "world"},
        "pose": {
            "position": dict(zip("xyz", position.tolist(), strict=True)),
            "orientation": dict(zip("xyzw", turn.tolist(), strict=True)),
        },
    }


def joint_fields(stamp_ns: int, q: Floats, qd: Floats, torque: Floats) -> dict:
    """Fields of a JointState of the arm: positions, velocities, torques (7,)."""
    return {
        "header": {"stamp": stamp_ns},
        "name": list(JOINT_NAMES),
        "position": q,
        "velocity": qd,
        "effort": torque,
    }


def recorded_at_ns(minutes: int) -> int:
    """Stamp of the first sample of a recording that begins so many minutes after the epoch."""
    return EPOCH_NS + minutes * 60_000_000_000


def metadata_stamp(start_ns: int, time_s: float) -> str:
    """A time since the first sample as metadata write it: a stamp in ns."""
    return str(start_ns + round(time_s * 1e9))


def metadata_vector(values: Floats) -> str:
    """A vector as metadata write it: six decimals, separated by spaces."""
    return " ".join(f"{value:.6f}" for value in values)
