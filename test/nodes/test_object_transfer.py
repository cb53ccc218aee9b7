# SPDX-License-Identifier: Apache-2.0
"""The node object_transfer on its topics: joint states in, grip and state out."""

from functools import partial
from unittest.mock import Mock

import numpy as np
import pytest
from action_msgs.msg import GoalStatus, GoalStatusArray
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from intent_recognition.demonstrations import arm_in_world
from intent_recognition.nodes import qos
from intent_recognition.nodes.activation_inputs import TransferInput
from intent_recognition.nodes.conversions import stamp_ns, to_stamp
from intent_recognition.nodes.object_transfer import NAMES, ObjectTransfer
from intent_recognition.transfer import Holding
from sim_bridge.arm import find_robot

STEP_NS, WEIGHT_N = 10_000_000, 6.0
HANGS = np.array([0.0, 0.0, -WEIGHT_N])
ROBOT = find_robot("lwr")


class Cell:
    """The node with an arm at rest, on which forces act."""

    def __init__(self, harness, *words, **parameters):
        self.node = harness.node(partial(ObjectTransfer, cli_args=words), **parameters)
        self.hear = partial(harness.hear, self.node)
        self.out = harness.said(self.node, "intent/transfer")
        self.arm = arm_in_world(ROBOT.description, "")
        zero = np.zeros(7)
        self.held = self.arm.inverse_dynamics(ROBOT.ready, zero, zero)
        self.J = self.arm.jacobian(ROBOT.ready)
        self.now_ns = 1_700_000_000_000_000_000
        self.hear("robot_description", String(data=ROBOT.description))

    def feel(self, force, effort=True):
        """One joint state; returns what the node answers."""
        self.now_ns += STEP_NS
        message = JointState(name=list(ROBOT.joint_names))
        message.header.stamp = to_stamp(self.now_ns)
        message.position, message.velocity = ROBOT.ready.tolist(), [0.0] * 7
        if effort:
            message.effort = (self.held - self.J[:3].T @ np.asarray(force)).tolist()
        self.hear("joint_states", message)
        assert stamp_ns(self.out[-1]) == self.now_ns
        return dict(zip(self.out[-1].name, self.out[-1].position, strict=True))

    def measure(self, force):
        """A wrench with the stamp of the next joint state."""
        message = WrenchStamped()
        message.header.stamp = to_stamp(self.now_ns + STEP_NS)
        message.wrench.force.z = float(force[2])
        self.hear("wrench", message)

    def state(self):
        return self.out[-1].header.frame_id

    def begin(self):
        """Under way for 0.4 s with an object, which is to be given."""
        self.hear("intent/holding", Bool(data=True))
        way = JointTrajectory(points=[JointTrajectoryPoint()])
        way.header.stamp = to_stamp(self.now_ns)
        way.points[0].time_from_start.nanosec = 400_000_000
        self.hear("joint_trajectory", way)
        self.hear("intent/active_task", String(data="plate"))

    def hold(self, n):
        for _ in range(n):
            self.feel(HANGS)
        return self.state()

    def offer(self):
        self.begin()
        assert self.hold(39) == "carrying"  # under way
        assert self.hold(15) == "offering"


@pytest.mark.parametrize("by", ["efforts", "wrench"])
def test_an_offer_is_released_to_who_takes_over_the_load(harness, by):
    cell = Cell(harness)
    cell.offer()
    told = [cell.feel(HANGS)]
    assert told[0]["weight"] == pytest.approx(WEIGHT_N, abs=0.1)
    for k in range(60):
        force = HANGS * (1.0 - min(k / 30, 1.0))
        if by == "wrench":
            cell.measure(force)
        told.append(cell.feel(force, effort=by == "efforts"))
        if cell.state() == "releasing":
            break
    assert cell.state() == "releasing"
    assert told[-1]["grip_force"] == 0.0
    assert told[-2]["load_share"] > 0.7
    assert told[-2]["grip_force"] < 0.5 * told[0]["grip_force"]


@pytest.mark.parametrize("topic", ["goals/_action/status", "remapped"])
def test_nothing_is_offered_while_a_goal_of_the_controller_is_under_way(harness, topic):
    words = "--ros-args", "-r", f"goals/_action/status:={topic}"
    cell = Cell(harness, *words, command_action="goals")
    harness.publisher(GoalStatusArray, topic, qos.LATCHED)  # a controller that lives
    harness.spin_until(lambda: cell.node.count_publishers(topic), what="the controller")
    under_way = GoalStatus(status=GoalStatus.STATUS_EXECUTING)
    replaced = GoalStatus(status=GoalStatus.STATUS_ABORTED)
    cell.hear(topic, GoalStatusArray(status_list=[replaced, under_way]))
    cell.begin()
    assert cell.hold(60) == "carrying"
    under_way.status = GoalStatus.STATUS_SUCCEEDED
    cell.hear(topic, GoalStatusArray(status_list=[replaced, under_way]))
    assert cell.hold(15) == "offering"


def test_a_goal_that_died_with_its_controller_is_not_under_way(harness):
    cell = Cell(harness, command_action="controller/follow_joint_trajectory")
    status = GoalStatus(status=GoalStatus.STATUS_EXECUTING)
    cell.node._on_goals(GoalStatusArray(status_list=[status]))
    cell.begin()
    assert cell.hold(60) == "offering"


def test_when_the_clock_goes_back_nothing_of_before_counts(harness):
    cell = Cell(harness, use_sim_time=True)
    harness.set_clock(cell.node, cell.now_ns)
    cell.begin()
    cell.measure([0.0, 0.0, -3.0])
    hand = Odometry()
    hand.header.stamp = to_stamp(cell.now_ns)
    cell.hear("human/wrist", hand)
    cell.now_ns -= 5_000_000_000
    harness.set_clock(cell.node, cell.now_ns)
    assert not cell.node._people[""] and cell.node._wrench is None
    assert cell.hold(15) == "offering"


def test_a_gripper_that_says_again_what_it_holds_or_has_closed_changes_nothing(harness):
    """The person pulls until the load has become steady."""
    node = Cell(harness).node
    for holding in (Holding.OFFERING, Holding.CLOSING, Holding.TAKING):
        node._machine.holding, node._machine.weight_n = holding, WEIGHT_N
        for holds in (True, False):
            node._on_holding(Bool(data=holds))
            dropped = holding is Holding.OFFERING and not holds
            assert node._machine.holding is (Holding.EMPTY if dropped else holding)
            assert dropped or node._machine.weight_n == WEIGHT_N


@pytest.mark.parametrize("ahead", [(0,), (22, 26, 30)])  # of the joint states [ms]
def test_nothing_is_released_while_the_tracked_hand_is_elsewhere(harness, ahead):
    cell = Cell(harness)
    cell.offer()
    hand = Odometry()
    hand.pose.pose.position.x = 3.0
    for _ in range(40):
        for ahead_ms in ahead:
            now = cell.now_ns + STEP_NS + ahead_ms * 1_000_000
            hand.header.stamp = to_stamp(now)
            cell.hear("human/wrist", hand)
        told = cell.feel([0.0, 0.0, 0.0])
    assert cell.state() == "offering"
    assert told["load_share"] == 0.0
    assert told["slip"] == 1.0


def test_messages_without_what_is_needed_are_counted(harness, capfd):
    cell = Cell(harness)
    cell.feel(HANGS)
    counts = cell.node._diagnostics
    names, still = list(ROBOT.joint_names), [0.0] * 7
    cell.hear("joint_states", JointState(name=names, position=still))
    assert "velocity: expected 7 values" in capfd.readouterr().err
    for message in (
        JointState(name=["other", names[0]], position=[0.0] * 2),
        JointState(name=names, position=[np.nan] * 7, velocity=still),
        JointState(name=names, position=still, velocity=still),
        JointState(name=names, position=still, velocity=still, effort=[np.nan] * 7),
    ):
        cell.hear("joint_states", message)
    wrench = WrenchStamped()
    wrench.wrench.force.x = np.inf
    cell.hear("wrench", wrench)
    counts = cell.node._diagnostics._counts
    assert counts == {"bad_joint_states": 2, "not_finite": 2, "no_effort": 2}
    assert tuple(cell.out[-1].name) == NAMES


def test_joint_states_without_a_position_of_the_fingers_are_refused(harness):
    cell = Cell(harness, fingers=["finger"])
    cell.node._on_joints(JointState(name=["finger"], position=[0.01]))  # of its own driver
    assert not cell.node._diagnostics.rejected("bad_joint_states")
    message = JointState(name=[*ROBOT.joint_names, "finger"])
    message.position, message.velocity = ROBOT.ready.tolist(), [0.0] * 7
    cell.hear("joint_states", message)
    assert cell.node._diagnostics.rejected("bad_joint_states") == 1


@pytest.mark.parametrize(("half_m", "holding"), [(0.02, Holding.CARRYING), (0.04, Holding.EMPTY)])
def test_what_weighs_on_fingers_that_stand_fully_open_is_not_between_them(harness, half_m, holding):
    """As for a node that was restarted."""
    panda, fingers = find_robot("panda"), ["panda_finger_joint1", "panda_finger_joint2"]
    node = Cell(harness, fingers=fingers).node
    node._hand._take(String(data=panda.description))
    arm, still = node._hand.arm, np.zeros(7)
    torque = (
        arm.inverse_dynamics(panda.ready, still, still) - arm.jacobian(panda.ready)[:3].T @ HANGS
    )
    message = JointState(name=[*panda.joint_names, *fingers], velocity=[0.0] * 9)
    message.position = [*panda.ready, half_m, half_m]
    message.effort = [*torque, 0.0, 0.0]
    node._on_joints(message)
    assert node._machine.holding is holding


@pytest.mark.parametrize("ahead_ms", [0, 15, 900])
def test_an_exchange_is_known_where_the_clock_of_its_stamps_leads(ahead_ms):
    heard, until_ns = TransferInput(Mock()), []
    for k in range(200):
        now_ns, message = 10_000_000_000 + k * 5_000_000, JointState()
        message.header.stamp = to_stamp(now_ns + ahead_ms * 1_000_000)
        message.header.frame_id = "offering" if k < 100 else "carrying"
        heard._take(message)
        until_ns.append(heard.exchanging_until_ns(now_ns))
    assert until_ns[99] > 10_000_000_000 + 99 * 5_000_000
    assert until_ns[-1] == 0
