# SPDX-License-Identifier: Apache-2.0
"""All raw poses of a recording checked at once, with the results of `ingest_pose` in a loop."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ShapeError
from intent_recognition.tracking.ingest import (
    FARTHEST_M,
    NO_ROTATION,
    IngestState,
    TrackedPose,
    ingest_pose,
)
from intent_recognition.tracking.settings import IngestSettings, frame_name
from intent_recognition.tracking.transforms import (
    RigidTransform,
    multiply_quaternions,
    normalise_quaternion,
)

GATE_SHARE = 1.0 - 1e-9
"""Steps closer to the gate than this share of it are checked one by one. Convention: above the
rounding of lengths, which are computed in another order here."""


@dataclass(frozen=True)
class AcceptedPoses:
    """The n accepted poses of a recording, world frame.

    Attributes:
        rows: which samples these are, int64 (n,).
        positions: (n, 3) [m].
        orientations: unit quaternions (n, 4) xyzw; None when they were not asked for.
        rejected: number of the other samples, by reason.
    """

    rows: NDArray[np.int64]
    positions: NDArray[np.float64]
    orientations: NDArray[np.float64] | None
    rejected: Counter[str] = field(default_factory=Counter)


def ingest_poses(
    settings: IngestSettings,
    stamps_ns: NDArray[np.int64],
    positions: NDArray[np.float64],
    orientations: NDArray[np.float64],
    frame_ids: tuple[str, ...],
    frames: NDArray[np.int64],
    *,
    oriented: bool = True,
) -> AcceptedPoses:
    """All samples of one body in order, from the initial state; equal to `ingest_pose` in a loop.

    Samples that `ingest_pose` surely accepts are accepted together. From a sample that it may
    reject, samples are passed to it one by one until it accepts one again.

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
        raise ShapeError.about(
            "positions, orientations, frames", expected, shapes, "Pass one row a stamp."
        )
    usable = _usable(settings, stamps_ns, positions, orientations, frame_ids, frames)
    world = _to_world(settings, positions, frame_ids, frames, usable)
    uncertain = np.flatnonzero(~(usable & _follows(settings, stamps_ns, world, usable)))
    accepted = np.ones(count, bool)
    rejected: Counter[str] = Counter()
    at = 0
    while (ahead := int(np.searchsorted(uncertain, at))) < uncertain.size:
        at = int(uncertain[ahead])
        # Earlier samples of the state matter for the velocity only, which is not needed here.
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


def _usable(
    settings: IngestSettings,
    stamps_ns: NDArray[np.int64],
    positions: NDArray[np.float64],
    orientations: NDArray[np.float64],
    frame_ids: tuple[str, ...],
    frames: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Samples with nothing wrong in themselves, bool (T,)."""
    known = np.array([frame_name(frame) in settings.frames for frame in frame_ids], bool)
    usable = known[frames] if known.size else np.zeros(stamps_ns.size, bool)
    usable &= stamps_ns > 0
    usable &= np.all(np.abs(positions) <= FARTHEST_M, axis=1)  # False for NaN too
    usable &= np.all(np.isfinite(orientations), axis=1)
    return usable


def _to_world(
    settings: IngestSettings,
    positions: NDArray[np.float64],
    frame_ids: tuple[str, ...],
    frames: NDArray[np.int64],
    usable: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Positions in the world frame (T, 3), bit for bit as one by one; NaN where not usable."""
    world = np.where(usable[:, None], positions, np.nan)
    for index, frame in enumerate(frame_ids):
        transform = settings.frames.get(frame_name(frame))
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


def _follows(
    settings: IngestSettings,
    stamps_ns: NDArray[np.int64],
    world: NDArray[np.float64],
    usable: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Samples that continue the track surely if the one before was accepted, bool (T,)."""
    follows = np.zeros(stamps_ns.size, bool)
    if not follows.size:
        return follows
    follows[0] = True  # nothing to compare the first with
    steps_ns = np.diff(stamps_ns)
    with np.errstate(invalid="ignore"):
        lengths_m = np.sqrt(np.sum(np.diff(world, axis=0) ** 2, axis=1))
        reach_m = settings.max_speed_m_s * steps_ns * 1e-9 + settings.margin_m
        near = lengths_m <= GATE_SHARE * reach_m
    gap = steps_ns * 1e-9 > settings.max_gap_s
    follows[1:] = (steps_ns > 0) & usable[:-1] & (near | gap)
    return follows


def _turned(
    settings: IngestSettings,
    orientations: NDArray[np.float64],
    frame_ids: tuple[str, ...],
    frames: NDArray[np.int64],
    rows: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Orientations of the accepted samples in the world frame, (n, 4)."""
    turned = np.empty((rows.size, 4))
    known = settings.frames
    transforms = [known.get(frame_name(frame), RigidTransform.identity()) for frame in frame_ids]
    for k, row in enumerate(rows):
        unit = normalise_quaternion(orientations[row])
        if unit is None:
            turned[k] = NO_ROTATION
        else:
            turned[k] = multiply_quaternions(transforms[frames[row]].quaternion, unit)
    return turned
