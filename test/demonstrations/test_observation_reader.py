# SPDX-License-Identifier: Apache-2.0
"""From a message to an observation: what was measured of it, with whose covariance."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from model_builder import GLOVE, TOOL, WRIST, make_dofs

from intent_recognition.bags.definitions import make_message
from intent_recognition.demonstrations.dofs import DofEntry, DofSpec
from intent_recognition.demonstrations.observations import ObservationReader, observation_readers
from intent_recognition.errors import DofError, MessageError

ODOMETRY = "nav_msgs/msg/Odometry"
HAND = DofEntry("hand", ODOMETRY, fields=("pose.pose.position.z", "pose.pose.position.x"), unit="m")
RATE = DofEntry(
    "radar",
    "geometry_msgs/msg/TwistStamped",
    fields=("twist.linear.x",),
    unit="m/s",
    of=("hand.pose.pose.position.x",),
    std=0.1,
)
SPEED = replace(RATE, topic="hand", type=ODOMETRY, fields=("twist.twist.linear.x",), std=None)
DOFS = replace(make_dofs(GLOVE, HAND), velocities=(RATE, SPEED))
FULL = 1.0 + np.arange(36.0).reshape(6, 6) + np.arange(36.0).reshape(6, 6).T
NAN = float("nan")


def glove(*positions, names=("thumb", "index")):
    return make_message(GLOVE.type, {"name": list(names), "position": list(positions)})


def hand(position=(1.0, 2.0, 3.0), speed=4.0, covariance=FULL):
    matrix = np.ravel(covariance).tolist()
    return make_message(
        ODOMETRY,
        {
            "pose": {"pose": {"position": dict(zip("xyz", position, strict=True))}}
            | {"covariance": matrix},
            "twist": {"twist": {"linear": {"x": speed}}, "covariance": matrix},
        },
    )


def test_fields_in_their_order_with_their_part_of_the_covariance_if_there_is_one():
    observation = ObservationReader(HAND, 1).observe(7, hand())
    assert observation[:2] == (7, 1) and observation.dofs is None and not observation.derivative
    assert observation.values.tolist() == [3.0, 1.0]
    np.testing.assert_array_equal(observation.covariance, FULL[np.ix_([2, 0], [2, 0])])
    full = np.array([[4.0, 1.0, 2.0], [1.0, 5.0, 3.0], [2.0, 3.0, 6.0]])
    fields = ("pose.position.z", "pose.orientation.x", "pose.position.x")
    entry = replace(WRIST, fields=fields)
    observation = ObservationReader(entry, 0).observe(1, make_message(WRIST.type, {}), full)
    expected = np.array([[6.0, 0.0, 2.0], [0.0, 0.0, 0.0], [2.0, 0.0, 4.0]])
    np.testing.assert_array_equal(observation.covariance, expected)
    assert ObservationReader(TOOL, 0).observe(1, make_message(TOOL.type, {})).covariance is None
    assert ObservationReader(HAND, 0).observe(1, hand(covariance=np.zeros(36))).covariance is None


def test_velocities_are_of_the_dofs_they_name():
    readers = observation_readers(DOFS)
    assert [i.group for i in readers] == [0, 1, 1, 1]
    speed = readers[3].observe(5, hand())
    assert speed.derivative and speed.dofs == (1,) and speed.values.tolist() == [4.0]
    np.testing.assert_array_equal(speed.covariance, FULL[:1, :1])
    assert readers[3].observe(5, hand(covariance=np.zeros(36))).covariance is None
    radar = make_message(RATE.type, {"twist": {"linear": {"x": 2.0}}})
    np.testing.assert_allclose(readers[2].observe(5, radar).covariance, [[0.01]])


@given(st.lists(st.one_of(st.just(NAN), st.floats(-9, 9)), min_size=4, max_size=4), st.data())
def test_of_joints_whatever_is_there(numbers, data):
    entry = replace(GLOVE, joints=tuple("abcd"))
    sent = data.draw(st.lists(st.sampled_from("abcdxy"), unique=True))
    values = dict(zip("abcd", numbers, strict=True)) | {"x": 0.0, "y": 1.0}
    message = glove(*(values[name] for name in sent), names=sent)
    there = [k for k, name in enumerate("abcd") if name in sent]
    if not there:
        with pytest.raises(MessageError, match="joint a"):
            ObservationReader(entry, 0).observe(1, message)
        return
    known = [k for k in there if not np.isnan(numbers[k])]
    observation = ObservationReader(entry, 0).observe(1, message)
    if not known:  # nothing was measured: refused as a whole
        assert observation.dofs is None and np.all(np.isnan(observation.values))
    else:
        dofs = range(4) if observation.dofs is None else observation.dofs
        assert list(dofs) == known
        assert observation.values.tolist() == [numbers[k] for k in known]


def test_a_pose_is_measured_as_a_whole_and_other_messages_are_errors():
    spoiled = hand(position=(NAN, 2.0, 3.0), speed=NAN)
    assert ObservationReader(HAND, 0).observe(1, spoiled).dofs is None
    both = replace(
        SPEED, fields=("twist.twist.linear.x", "twist.twist.linear.y"), of=HAND.names[::-1]
    )
    found = ObservationReader(both, 0, (1, 0)).observe(1, spoiled)
    assert found.dofs == (0,) and found.values.tolist() == [0.0]
    np.testing.assert_array_equal(found.covariance, FULL[1:2, 1:2])
    for entry, message in ((HAND, glove(1.0, 2.0)), (GLOVE, hand()), (WRIST, hand())):
        with pytest.raises(MessageError):
            ObservationReader(entry, 0).observe(1, message)


def test_velocities_survive_the_file_and_are_of_one_entry():
    assert DofSpec.from_dict(DOFS.to_dict()) == DOFS
    assert "velocities" not in make_dofs().to_dict()
    assert DOFS.topics == replace(DOFS, velocities=()).topics
    content = DOFS.to_dict()
    two = {"fields": ["twist.linear.x", "twist.linear.y"], "of": ["thumb", HAND.names[0]]}
    content["velocities"] = [content["velocities"][0] | two]
    with pytest.raises(DofError, match="one observed entry"):
        DofSpec.from_dict(content)


@pytest.mark.parametrize("prefix", ["", "cell/"])
def test_what_is_differentiated_from_the_poses_is_no_measurement(prefix):
    wrist = replace(WRIST, topic=prefix + WRIST.topic)
    rate = replace(SPEED, topic=f"{prefix}human/wrist", of=wrist.names[:1])
    with pytest.raises(DofError, match="differentiated from the same poses"):
        DofSpec.from_dict(replace(make_dofs(wrist), velocities=(rate,)).to_dict())
    elsewhere = replace(make_dofs(wrist), velocities=(replace(rate, topic="human/wrist/fast"),))
    assert DofSpec.from_dict(elsewhere.to_dict()) == elsewhere
