# SPDX-License-Identifier: Apache-2.0
"""A graph whose arm has topics of its own: it moves, and the bag holds what it was told."""

import json
import os
from collections import Counter
from contextlib import ExitStack

import numpy as np
import pytest
from joint_trajectories import build_joint_trajectory
from ros_harness import NodeProcess
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.bags import BagReader
from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_joint_state
from intent_recognition.nodes.graph import resolve
from intent_recognition.nodes.processes import node_environment

STARTED = ("lwr_sim", "primitive_activation", "bag_recorder")


def arguments(call):
    """The command line of a node of a graph."""
    values = {name: value for name, value in call.parameters.items() if name != "model"}
    pairs = [("-p", f"{name}:={json.dumps(value)}") for name, value in values.items()]
    pairs += [("-r", f"{was}:={becomes}") for was, becomes in call.remappings]
    return ["--ros-args", *(word for pair in pairs for word in pair)]


@pytest.mark.slow
def test_both_topics_changed_the_arm_moves_and_the_bag_holds_the_commands(harness, tmp_path):
    bag = tmp_path / "session"
    given = {
        "joint_states_topic": "/arm/states",
        "command_topic": "/arm/controller/go",
        "record": str(bag),
        "publish_clock": False,
        "use_sim_time": False,
    }
    calls = [c for c in resolve("demo", given | {"model": "none"}) if c.name in STARTED]
    assert len(calls) == len(STARTED)
    tasks = harness.publisher(JointState, "intent/tasks", qos.STATE)
    predictions = harness.publisher(JointTrajectory, "intent/robot_trajectory", qos.COMMAND)
    states = harness.collect(JointState, "/arm/states", qos.STATE)
    s = np.linspace(0.0, 1.0, 40)
    with ExitStack() as stack:
        nodes = [
            stack.enter_context(
                NodeProcess(c.module, *arguments(c), environment=node_environment(os.environ))
            )
            for c in calls
        ]
        harness.connect(tasks, predictions, subscribers=2)  # the activation and the recorder
        harness.spin_until(lambda: states, what="joint states")
        home = np.array(states[0].position)
        way = np.outer(s**3 * (10.0 - 15.0 * s + 6.0 * s**2), np.full(7, 0.3))
        onset_ns = harness.probe.get_clock().now().nanoseconds

        def estimate():
            now_ns = harness.probe.get_clock().now().nanoseconds
            message = build_joint_trajectory(
                JOINT_NAMES, 2.0 * s, home + way, None, np.full((40, 7), 0.05), time_ns=onset_ns
            )
            message.header.frame_id = "plate"
            predictions.publish(message)
            tasks.publish(to_joint_state(("plate", "none"), [0.97, 0.03], time_ns=now_ns))

        timer = harness.probe.create_timer(0.02, estimate)
        harness.spin_until(
            lambda: np.abs(np.array(states[-1].position) - home).max() > 0.1, what="the arm to move"
        )
        timer.cancel()
        for node in nodes:
            assert node.stop() == 0, node.errors
    counts = Counter(message.topic for message in BagReader(bag).messages())
    assert counts["/joint_trajectory"] > 0 and counts["/joint_states"] > 0
    assert not [topic for topic in counts if topic.startswith("/arm")]
