# SPDX-License-Identifier: Apache-2.0
"""By columns or message by message, a recording becomes the same demonstrations."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from bag_builder import (
    JOINTS,
    LWR,
    POSE,
    START_NS,
    STEP_NS,
    joints,
    pose,
    write_bag,
    write_pairs,
    write_session,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.bags.reader import BagReader
from intent_recognition.demonstrations import DofEntry, DofSpec, load_dofs, read_demonstrations
from intent_recognition.demonstrations import collecting as module

DOFS = load_dofs()
TURN = tuple(f"pose.orientation.{axis}" for axis in "wx")
ORIENTED = DofSpec(
    (
        DofEntry("mocap/wrist/pose", POSE, ("pose.position.z", *TURN), unit="1"),
        DofEntry("mocap/wrist/pose", POSE, ("pose.position.x",), unit="m"),
    ),
    (DofEntry("joint_states", JOINTS, joints=("lwr_a3_joint", "lwr_a1_joint"), unit="rad"),),
)
SECONDS = DofSpec(
    (DofEntry("mocap/wrist/pose", POSE, ("header.stamp.nanosec",), unit="ns"),), DOFS.controlled
)
EXTRINSICS = {"tracker": (np.array([1.0, 0.5, 0.0]), np.array([0.1, 0.2, 0.3, 0.9]))}


def comparable(found):
    """Everything a demonstration or rejection holds, its arrays bit for bit."""
    if not hasattr(found, "observed"):
        return found
    signals = [
        (s.names, s.unit, s.stamps_ns.tobytes(), s.values.tobytes(), s.values.shape)
        for s in (*found.observed, *found.controlled)
    ]
    times = (found.start_ns, found.end_ns)
    return found.name, found.task, times, dict(found.metadata), dict(found.rejected), signals


def read(paths, dofs, **options):
    return [
        [comparable(found) for found in kind]
        for kind in read_demonstrations(paths, dofs, **options)
    ]


def check(path, dofs, monkeypatch, **options):
    by_columns = read(path, dofs, **options)
    with monkeypatch.context() as patch:
        patch.setattr(module, "has_columns", lambda entry: False)
        assert read(path, dofs, **options) == by_columns
    return by_columns


@pytest.mark.parametrize("dofs", [DOFS, ORIENTED, SECONDS])
def test_shipped_recordings(repository, monkeypatch, dofs):
    for name in ("plate_handover_00", "screw_handover_01"):
        found, _ = check(repository / "bags/toolbox/test" / name, dofs, monkeypatch)
        assert len(found) == 1


def test_columns_are_what_training_reads(tmp_path, monkeypatch):
    bag = write_bag(tmp_path / "bag")
    monkeypatch.setattr(BagReader, "messages", lambda *_: pytest.fail("read one by one"))
    found, _ = read(bag, DOFS)
    assert len(found) == 1


FAULTS = st.sampled_from(["nan", "inf", "zero", "again", "jump", "frame", "tracker", "turned"])
STATES = st.sampled_from(["nan", "gripper", "short", "again", "zero", "shuffled", "twice"])


def spoiled_pose(i, fault):
    changes = {
        "nan": {"x": float("nan")},
        "inf": {"x": float("inf")},
        "zero": {"stamp_ns": 0},
        "again": {"stamp_ns": START_NS + (i - 1) * STEP_NS},
        "jump": {"x": 3.0},
        "frame": {"frame_id": "elsewhere"},
        "tracker": {"frame_id": "/tracker"},
    }
    message = pose(i, **changes.get(fault, {}))
    if fault == "turned":
        message["pose"]["orientation"] = {"x": 0.3 * i, "y": 0.1, "w": 0.0}
    return message


def spoiled_joints(i, fault):
    changes = {
        "nan": {"positions": [float("nan")] * 7},
        "gripper": {"names": ["gripper"], "positions": [1.0]},
        "short": {"positions": [1.0, 2.0]},
        "again": {"stamp_ns": START_NS + (i - 1) * STEP_NS},
        "zero": {"stamp_ns": 0},
        "shuffled": {"names": LWR[::-1]},
        "twice": {"names": [*LWR[:6], LWR[0]]},
    }
    return joints(i, **changes.get(fault, {}))


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    poses=st.dictionaries(st.integers(0, 29), FAULTS, max_size=12),
    states=st.dictionaries(st.integers(0, 29), STATES, max_size=12),
    extrinsics=st.sampled_from([None, EXTRINSICS]),
    dofs=st.sampled_from([DOFS, ORIENTED]),
)
def test_spoiled_recordings(poses, states, extrinsics, dofs):
    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as monkeypatch:
        bag = write_pairs(
            Path(folder) / "bag",
            [spoiled_pose(i, poses.get(i)) for i in range(30)],
            [spoiled_joints(i, states.get(i)) for i in range(30)],
        )
        check(bag, dofs, monkeypatch, extrinsics=extrinsics)


def test_a_clock_set_back_keeps_the_longest_part(tmp_path, monkeypatch):
    poses = [pose(k, x=0.1) for k in (*range(500, 560), *range(300, 480))]
    states = [
        joints(250 + i, positions=[0.001 * i + j for j in range(7)]) for i in range(len(poses))
    ]
    bag = write_pairs(tmp_path / "bag", poses, states)
    ((found,), _) = check(bag, DOFS, monkeypatch)
    assert found[4] == {"stamp_not_increasing": 60}
    assert found[2][0] == START_NS + 300 * STEP_NS


def test_sessions_whole_and_truncated(tmp_path, monkeypatch):
    bag = write_session(tmp_path / "session", ["plate", "screw", "plate"])
    found, rejections = check(bag, DOFS, monkeypatch)
    assert len(found) == 3 and not rejections
    file = bag / "session_0.mcap"
    file.write_bytes(file.read_bytes()[:-3000])
    _, rejections = check(bag, DOFS, monkeypatch)
    assert rejections
