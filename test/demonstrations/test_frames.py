# SPDX-License-Identifier: Apache-2.0
"""Extrinsics of the DOF file: raw recordings with them are the recordings in the world."""

from dataclasses import replace

import numpy as np
import pytest
from bag_builder import pose, write_pairs
from model_builder import ROBOT, WRIST
from tracking_frames import ENTRY, TRACKER, as_tracked

from intent_recognition.bags import POSE, BagReader
from intent_recognition.demonstrations import DofSpec, iter_observations, settle_orientations
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.reading import read_demonstrations, read_whole

TURN = DofEntry(
    WRIST.topic,
    POSE,
    tuple(f"pose.orientation.{axis}" for axis in "xyzw"),
    unit="rad",
    orientation="quaternion",
)
DOFS = DofSpec((WRIST, TURN), (ROBOT,))
WITH = replace(DOFS, extrinsics=(ENTRY,))


def turning(k):
    message = pose(k)
    half = 0.01 * k
    message["pose"]["orientation"] = {"x": np.sin(half), "w": np.cos(half)}
    return message


@pytest.fixture
def bags(tmp_path):
    poses = [turning(k) for k in range(60)]
    return write_pairs(tmp_path / "world", poses), write_pairs(
        tmp_path / "raw", map(as_tracked, poses)
    )


def test_reading_and_observing_give_the_recording_in_the_world(bags):
    in_world, raw = bags
    dofs = settle_orientations(DOFS, in_world)
    settled = settle_orientations(WITH, raw)
    np.testing.assert_allclose(settled.observed[1].reference, dofs.observed[1].reference, atol=1e-9)
    (expected,), _ = read_demonstrations(in_world, dofs)
    for found in (read_demonstrations(raw, settled)[0][0], read_whole(raw, settled)):
        assert found.frames == expected.frames == {WRIST.topic: ("world",)}
        assert not found.rejected
        for ours, theirs in zip(found.observed, expected.observed, strict=True):
            np.testing.assert_array_equal(ours.stamps_ns, theirs.stamps_ns)
            np.testing.assert_allclose(ours.values, theirs.values, atol=1e-9)
    in_world, raw = bags
    dofs = settle_orientations(DOFS, in_world)
    expected = list(iter_observations(BagReader(in_world), dofs))
    found = list(iter_observations(BagReader(raw), replace(dofs, extrinsics=(ENTRY,))))
    assert len(found) == len(expected) == 120
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours.values, theirs.values, atol=1e-9)


def test_without_extrinsics_the_frame_is_told_and_others_refuse_the_recording(bags):
    _, raw = bags
    dofs = DofSpec((WRIST,), (ROBOT,))
    (found,), _ = read_demonstrations(raw, dofs)
    assert found.frames == {WRIST.topic: (TRACKER,)}
    (nameless,), _ = read_demonstrations(raw, dofs, extrinsics={TRACKER: ([0] * 3, [0, 0, 0, 1])})
    assert nameless.frames == {WRIST.topic: ("world",)}
    for extrinsics in ((), ("elsewhere 0 0 0 0 0 0 1",)):
        dofs = DofSpec((WRIST,), (ROBOT,), extrinsics=extrinsics)
        found, (rejection,) = read_demonstrations(bags[1], dofs)
        assert not found and "60 unknown_frame" in rejection.reason
        assert "extrinsics in the DOF file" in rejection.cure


def test_other_poses_are_left_alone_and_tell_their_frame(tmp_path):
    tool = replace(WRIST, topic="tracker/tool")
    frames = ("/camera", "", "lens", "camera")
    poses = [pose(k, frame_id=frames[k % 4]) for k in range(20)]
    bag = write_pairs(tmp_path / "bag", poses, topic=tool.topic)
    (plain,), _ = read_demonstrations(bag, DofSpec((tool,), (ROBOT,)))
    (found,), _ = read_demonstrations(bag, DofSpec((tool,), (ROBOT,), extrinsics=(ENTRY,)))
    assert found.frames == plain.frames == {tool.topic: ("camera", "lens")}
    (led,), _ = read_demonstrations(bag, DofSpec((ROBOT,), (tool,)))
    assert led.frames == found.frames
    np.testing.assert_array_equal(found.observed[0].values, plain.observed[0].values)


def test_the_file_keeps_extrinsics():
    for dofs in (WITH, replace(DOFS, extrinsics=()), DOFS):
        assert DofSpec.from_dict(dofs.to_dict()) == dofs
    assert "extrinsics" not in DOFS.to_dict()
    assert DofSpec.from_dict(DOFS.to_dict() | {"extrinsics": None}) == DOFS
