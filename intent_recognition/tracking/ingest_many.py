# SPDX-License-Identifier: Apache-2.0
"""All raw poses of a recording checked at once, with the results of `ingest_pose` in a loop."""

from collections import Counter
from dataclasses import replace

import numpy as np

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.bags import PoseColumns
from intent_recognition.tracking.ingest import FARTHEST_M, IngestState, TrackedPose, ingest_pose
from intent_recognition.tracking.settings import IngestSettings, frame_name
from intent_recognition.tracking.transforms import multiply_quaternions, normalise_quaternions


def ingest_poses(
    settings: IngestSettings, raw: PoseColumns
) -> tuple[PoseColumns, Integers, Counter[str]]:
    """All samples of one body in order, from the initial state; equal to `ingest_pose` in a loop.

    Samples that `ingest_pose` surely accepts are accepted together. From a sample that it may
    reject, samples are passed to it one by one until it accepts one again. Positions are in metres.

    Returns:
        The samples in the world frame, with unit quaternions, NaN where none was measured; which of
        them are accepted, int64 (n,); and the number of the others, by reason.
    """
    stamps_ns, frames = raw.stamps_ns, raw.frames
    positions, orientations = raw.positions, raw.orientations
    usable = (stamps_ns > 0) & np.all(np.isfinite(orientations), axis=1)
    usable &= np.all(np.abs(positions) <= FARTHEST_M, axis=1)  # False for NaN too
    world, turned = (np.full(given.shape, np.nan) for given in (positions, orientations))
    for index, frame in enumerate(map(frame_name, raw.frame_ids)):
        if (transform := settings.frames.get(frame)) is not None:
            rows = usable & (frames == index)
            world[rows] = transform.apply(positions[rows])
            units = normalise_quaternions(orientations[rows])
            turned[rows] = multiply_quaternions(transform.quaternion, units.T).T
    uncertain = np.flatnonzero(~_follows(settings, stamps_ns, world))
    accepted = np.ones(stamps_ns.size, bool)
    rejected: Counter[str] = Counter()
    at = 0
    while (ahead := int(np.searchsorted(uncertain, at))) < uncertain.size:
        at = int(uncertain[ahead])
        # Earlier samples of the state matter for the velocity only, which is not needed here.
        recent = ((int(stamps_ns[at - 1]), world[at - 1]),) if at else ()
        state = IngestState(recent=recent)
        while at < stamps_ns.size:
            pose = positions[at], orientations[at], raw.frame_ids[frames[at]]
            state, result = ingest_pose(settings, state, int(stamps_ns[at]), *pose)
            at += 1
            if isinstance(result, TrackedPose):
                break
            accepted[at - 1] = False
            rejected[result.reason] += 1
    columns = replace(raw, positions=world, orientations=turned)
    return columns, np.flatnonzero(accepted), rejected


def _follows(settings: IngestSettings, stamps_ns: Integers, world: Floats) -> Flags:
    """Samples that continue the track surely if the one before was accepted, bool (T,)."""
    follows = np.isfinite(world[:, 0])
    steps_ns = np.diff(stamps_ns)
    lengths_m = np.linalg.norm(np.diff(world, axis=0), axis=1)
    reach_m = settings.max_speed_m_s * steps_ns * 1e-9 + settings.margin_m
    # rounding: lengths are computed in another order here
    near = lengths_m <= (1.0 - 1e-9) * reach_m
    gap = (steps_ns * 1e-9 > settings.max_gap_s) & follows[:-1]
    follows[1:] &= (steps_ns > 0) & (near | gap)  # the first has nothing to compare with
    return follows
