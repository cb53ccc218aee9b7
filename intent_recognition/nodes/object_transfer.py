# SPDX-License-Identifier: Apache-2.0
"""Node: estimates from the force at the hand who carries an object, and controls grip and release.

The force comes from `joint_states` and the arm's model, or from `wrench` if there is a sensor. The
gripper follows `grip_force` on `intent/transfer`, and publishes on `intent/holding` what it grasped
or let go by itself.
"""

from collections import deque
from functools import partial
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus, GoalStatusArray
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import Arm, read_ranges
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    duration_s,
    joint_values,
    measured_values,
    of_other_joints,
    position_array,
    stamp_ns,
)
from intent_recognition.nodes.diagnostics import Diagnostics, RejectionError
from intent_recognition.nodes.hand_input import HandInput, no_description
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.people import meet
from intent_recognition.nodes.runtime import now_ns, run, when_clock_goes_back
from intent_recognition.transfer import (
    Holding,
    LoadEstimator,
    Request,
    Situation,
    TransferMachine,
    TransferOutput,
    away_from_base,
)

TRANSFER, HOLDING, WRENCH = "intent/transfer", "intent/holding", "wrench"
NAMES = ("load_share", "load", "weight", "grip_force", "slip")
"""Names of the values on `intent/transfer`: the person's share of the load, the load and the weight
[N], the force of each finger [N] (0: open), and 1 while the object slips."""
HOLDS = Holding.CARRYING, Holding.OFFERING, Holding.RELEASING, Holding.RETURNING
"""States in which an object is between the fingers."""
UNDER_WAY = GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_CANCELING
"""States of a controller's goal in which the arm may move."""
FRESH_S = 0.3
"""Age up to which a tracked hand, wrench or state is used [s]: a few samples of slow sensors."""


class ObjectTransfer(Node):
    """Passes joint states to `transfer.TransferMachine` and publishes its output."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("object_transfer", **kwargs)
        values = declare(self, "object_transfer")
        self._near_m, self._attended = values["near"], ""
        self._takes: list[str] = values["takes"]
        self._fingers: list[str] = values["fingers"]
        self._diagnostics = Diagnostics(self)
        self._hand = HandInput(self, self._diagnostics)
        self._machine = TransferMachine(values["patience"])
        self._estimator: LoadEstimator | None = None
        self._open_m = np.inf
        self._task, self._until_ns, self._executes = "", 0, False
        self._people: dict[str, deque[tuple[int, Floats, float]]] = {}
        self._wrench: tuple[int, str, Floats] | None = None
        self._out = self.create_publisher(JointState, TRANSFER, qos.STATE)
        hear = self._diagnostics.subscribe
        hear(String, "intent/active_task", self._on_task, qos.LATCHED)
        hear(Bool, HOLDING, self._on_holding, qos.STATE)
        hear(JointTrajectory, "joint_trajectory", self._on_trajectory, qos.COMMAND)
        topic = f"{values['command_action']}/_action/status"
        self._goals = self.resolve_topic_name(topic)
        if values["command_action"]:
            hear(GoalStatusArray, topic, self._on_goals, qos.LATCHED)
        if meet(self, f"human/{{}}/{values['body']}", partial(self._meet, values["body"])):
            hear(String, "intent/active_person", self._on_attended, qos.LATCHED)
        else:
            self._meet(values["body"], "")
        hear(WrenchStamped, WRENCH, self._on_wrench, qos.SENSOR)
        hear(JointState, "joint_states", self._on_joints, qos.MEASURED)
        when_clock_goes_back(self, self._start_over)

    def _start_over(self) -> None:
        self._until_ns, self._executes, self._wrench = 0, False, None
        for seen in self._people.values():
            seen.clear()

    def _on_joints(self, message: JointState) -> None:
        with self._diagnostics.rejecting("bad_joint_states"):
            self._step(message)

    def _step(self, message: JointState) -> None:
        """Let the machine act on a measured state of the arm."""
        arm = self._hand.arm
        if arm is None:
            raise RejectionError("no_robot_description", no_description("joint_states"))
        if of_other_joints(message, arm.joint_names):
            self._diagnostics.tick("joint_states of other joints")
            return
        if self._estimator is None or self._estimator.arm is not arm:
            self._estimator = LoadEstimator(arm)
            ranges = read_ranges(self._hand.description).joints
            ends = [ranges.get(finger, (0.0, np.inf))[1] for finger in self._fingers]
            self._open_m = float(np.mean(ends)) if ends else np.inf
        situation = self._situation(message, arm, self._estimator)
        output = self._machine.step(self._request(), situation)
        load_n = float(np.linalg.norm(situation.force_n))
        self._out.publish(to_message(message, output, load_n))
        self._diagnostics.tick(TRANSFER)
        self._diagnostics.value("state", output.holding.value)

    def _situation(self, message: JointState, arm: Arm, estimator: LoadEstimator) -> Situation:
        """Measured state of hand and person; an error if the message lacks a needed value."""
        at_ns, names = stamp_ns(message), arm.joint_names
        q, velocity = (joint_values(message, names, key) for key in ("position", "velocity"))
        effort = measured_values(message, names, "effort")
        half = joint_values(message, [name for name in self._fingers if name in message.name])
        torque = np.zeros(len(q)) if effort is None else effort
        if not np.all(np.isfinite([q, velocity, torque])):
            raise RejectionError("not_finite", "joint_states hold NaN or infinity")
        pose = arm.forward_kinematics(q)
        force = estimator.update(at_ns * 1e-9, q, velocity, torque)
        measured = self._measured(at_ns, arm, pose)
        if measured is None and effort is None:
            raise RejectionError("no_effort", "neither efforts in joint_states nor a wrench")
        near, toward, speed = self._look(at_ns, pose[:3, 3])
        return Situation(
            at_ns * 1e-9,
            force if measured is None else measured,
            self._controller_executes() or at_ns < self._until_ns,
            estimator.speed_m_s,
            float(np.mean(half)) if half.size else np.nan,
            near,
            speed,
            toward,
            estimator.rise_m_s2,
            estimator.doubt_n if measured is None else 0.0,
            self._open_m,
        )

    def _request(self) -> Request:
        """Request of the active task; `NOTHING` between tasks, so that a held object is kept."""
        if self._task in self._takes and self._machine.holding is not Holding.CARRYING:
            return Request.TAKE
        return Request.GIVE if self._task and self._task not in self._takes else Request.NOTHING

    def _measured(self, at_ns: int, arm: Arm, pose: Floats) -> Floats | None:
        """The force of a fresh wrench in the axes of the base (3,); None without one."""
        if self._wrench is None or abs(at_ns - self._wrench[0]) > FRESH_S * 1e9:
            return None
        _, frame, force = self._wrench
        if frame in ("", arm.base):
            return force
        if frame == arm.tip:
            return pose[:3, :3] @ force
        self._diagnostics.reject("unknown_frame", f"{WRENCH} in {frame!r}, not {arm.tip}")
        return None

    def _look(self, at_ns: int, hand_m: Floats) -> tuple[bool | None, Floats | None, float]:
        """Whether the helped person's hand is near, its direction from the base, and its speed."""
        person = self._people.get(self._attended, ())
        seen = next((seen for seen in reversed(person) if seen[0] < at_ns), None)
        if seen is None or at_ns - seen[0] > FRESH_S * 1e9:
            return None, None, 0.0
        _, at_m, speed = seen
        near = bool(np.linalg.norm(at_m - hand_m) < self._near_m)
        return near, away_from_base(at_m), speed

    def _on_task(self, message: String) -> None:
        self._task = message.data

    def _on_holding(self, message: Bool) -> None:  # what the gripper took, or let go, by itself
        holding = self._machine.holding  # messages may repeat, and come while fingers close
        if message.data and holding in (Holding.EMPTY, Holding.RECEIVING):
            self._machine.carry()
        elif holding in HOLDS and not message.data:
            self._machine.drop()

    def _on_trajectory(self, message: JointTrajectory) -> None:
        begin_ns = stamp_ns(message) or now_ns(self)
        end_s = duration_s(message.points[-1].time_from_start) if message.points else 0.0
        self._until_ns = begin_ns + round(end_s * 1e9)

    def _on_goals(self, message: GoalStatusArray) -> None:
        self._executes = any(goal.status in UNDER_WAY for goal in message.status_list)

    def _controller_executes(self) -> bool:
        """Whether a goal is under way; a goal whose controller died does not count."""
        self._executes = self._executes and self.count_publishers(self._goals) > 0
        return self._executes

    def _on_attended(self, message: String) -> None:
        self._attended = message.data or self._attended

    def _meet(self, body: str, person: str) -> None:
        topic = f"human/{person}/{body}" if person else f"human/{body}"
        self._people[person] = deque(maxlen=300)  # `FRESH_S` at 1 kHz
        take = partial(self._on_person, person)
        self._diagnostics.subscribe(Odometry, topic, take, qos.SENSOR)

    def _on_person(self, person: str, message: Odometry) -> None:
        at_m, v = position_array(message.pose.pose), message.twist.twist.linear
        speed = float(np.linalg.norm([v.x, v.y, v.z]))
        if np.all(np.isfinite(at_m)):
            self._people[person].append(
                (stamp_ns(message), at_m, speed if np.isfinite(speed) else 0.0)
            )

    def _on_wrench(self, message: WrenchStamped) -> None:
        f = message.wrench.force
        force = np.array([f.x, f.y, f.z])
        if not np.all(np.isfinite(force)):
            self._diagnostics.reject("not_finite", f"{WRENCH} holds NaN or infinity")
            return
        self._wrench = stamp_ns(message), message.header.frame_id, force


def to_message(of: JointState, output: TransferOutput, load_n: float) -> JointState:
    """Message for `intent/transfer`: `frame_id` is the state, the stamp is the joint state's."""
    message = JointState(name=list(NAMES))
    message.header.stamp, message.header.frame_id = of.header.stamp, output.holding.value
    values = (output.share, load_n, output.weight_n, output.grip_n, float(output.slip))
    message.position = [float(value) for value in values]
    return message


main = partial(run, ObjectTransfer)
