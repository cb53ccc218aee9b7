# SPDX-License-Identifier: Apache-2.0
"""A recording at once gives what its samples give one by one."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.bags import PoseColumns
from intent_recognition.tracking import IngestSettings, IngestState, Rejected, ingest_pose
from intent_recognition.tracking.ingest import ingest_poses

T0 = 10**18
STEP = 10**7
FRAMES = ("world", "/tracker", "elsewhere")
TRACKER = (np.array([1.0, -2.0, 0.3]), np.array([0.1, -0.4, 0.2, 0.9]))
SETTINGS = (
    IngestSettings(),
    IngestSettings(extrinsics={"tracker": TRACKER}, reanchor_after=3, clock_reset_after=3),
    IngestSettings(extrinsics={"tracker": (-np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))}),
)


def raw(stamps_ns, *parts):
    return PoseColumns(stamps_ns, stamps_ns, *parts)


def one_by_one(setting, stamps_ns, positions, orientations, frames):
    """Rows, poses and counts of the loop."""
    state, rows, poses, rejected = IngestState(), [], [], Counter()
    for row, (stamp, position, orientation, frame) in enumerate(
        zip(stamps_ns.tolist(), positions, orientations, frames, strict=True)
    ):
        state, result = ingest_pose(setting, state, stamp, position, orientation, FRAMES[frame])
        if isinstance(result, Rejected):
            rejected[result.reason] += 1
        else:
            rows.append(row)
            poses.append(result)
    return rows, poses, rejected


def check(setting, stamps_ns, positions, orientations, frames):
    rows, poses, rejected = one_by_one(setting, stamps_ns, positions, orientations, frames)
    raw_poses = raw(stamps_ns, FRAMES, frames, positions, orientations)
    world, accepted, counts = ingest_poses(setting, raw_poses)
    assert accepted.tolist() == rows
    assert counts == rejected
    expected = np.array([pose.position for pose in poses]).reshape(-1, 3)
    np.testing.assert_allclose(world.positions[rows], expected, rtol=1e-14, atol=1e-14)
    turned = [p.orientation if p.orientation_measured else np.full(4, np.nan) for p in poses]
    turned = np.array(turned).reshape(-1, 4)
    np.testing.assert_allclose(world.orientations[rows], turned, atol=1e-14)


NUMBERS = st.sampled_from([0.0, -0.0, 0.4, -0.7, 1e-300, 1e5, 2e5, np.nan, np.inf])
SAMPLE = st.tuples(
    st.sampled_from([1, 1, 1, 1, 0, -3, 5, 60, -200]),  # steps of the stamp
    st.floats(-0.1, 0.1),
    st.one_of(st.none(), st.none(), st.none(), st.floats(-3.0, 3.0), NUMBERS),
    st.one_of(st.none(), st.none(), st.none(), NUMBERS),
    st.sampled_from([0, 0, 0, 1, 2]),
)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(st.lists(SAMPLE, max_size=60), st.sampled_from(SETTINGS), st.sampled_from([T0, 3 * STEP, 0]))
def test_anything_equals_one_by_one(samples, setting, start_ns):
    steps, moves, outliers, turns, frames = zip(*samples, strict=True) if samples else [()] * 5
    stamps_ns = start_ns + STEP * np.cumsum(np.array(steps, np.int64), dtype=np.int64)
    positions = np.cumsum(np.outer(moves, [1.0, 0.5, -0.2]), axis=0).reshape(-1, 3)
    orientations = np.tile([0.1, 0.2, -0.3, 0.8], (len(samples), 1))
    for row, (outlier, turn) in enumerate(zip(outliers, turns, strict=True)):
        if outlier is not None:
            positions[row, row % 3] = outlier
        if turn is not None:
            orientations[row, : 1 + row % 4] = turn
    check(setting, stamps_ns, positions, orientations, np.array(frames, np.int64))


@pytest.mark.parametrize("setting", SETTINGS)
def test_a_long_walk_with_steps_at_the_gate(setting):
    rng = np.random.default_rng(3)
    count = 2000
    stamps_ns = T0 + np.cumsum(rng.integers(STEP // 2, 2 * STEP, count))
    reach = setting.max_speed_m_s * np.diff(stamps_ns, prepend=stamps_ns[0]) * 1e-9 + 0.012
    share = rng.choice([0.1, 1.0 - 1e-12, 1.0, 1.0 + 1e-12], count, p=[0.97, 0.01, 0.01, 0.01])
    positions = np.cumsum(np.outer(reach * share, [1.0, 0.0, 0.0]), axis=0) + [0.0, 0.3, -0.0]
    orientations = rng.normal(size=(count, 4))
    check(setting, stamps_ns, positions, orientations, np.zeros(count, np.int64))


def test_no_samples():
    none = np.empty(0, np.int64)
    empty = raw(none, (), none, np.empty((0, 3)), np.empty((0, 4)))
    world, accepted, rejected = ingest_poses(SETTINGS[0], empty)
    assert accepted.size == 0 and world.positions.shape == (0, 3)
    assert world.orientations.shape == (0, 4) and not rejected
