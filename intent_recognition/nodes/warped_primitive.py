# SPDX-License-Identifier: Apache-2.0
"""Node: plans a learned pour, conditioned on the seen containers and where they stand.

The containers and the arm come from `cup/parameters`, `cup/pose`, `second/parameters`,
`second/pose` and `joint_states`. A request on `pour` ("empty", "full" or millilitres) yields
`intent/tasks` and `intent/robot_trajectory`, which `primitive_activation` executes like any task.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.array_types import Floats
from intent_recognition.errors import IntentError, MessageError, one_line
from intent_recognition.kinematics import JOINT_NAMES, follow_poses, forward_kinematics, jacobian
from intent_recognition.model import ARRIVED, load_pouring_skill
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    TrajectoryBuilder,
    joint_values,
    of_other_joints,
    to_joint_state,
)
from intent_recognition.nodes.diagnostics import Diagnostics, RejectionError, values_of
from intent_recognition.nodes.object_messages import seen_container
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.runtime import now_ns, run, when_clock_goes_back
from intent_recognition.promp import NONE
from intent_recognition.share import share_path
from intent_recognition.warping import PourPlan, SeenContainer, plan_pour

OBJECTS = ("cup", "second")
REQUEST = "pour"
REFUSED = "refused"
"""Key of the diagnostics: why the last requested pour was refused; empty if it was not."""


class WarpedPrimitiveNode(Node):
    """Passes seen containers to `warping.plan_pour`, and turns its plan into joints of the LWR."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("warped_primitive", **kwargs)
        values = declare(self, "warped_primitive")
        self._task, self._fluid, skill = values["task"], values["fluid"], values["skill"]
        self._skill = load_pouring_skill(skill if Path(skill).is_file() else share_path(skill))
        self._diagnostics = Diagnostics(self)
        self._vectors: dict[str, JointState] = {}
        self._poses: dict[str, PoseStamped] = {}
        self._joints: Floats | None = None
        self._end_ns, self._left = 0, self._fluid
        self._builder = TrajectoryBuilder(JOINT_NAMES)
        listen, hear = self.create_subscription, self._diagnostics.subscribe
        for name in OBJECTS:
            take_vector, take_pose = (
                partial(self._keep, table, name) for table in (self._vectors, self._poses)
            )
            listen(JointState, f"{name}/parameters", take_vector, 10)
            listen(PoseStamped, f"{name}/pose", take_pose, 10)
        hear(JointState, "joint_states", self._on_joint_states, qos.MEASURED)
        hear(String, REQUEST, self._on_request, qos.STATE)
        listen(DiagnosticStatus, "intent/feedback", self._on_feedback, qos.FEEDBACK)
        when_clock_goes_back(self, self._forget)
        self._tasks = self.create_publisher(JointState, "intent/tasks", qos.STATE)
        self._trajectory = self.create_publisher(
            JointTrajectory, "intent/robot_trajectory", qos.COMMAND
        )
        self.create_timer(0.04, self._on_timer)  # as often as the estimator

    def _keep(self, table: dict, name: str, message: Any) -> None:
        table[name] = message
        self._diagnostics.tick(name)

    def _on_joint_states(self, message: JointState) -> None:
        if of_other_joints(message, JOINT_NAMES):
            return
        with self._diagnostics.rejecting("joint_states_incomplete"):
            joints = joint_values(message, JOINT_NAMES)
            if not np.isfinite(joints).all():
                raise RejectionError("not_finite", "joint_states hold NaN or infinity")
            self._joints = joints

    def _on_feedback(self, message: DiagnosticStatus) -> None:
        """Take the outcome of a pour; executions of other tasks are ignored."""
        said = values_of(message)
        if message.name == self._task and "outcome" in said and self._end_ns:
            self._end_ns = 0
            if said["outcome"] == ARRIVED:
                self._fluid = self._left
            else:
                self._diagnostics.reject("not_poured", f"the pour was {said['outcome']}")

    def _forget(self) -> None:
        self._end_ns = 0

    def _on_request(self, message: String) -> None:
        try:
            if self._end_ns:
                raise MessageError.about(REQUEST, "no pour under way", "one", "Wait for it.")
            plan, joints = self._plan(message.data)
        except IntentError as error:
            self._diagnostics.reject("bad_request", one_line(error))
            self._diagnostics.value(REFUSED, one_line(error))
            return
        self._diagnostics.value(REFUSED, "")
        onset_ns = now_ns(self) + 500_000_000  # more than a decision takes
        # 1 s more, since an arm may be slower
        self._end_ns = onset_ns + round(float(plan.times_s[-1]) * 1e9) + 1_000_000_000
        self._left = plan.left
        numbers = plan.times_s, joints, None, joint_std(plan, joints)
        trajectory = self._builder.build(onset_ns, *numbers, frame_id=self._task)
        self._on_timer()  # the task before its trajectory
        self._trajectory.publish(trajectory)
        self._diagnostics.tick("intent/robot_trajectory")
        self.get_logger().info(f"pour {message.data}: {100.0 * plan.left:.0f} % are to be left")

    def _plan(self, asked: str) -> tuple[PourPlan, Floats]:
        cup, second = map(self._seen, OBJECTS)
        if self._joints is None:
            raise MessageError.about("joint_states", "those of the arm", "none", "Start it.")
        hand = forward_kinematics(self._joints)
        plan = plan_pour(self._skill, cup, second, hand, asked, self._fluid)
        return plan, follow_poses(plan.hand_poses, self._joints)

    def _seen(self, name: str) -> SeenContainer:
        if name not in self._vectors or name not in self._poses:
            cure = "Start its object_warper, and let it be seen."
            raise MessageError.about(f"{name}/parameters", "a seen container", "none", cure)
        return seen_container(self._vectors[name], self._poses[name])

    def _on_timer(self) -> None:
        now = now_ns(self)
        if now <= 0:
            return
        if 0 < self._end_ns < now - 3_000_000_000:  # more than an arm holds still
            self._end_ns = 0
            self._diagnostics.reject("not_poured", "no outcome came from the arm")
        pours = float(self._end_ns > now)
        message = to_joint_state((self._task, NONE), (pours, 1.0 - pours), (0.0, 0.0), time_ns=now)
        self._tasks.publish(message)
        self._diagnostics.tick("intent/tasks")
        self._diagnostics.value("in the cup, share of its volume", f"{self._fluid:.2f}")


def joint_std(plan: PourPlan, joints: Floats) -> Floats:
    """Standard deviations (T, 7) [rad] of joints (T, 7), by least squares from the hand's."""
    moved = np.linalg.pinv(jacobian(joints)) @ plan.hand_std
    return np.linalg.norm(moved, axis=2)


main = partial(run, WarpedPrimitiveNode)
