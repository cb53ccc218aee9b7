# SPDX-License-Identifier: Apache-2.0
"""A whole recording of raw poses through the ingest at once, with the results of one by one."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from intent_recognition.errors import ShapeError, describe
from intent_recognition.tracking.ingest import (
    FARTHEST_M,
    IDENTITY,
    IngestSettings,
    IngestState,
    TrackedPose,
    frame_name,
    ingest_pose,
)
from intent_recognition.tracking.transforms import (
    RigidTransform,
    multiply_quaternions,
    normalise_quaternion,
)

GATE_SHARE = 1.0 - 1e-9
"""A step closer to the gate than this is left to the exact test."""


@dataclass(frozen=True)
class AcceptedPoses:
    """What the ingest accepts of a recording, world frame; n poses.

    Attributes:
        rows: which samples these are, int64 (n,).
        positions: (n, 3) [m].
        orientations: unit quaternions (n, 4) xyzw; None when they were not asked for.
        rejected: number of the other samples, by reason.
    """

    rows: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray | None
    rejected: Counter[str] = field(default_factory=Counter)


def ingest_poses(
    settings: IngestSettings,
    stamps_ns: np.ndarray,
    positions: np.ndarray,
    orientations: np.ndarray,
    frame_ids: tuple[str, ...],
    frames: np.ndarray,
    *,
    oriented: bool = True,
) -> AcceptedPoses:
    """All samples of one body in order, from the initial state; equal to `ingest_pose` in a loop.

    A sample that any loop would accept is accepted in bulk; from one that may not be, the samples
    go through `ingest_pose` one by one until it accepts one again.

    Args:
        settings: frames, gate and noise.
        stamps_ns: times of measurement, int64 (T,).
        positions: (T, 3) [m] in their frames.
        orientations: (T, 4) xyzw in their frames.
        frame_ids: names of the frames.
        frames: index into `frame_ids` of each sample, int (T,).
        oriented: whether orientations are wanted; without them it is much faster.

    Raises:
        ShapeError: the arrays do not fit each other.
    """
    shapes = (positions.shape, orientations.shape, frames.shape)
    count = stamps_ns.size
    if shapes != ((count, 3), (count, 4), (count,)):
        expected = f"shapes ({count}, 3), ({count}, 4) and ({count},)"
        raise ShapeError(
            describe("positions, orientations, frames", expected, shapes, "Pass one row a stamp.")
        )
    usable = _usable(settings, stamps_ns, positions, orientations, frame_ids, frames)
    world = _to_world(settings, positions, frame_ids, frames, usable)
    doubtful = np.flatnonzero(~(usable & _follows(settings, stamps_ns, world, usable)))
    accepted = np.ones(count, bool)
    rejected: Counter[str] = Counter()
    at = 0
    while (ahead := int(np.searchsorted(doubtful, at))) < doubtful.size:
        at = int(doubtful[ahead])
        # Of the state all but the last sample serves the velocity, which nobody asks for here.
        recent = ((int(stamps_ns[at - 1]), world[at - 1]),) if at else ()
        state = IngestState(recent=recent)
        while at < count:
            state, result = ingest_pose(
                settings,
                state,
                int(stamps_ns[at]),
                positions[at],
                orientations[at],
                frame_ids[frames[at]],
            )
            at += 1
            if isinstance(result, TrackedPose):
                break
            accepted[at - 1] = False
            rejected[result.reason] += 1
    rows = np.flatnonzero(accepted)
    turned = _turned(settings, orientations, frame_ids, frames, rows) if oriented else None
    return AcceptedPoses(rows, world[rows], turned, rejected)


def _usable(settings, stamps_ns, positions, orientations, frame_ids, frames) -> np.ndarray:
    """Samples with nothing wrong in themselves, bool (T,)."""
    known = np.array([frame_name(frame) in settings._frames for frame in frame_ids], bool)
    usable = known[frames] if known.size else np.zeros(stamps_ns.size, bool)
    usable &= stamps_ns > 0
    usable &= np.all(np.abs(positions) <= FARTHEST_M, axis=1)  # False for NaN too
    usable &= np.all(np.isfinite(orientations), axis=1)
    return usable


def _to_world(settings, positions, frame_ids, frames, usable) -> np.ndarray:
    """Positions in the world frame (T, 3), bit for bit as one by one; NaN where not usable."""
    world = np.where(usable[:, None], positions, np.nan)
    for index, frame in enumerate(frame_ids):
        transform = settings._frames.get(frame_name(frame))
        if transform is None:
            continue
        rows = np.flatnonzero((frames == index) & usable)
        if _is_identity(transform):
            world[rows] = positions[rows] + 0.0  # a negative zero comes out positive
        else:
            # One by one: a matrix product of all of them may round otherwise.
            for row in rows:
                world[row] = transform.apply(positions[row])
    return world


def _is_identity(transform: RigidTransform) -> bool:
    if np.any(transform.translation) or np.any(np.signbit(transform.translation)):
        return False
    return np.array_equal(transform.rotation, np.eye(3))


def _follows(settings, stamps_ns, world, usable) -> np.ndarray:
    """Samples that continue the track surely if the one before was accepted, bool (T,)."""
    follows = np.zeros(stamps_ns.size, bool)
    if not follows.size:
        return follows
    follows[0] = True  # nothing to compare the first with
    steps_ns = np.diff(stamps_ns)
    with np.errstate(invalid="ignore"):
        lengths_m = np.sqrt(np.sum(np.diff(world, axis=0) ** 2, axis=1))
        reach_m = settings.max_speed_m_s * steps_ns * 1e-9 + settings._margin_m
        near = lengths_m <= GATE_SHARE * reach_m
    gap = steps_ns * 1e-9 > settings.max_gap_s
    follows[1:] = (steps_ns > 0) & usable[:-1] & (near | gap)
    return follows


def _turned(settings, orientations, frame_ids, frames, rows) -> np.ndarray:
    """Orientations of the accepted samples in the world frame, (n, 4)."""
    turned = np.empty((rows.size, 4))
    transforms = [settings._frames.get(frame_name(frame)) for frame in frame_ids]
    for k, row in enumerate(rows):
        unit = normalise_quaternion(orientations[row])
        if unit is None:
            turned[k] = IDENTITY
        else:
            turned[k] = multiply_quaternions(transforms[frames[row]].quaternion, unit)
    return turned
