# SPDX-License-Identifier: Apache-2.0
"""What stands and is carried about the arm's node: the plate of the transfers, and pours."""

from types import SimpleNamespace

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from experiments.teaching.path import plan_teaching
from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.nodes.qos import COMMAND, FEEDBACK, LATCHED, STATE
from sim_bridge.coworker.styles import PLATE, STYLES
from sim_bridge.nodes.lwr_sim import LwrSim
from sim_bridge.nodes.pouring_scene import PouringScene
from sim_bridge.scenarios.pouring.live import LiveCounts


def fetch_and_carry() -> JointTrajectory:
    path = plan_teaching(
        np.random.default_rng(0), PLATE, STYLES[PLATE].goal_centre_m, 0.0, 3.0, 3.2
    )
    spline = path.joint_spline()
    message = JointTrajectory(joint_names=list(JOINT_NAMES))
    for time_s in np.arange(0.1, 3.21, 0.1):
        last = time_s > 3.15
        message.points.append(
            JointTrajectoryPoint(
                positions=spline(time_s).tolist(),
                velocities=[0.0] * 7 if last else spline(time_s, 1).tolist(),
                time_from_start=Duration(sec=int(time_s), nanosec=int((time_s % 1.0) * 1e9)),
            )
        )
    return message


@pytest.mark.slow
def test_a_plate_is_taken_from_its_stand(harness):
    node = harness.node(LwrSim, real_time_factor=5.0, scene="transfers")
    tasks = harness.publisher(String, "intent/active_task", LATCHED)
    commands = harness.publisher(JointTrajectory, "joint_trajectory", COMMAND)
    holding = harness.collect(Bool, "intent/holding", STATE)
    harness.connect(tasks, commands, node.scene._holding)
    tasks.publish(String(data=PLATE))
    harness.spin_until(lambda: node.scene._world.task == PLATE, what="the task")
    assert not holding
    commands.publish(fetch_and_carry())
    harness.spin_until(lambda: holding, what="the plate between the fingers")
    assert holding[0].data


BAD = [
    ("", [0.2, 4.0, 20.0], "bad_transfer"),
    ("carrying", [0.2, 4.0], "bad_transfer"),
    ("carrying", [0.2, np.nan, 20.0], "not_finite"),
]


@pytest.mark.parametrize(("holding", "values", "reason"), BAD)
def test_a_transfer_that_cannot_be_followed_is_rejected(harness, holding, values, reason):
    node = harness.node(LwrSim, scene="transfers")
    message = JointState(name=["load_share", "weight", "grip_force"], position=values)
    message.header.frame_id = holding
    node.scene._on_transfer(message)
    assert node.diagnostics.rejected(reason) == 1


@pytest.mark.slow
def test_the_persons_hand_is_told_whenever_its_first_pose_came(harness):
    node = harness.node(LwrSim, real_time_factor=5.0, scene="transfers")
    hands = harness.collect(JointState, "coworker/hand", STATE)
    harness.connect(node.scene._hand)
    while node.arm.n_steps % 5 != 3:
        node.arm.step()
    node.scene._on_pose("", PoseStamped())
    harness.spin_until(lambda: hands, what="the force of the hand")
    assert list(hands[0].name) == ["force_x", "force_y", "force_z"]


def test_an_execution_spilled_what_lies_beside_since_it_began(harness, monkeypatch):
    balls = SimpleNamespace(spilled=1)
    world = SimpleNamespace(look=lambda: LiveCounts(39 - balls.spilled, 1, balls.spilled, 0))
    monkeypatch.setattr("sim_bridge.scenarios.pouring.LivePouring", lambda *_: world)
    told = harness.collect(DiagnosticStatus, "intent/feedback", FEEDBACK)
    scene = PouringScene(harness.probe).begin(None, 0, Time)
    harness.spin_until(lambda: scene._feedback.get_subscription_count() > 0, what="a listener")
    for task, now in (("", 1), ("pouring", 1), ("pouring", 3), ("", 4), ("", 5), ("pouring", 5)):
        balls.spilled = now
        scene.set_task(task)
    scene.set_task("")
    harness.spin_until(lambda: len(told) == 2, what="two executions")
    values = [(one.name, one.values[0].key, one.values[0].value) for one in told]
    assert values == [("pouring", "spilled", "3"), ("pouring", "spilled", "0")]
