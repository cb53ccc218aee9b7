# SPDX-License-Identifier: Apache-2.0
"""A recorded pour, played back, is the pour that was recorded."""

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from experiments.recording import JOINT_TOPIC
from intent_recognition.bags.reader import BagReader
from intent_recognition.nodes.bag_player import BagPlayer
from intent_recognition.nodes.qos import SENSOR
from intent_recognition.share import share_path
from sim_bridge.scenarios.pouring.novel import pour_of, read_pour

KEPT = 2000
"""More than a pour has samples: none may be lost."""


def stamp_ns(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


@pytest.mark.parametrize("name", ["mug_tumbler_mean", "espresso_cup_espresso_cup_unwarped"])
def test_a_pour_played_back_is_the_recorded_one(harness, name):
    bag = share_path(f"bags/pouring/executed/{name}")
    recorded = [m.message for m in BagReader(bag).messages([JOINT_TOPIC])]
    seen = harness.collect(JointState, "joint_states", KEPT)
    ticks = harness.collect(Clock, "/clock", SENSOR)
    watch = harness.add(Node("watch", parameter_overrides=[Parameter("use_sim_time", value=True)]))
    values = {"bag": str(bag), "clock": True, "rate": 20.0}
    player = harness.node(BagPlayer, **values)
    harness.spin_until(lambda: player.done and len(seen) == len(recorded))
    for replayed, original in zip(seen, recorded, strict=True):
        assert stamp_ns(replayed) == stamp_ns(original)
        assert replayed.name == original.name
        for field in ("position", "velocity", "effort"):
            np.testing.assert_array_equal(getattr(replayed, field), getattr(original, field))
    stamps = np.array([stamp_ns(message) for message in seen])
    joints = np.array([message.position for message in seen])
    path, labels = read_pour(bag)
    again = pour_of((stamps - stamps[0]) * 1e-9, joints, labels)
    np.testing.assert_array_equal(again.offset_m, path.offset_m)
    np.testing.assert_array_equal(again.tilt_rad, path.tilt_rad)
    times = [tick.clock.sec * 10**9 + tick.clock.nanosec for tick in ticks]
    assert times == sorted(times)
    assert stamps[0] <= times[0] and times[-1] <= stamps[-1] + 10**8
    harness.spin_until(lambda: watch.get_clock().now().nanoseconds >= times[-1])
