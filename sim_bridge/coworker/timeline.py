# SPDX-License-Identifier: Apache-2.0
"""Turn movements on a time line into the poses that a marker tracker would deliver."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Flags, Floats
from sim_bridge.coworker.noise import (
    MARKER_ANGLE_STD_RAD,
    MARKER_STD_M,
    RATE_HZ,
    SWAY_STD_M,
    occlusions,
    signal_dependent,
    smooth_noise,
    tremor,
)
from sim_bridge.coworker.reach import WristMovement

# The wrist at rest: its x axis (along the hand) toward the robot, its z axis up.
REST_QUATERNION = np.array([0.0, 0.0, 1.0, 0.0])


@dataclass(frozen=True)
class WristSamples:
    """The wrist, sampled at 100 Hz."""

    times_s: Floats  # seconds since the first sample, (T,)
    positions_m: Floats  # measured positions (T, 3), world
    orientations: Floats  # measured orientations (T, 4), quaternion xyzw, world
    # False where the tracker lost the marker, (T,); such samples are not delivered
    visible: Flags
    true_positions_m: Floats  # true positions (T, 3) with sway and tremor, world


def sample_wrist(
    rng: np.random.Generator,
    movements: Sequence[tuple[float, WristMovement]],
    length_s: float,
    *,
    gaps_per_s: float,
    rest: Floats = REST_QUATERNION,
) -> WristSamples:
    """Sample the wrist over `length_s` seconds of rest, movements and holds.

    `movements` are pairs of onset [s] and movement in order of time. Each starts where the one
    before ended and the wrist rests, or where it interrupts the one before. `rest` is the
    orientation at rest, a quaternion xyzw (4,).
    """
    count = round(length_s * RATE_HZ) + 1
    times = np.arange(count) / RATE_HZ
    planned = np.tile(movements[0][1].start_m, (count, 1))
    rotation = np.zeros((count, 3))
    following = [onset_s for onset_s, _ in movements[1:]] + [np.inf]
    for (onset_s, movement), next_s in zip(movements, following, strict=True):
        first = int(np.searchsorted(times, onset_s))
        end_s = min(onset_s + movement.duration_s, next_s)
        last = int(np.searchsorted(times, end_s, side="right"))
        rest_from, rest_until = last + 1, int(np.searchsorted(times, next_s))
        local = times[first:rest_from] - onset_s
        before = rotation[first - 1] if first else np.zeros(3)
        planned[first:rest_from] = movement.positions(local)
        rotation[first:rest_from] = movement.rotations(local, before)
        planned[rest_from:rest_until] = planned[first:rest_from][-1:]
        rotation[rest_from:rest_until] = rotation[first:rest_from][-1:]
        planned[first:last] += signal_dependent(rng, planned[first:last])
    sway = SWAY_STD_M * smooth_noise(rng, count, 0.25)
    true = planned + sway + tremor(rng, count)
    measured = true + MARKER_STD_M * rng.standard_normal((count, 3))
    rotation = rotation + MARKER_ANGLE_STD_RAD * rng.standard_normal((count, 3))
    visible = occlusions(rng, count, gaps_per_s, 0.002)
    return WristSamples(times, measured, quaternions(rotation, rest), visible, true)


def quaternions(rotation_vectors: Floats, rest: Floats = REST_QUATERNION) -> Floats:
    """Unit quaternions xyzw (T, 4) of the wrist in the world, without jumps of sign.

    The rotation vectors (T, 3) are in the wrist's axes, relative to its orientation `rest` (4,).
    """
    out = (Rotation.from_quat(rest) * Rotation.from_rotvec(rotation_vectors)).as_quat()
    flips = np.sign(np.sum(out[1:] * out[:-1], axis=1))
    out[1:] *= np.cumprod(np.where(flips < 0, -1.0, 1.0))[:, None]
    return out
