# SPDX-License-Identifier: Apache-2.0
"""Moves the wrist and the arm for the page: publishes tracker poses and arm commands."""

import time
from collections.abc import Callable

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.timer import Timer
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.activation import ActivationSettings
from intent_recognition.array_types import Floats
from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.moved_arm import ArmFinder, MovedArm
from intent_recognition.dashboard.synthetic_demonstration import SyntheticDemonstration, arm_motion
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics import POSITION_TOLERANCE_RAD, position_violation
from intent_recognition.motion import JointPlan, JointReference
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import TrajectoryBuilder, to_pose, to_stamp
from intent_recognition.nodes.runtime import CLOCK_BACK_NS, elapsed_s, steady_timer

RATE_HZ = 100.0
"""Rate of the published poses [Hz], as in the shipped recordings."""
SILENT_ARM = "The arm's joint states have stopped."


class Teleoperation:
    """Publishes `mocap/<body>/pose` while it holds the wrist, and `joint_trajectory` when asked.

    If people have names, it holds the first person's wrist.

    Methods that move the arm raise a KinematicsError if there is no arm, its joint states have
    stopped, or the position is out of reach.
    """

    def __init__(self, node: Node, state: CellState, body: str = "wrist", hand_link: str = ""):
        self._node, self._state, self._body = node, state, body
        self._finder = ArmFinder(hand_link)
        self._poses: list[Publisher] = []
        self._arm = node.create_publisher(JointTrajectory, "joint_trajectory", qos.COMMAND)
        self._timer: Timer | None = None
        self._position = np.zeros(3)
        self._velocity = np.zeros(3)
        self._target = np.zeros(3)
        self._playing: SyntheticDemonstration | None = None
        self._began_s = self._length_s = 0.0
        self._arm_goal: Floats | None = None
        self._shown_arm: MovedArm | None = None
        self._done: Callable[[], None] = lambda: None
        self._last_ns = 0
        self._arm_sent_s = -np.inf
        self._hand: Floats | None = None
        self._sent: tuple[JointPlan, float] | None = None

    @property
    def holds_wrist(self) -> bool:
        """Whether this object moves the wrist."""
        return self._timer is not None

    @property
    def position(self) -> Floats:
        """Position of the wrist (3,) [m]."""
        return self._position.copy()

    def others_move_wrist(self) -> bool:
        """Whether another node publishes the wrist's poses."""
        topics = self._state.pose_topics(self._body)
        publishers = sum(map(self._node.count_publishers, topics))
        return publishers > len(self._poses)

    def take_wrist(self, position: Floats) -> None:
        """Start publishing the wrist, at rest at a position (3,) [m], unless it is held already."""
        if self.holds_wrist:
            return
        self._position, self._target = np.array(position, float), np.array(position, float)
        self._velocity = np.zeros(3)
        create, topics = self._node.create_publisher, self._state.pose_topics(self._body)
        self._poses = [create(PoseStamped, topic, qos.SENSOR) for topic in topics]
        self._timer = steady_timer(self._node, 1.0 / RATE_HZ, self._step)

    def release_wrist(self) -> None:
        """Stop publishing the wrist."""
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            for publisher in self._poses:
                self._node.destroy_publisher(publisher)
            self._timer, self._poses, self._playing = None, [], None

    def drag_wrist(self, target: Floats) -> None:
        """Move the wrist smoothly to a target (3,) [m]."""
        self._target = np.array(target, dtype=float)

    def can_move_arm(self) -> bool:
        """Whether there is an arm with inverse kinematics that listens to commands."""
        return self._find() is not None and self._arm.get_subscription_count() > 0

    @property
    def arm_problem(self) -> str:
        """Why the present arm cannot be moved; empty if it can."""
        arm = self._finder.find(self._state)
        return self._finder.problem or ("" if arm is None or self._speaks(arm) else SILENT_ARM)

    def drag_hand(self, position: Floats) -> None:
        """Move the arm's hand to a position (3,) [m] at the next step."""
        self._found()
        self._hand = np.array(position, dtype=float)
        if self._timer is None:
            self.step_arm()

    def measured(self) -> Floats:
        """The arm's joint angles (n,) [rad]."""
        return np.array([self._state.joints[name] for name in self._found().joint_names])

    def hand(self) -> Floats:
        """Position of the arm's hand (3,) [m]."""
        return self._found().hand(self.measured())

    def posture_at(self, position: Floats) -> Floats:
        """Joint angles (n,) [rad] near the present ones with the hand at a position (3,) [m]."""
        return self._found().posture_at(np.asarray(position, dtype=float), self.measured())

    def send_arm(self, goal: Floats, duration_s: float) -> float:
        """Send the arm to a posture (n,), starting from its present motion or from rest.

        Returns:
            Duration of the motion [s]; longer than `duration_s` if the limits require it.
        """
        arm, moving = self._found(), self._reference()
        rest = JointReference.at_rest(self.measured())
        for start, wanted_s in ((moving, duration_s), (moving, 0.1), (rest, duration_s)):
            plan = arm_motion(start, goal, wanted_s, arm.limits)
            if np.all(position_violation(plan.positions, arm.limits) <= POSITION_TOLERANCE_RAD):
                break  # a slow motion may overshoot the goal, past a limit near it
        motion = plan.times_s, plan.positions, plan.velocities
        self._arm.publish(TrajectoryBuilder(arm.joint_names).build(0, *motion))
        self._sent = plan, elapsed_s(self._node)
        return plan.duration_s

    def _reference(self) -> JointReference:
        """Present reference of the arm's motion; if far from the measured posture, rest at that."""
        measured = self.measured()
        if self._sent is not None:
            plan, sent_s = self._sent
            since_s = elapsed_s(self._node) - sent_s
            asked = plan.at(since_s)
            near = np.shape(plan.end) == np.shape(measured) and (
                np.abs(asked.position - measured).max() < ActivationSettings.max_tracking_error_rad
            )
            if near and 0.0 <= since_s < plan.duration_s:
                return asked
        return JointReference.at_rest(measured)

    def _speaks(self, arm: MovedArm) -> bool:
        """Whether the arm's joint states are recent enough to plan from."""
        return self._state.fresh(self._state.joints_at_s(arm.joint_names), time.monotonic())

    def _find(self) -> MovedArm | None:
        """The arm that can be moved, None if there is none."""
        arm = self._finder.find(self._state)
        return arm if arm is not None and self._speaks(arm) else None

    def _found(self) -> MovedArm:
        arm = self._find()
        if arm is None:
            got, cure = self.arm_problem or "none", "See the tab Teach."
            raise KinematicsError.about("joint_states", "joint states of an arm", got, cure)
        return arm

    def play(
        self,
        demonstration: SyntheticDemonstration,
        arm_goal: Floats | None,
        done: Callable[[], None],
    ) -> None:
        """Show a demonstration; the present arm moves along if there is a goal (n,) [rad]."""
        self._shown_arm = self._find()
        self._playing, self._arm_goal, self._done = demonstration, arm_goal, done
        self._began_s, self._length_s = time.monotonic(), demonstration.length_s

    def step_arm(self) -> None:
        """Send the arm toward the hand's target, if the target has moved."""
        now_s = time.monotonic()
        if self._hand is None or now_s - self._arm_sent_s < 0.15:
            return
        target, self._hand, self._arm_sent_s = self._hand, None, now_s
        try:
            goal = self.posture_at(target)
        except KinematicsError:
            return
        distance = float(np.max(np.abs(goal - self.measured())))
        self.send_arm(goal, max(0.4, distance / 0.9))  # fastest joint at 0.9 rad/s

    def _step(self) -> None:
        if self._playing is not None:
            self._perform(self._playing)
        else:
            self._follow()
        self.step_arm()
        self._publish()

    def _perform(self, show: SyntheticDemonstration) -> None:
        elapsed_s = time.monotonic() - self._began_s
        self._position = show.wrist(elapsed_s)
        if self._arm_goal is not None and elapsed_s >= show.arm_start_s:
            goal, self._arm_goal = self._arm_goal, None
            arm = self._find()
            if arm is not None and arm is self._shown_arm and len(goal) == len(arm.joint_names):
                takes_s = self.send_arm(goal, show.arm_duration_s)
                self._length_s = max(show.length_s, elapsed_s + takes_s + show.rest_s)
        if elapsed_s >= self._length_s:
            self._target, self._velocity = self._position.copy(), np.zeros(3)
            self._playing = None
            self._done()

    def _follow(self) -> None:
        """Track the target with a critically damped spring, solved exactly over one step."""
        step_s, w = 1.0 / RATE_HZ, 12.0  # [rad/s]: smooth, not sluggish
        away = self._position - self._target
        carried = self._velocity + w * away
        decay = np.exp(-w * step_s)
        self._position = self._target + (away + carried * step_s) * decay
        self._velocity = (self._velocity - w * carried * step_s) * decay

    def _publish(self) -> None:
        stamp_ns = self._node.get_clock().now().nanoseconds
        if 0 <= self._last_ns - stamp_ns < CLOCK_BACK_NS:
            return
        self._last_ns = stamp_ns
        message = PoseStamped(pose=to_pose(self._position, np.array([0.0, 0.0, 0.0, 1.0])))
        message.header.stamp = to_stamp(stamp_ns)
        message.header.frame_id = "world"
        for publisher in self._poses:
            publisher.publish(message)
