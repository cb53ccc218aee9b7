# SPDX-License-Identifier: Apache-2.0
"""The whole pose of a link: learned from recorded joints, predicted and moved by the nodes."""

from dataclasses import replace

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.demonstrations import (
    arm_in_world,
    load_dofs,
    read_demonstrations,
    settle_orientations,
)
from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.model.file import Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    to_joint_state,
    to_pose,
    to_stamp,
    trajectory_arrays,
)
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from intent_recognition.share import share_path
from sim_bridge.arm.urdf import lwr_urdf

LINK = "lwr_a6_link"
"""One joint before the hand: the last joint does not move it."""
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def model(repository, tmp_path_factory):
    """Of twelve shipped recordings, which hold wrist and joints."""
    example = load_dofs(share_path("config/examples/link_pose.dofs.yaml"))
    asked = [replace(entry, link=LINK) for entry in example.controlled]
    bags = sorted((repository / "bags/toolbox/train").iterdir())[::4]
    dofs = settle_orientations(replace(example, controlled=tuple(asked)), bags)
    found, rejections = read_demonstrations(bags, dofs)
    assert not rejections
    path = tmp_path_factory.mktemp("pose") / "model.npz"
    save_model(path, Model(learn(found, TrainingSettings(n_basis=10, n_aligned_basis=10)), dofs))
    return path


def odometry(stamp_ns, position):
    message = Odometry(child_frame_id="wrist_world_aligned")
    message.header.stamp, message.header.frame_id = to_stamp(stamp_ns), "world"
    message.pose.pose = to_pose(position, UPRIGHT)
    covariance = np.eye(6)
    covariance[:3, :3] = 4e-6 * np.eye(3)
    message.pose.covariance = covariance.ravel()
    return message


@pytest.mark.slow
def test_a_link_goes_where_and_turns_as_the_nodes_predict(harness, repository, model):
    dofs = load_dofs()
    (shown,), _ = read_demonstrations(repository / "bags/toolbox/test/plate_handover_00", dofs)
    wrist, taught = shown.observed[0], shown.controlled[0].values
    named = {"use_sim_time": True, "model": str(model)}
    values = [Parameter(name, value=value) for name, value in named.items()]
    # Twelve recordings are too few to bound the risk of acting by max_wrong.
    own = {"home": taught[0].tolist(), "threshold": 0.9}
    given = [Parameter(name, value=value) for name, value in own.items()]
    estimator = harness.add(IntentEstimatorNode(parameter_overrides=values))
    activation = harness.add(PrimitiveActivation(parameter_overrides=[*values, *given]))
    clock = harness.publisher(Clock, "/clock", 10)
    states = harness.publisher(JointState, "joint_states", qos.STATE)
    described = harness.publisher(String, "robot_description", qos.LATCHED)
    human = harness.publisher(Odometry, "human/wrist", qos.SENSOR)
    tasks = harness.collect(JointState, "intent/tasks", qos.STATE)
    predictions = harness.collect(JointTrajectory, "intent/robot_trajectory", qos.COMMAND)
    commands = harness.collect(JointTrajectory, "joint_trajectory", qos.COMMAND)
    harness.connect(clock, states, described, subscribers=2)
    harness.connect(
        human, estimator.people[""].output.tasks, estimator.people[""].output.trajectory
    )
    described.publish(String(data=lwr_urdf(world=True)))
    harness.spin_until(lambda: activation._hand.arm is not None and estimator._postures._hand.arm)
    heard = activation.diagnostics._totals
    for k, (stamp, position) in enumerate(zip(wrist.stamps_ns, wrist.values, strict=True)):
        clock.publish(Clock(clock=to_stamp(stamp)))
        state = to_joint_state(JOINT_NAMES, taught[0], np.zeros(7), time_ns=int(stamp))
        states.publish(state)
        harness.spin_until(lambda n=k: heard["joint_states"] > n, what="joint states")
        human.publish(odometry(int(stamp), position))
        harness.spin_until(lambda n=k: len(tasks) > n and heard["intent/tasks"] > n, what="tasks")
        if commands:
            break
    arm = arm_in_world(lwr_urdf(world=True), LINK)
    _, q, _ = trajectory_arrays(commands[0])
    reached = arm.forward_kinematics(q[-1])
    np.testing.assert_allclose(q[:, 6], taught[0, 6], atol=1e-6)
    ends = np.array([message.points[-1].positions for message in predictions])
    turned = Rotation.from_matrix(reached[:3, :3]).inv() * Rotation.from_quat(ends[:, 3:])
    off = np.linalg.norm(ends[:, :3] - reached[:3, 3], axis=1) + turned.magnitude()
    assert off.min() < 2e-3
