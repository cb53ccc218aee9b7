# SPDX-License-Identifier: Apache-2.0
"""Executions corrected by hand, as demonstrations: what is read, copied and refused."""

import pytest

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.demonstrations import CORRECTION_TOPIC, CORRECTION_TYPE, write_corrected
from intent_recognition.errors import BagError

JOINTS, START_NS = "sensor_msgs/msg/JointState", 10**9


def execution(path, points):
    """Ten samples of a joint that rests at 0, of a gripper that tells its effort alone."""
    with BagWriter(path, {"task": "give"}) as writer:
        for ns in range(START_NS, START_NS + 10**8, 10**7):
            joint = {"header": {"stamp": ns}, "name": ["elbow"], "position": [0.0]}
            grip = {"header": {"stamp": ns}, "name": ["grip"], "effort": [1.5]}
            writer.write_message("/joint_states", JOINTS, joint, ns)
            writer.write_message("/gripper/joint_states", JOINTS, grip, ns)
        path_ = {"header": {"stamp": START_NS}, "joint_names": ["elbow"], "points": points}
        writer.write_message(CORRECTION_TOPIC, CORRECTION_TYPE, path_, ns)
    return path


def test_the_arm_is_where_it_was_corrected_to_and_the_rest_as_it_was(tmp_path):
    points = [{"positions": [k], "time_from_start": k * 10**8} for k in range(2)]
    source, target = execution(tmp_path / "given", points), tmp_path / "kept"
    write_corrected(source, target, {"task": "give"})
    found = [m.message.position[0] for m in BagReader(target).messages(["joint_states"])]
    assert found == pytest.approx([0.1 * k for k in range(10)])
    grip = [
        [raw.data for raw in BagReader(bag).raw_messages(["gripper/joint_states"])]
        for bag in (source, target)
    ]
    assert grip[0] == grip[1] and len(grip[0]) == 10


@pytest.mark.parametrize("points", [[], [{"positions": [1.0, 2.0]}], [{"positions": [1.0]}, {}]])
def test_a_correction_without_a_position_of_each_joint_is_refused(points, tmp_path):
    source = execution(tmp_path / "given", points)
    with pytest.raises(BagError, match="correction: expected positions of 1 joints at each point"):
        write_corrected(source, tmp_path / "kept", {})
    assert not (tmp_path / "kept").exists()
