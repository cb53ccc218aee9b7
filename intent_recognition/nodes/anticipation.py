# SPDX-License-Identifier: Apache-2.0
"""Input and output of the estimator node between movements: start posture in, next task out."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import JointState

from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import (
    JOINTS_TOPIC,
    DofEntry,
    dofs_of,
    extract,
    hand_numbers,
    is_raw_pose,
    stamp_of,
)
from intent_recognition.errors import IntentError
from intent_recognition.motion import is_hand
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    joint_values,
    message_class,
    of_other_joints,
    stamp_ns,
    to_joint_state,
)
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.hand_input import HandInput
from intent_recognition.nodes.observation_input import human_topic
from intent_recognition.nodes.runtime import LeftOvers
from intent_recognition.recognition import (
    POSTURE_OUTSIDE,
    POSTURE_UNKNOWN,
    IntentEstimator,
    Prediction,
    TaskMemory,
)
from intent_recognition.signals import Observation


class PostureInput:
    """Passes the controlled agent's measured positions to the estimators, for its posture at onset.

    Rejected positions are counted under `posture_<reason>`, and start postures that could not be
    used under `start_posture_<why>`, once per movement and task. Without an arm nothing is counted.

    Attributes:
        hand: input of the arm on `robot_description`.
        left_overs: to start over when the clock goes back.
    """

    def __init__(self, node: Node, diagnostics: Diagnostics):
        self._node, self._diagnostics = node, diagnostics
        self.hand = HandInput(node, diagnostics)
        self._subscriptions: list = []
        self.estimators: Sequence[IntentEstimator] = ()
        self._noted: dict[str, tuple] = {}
        self._received = False
        self.left_overs = LeftOvers()

    def open(self, estimators: Sequence[IntentEstimator], entries: Sequence[DofEntry]) -> None:
        """Subscribe to the controlled signals.

        A hand's pose is computed from the joints of the arm. So is the pose of a controlled person
        whose place the arm takes, which a `hand_link` indicates.
        """
        self.estimators = estimators
        self.left_overs.last_ns.clear()
        self.hand.taught = next((entry.link for entry in entries if entry.link), "")
        numbers = [name for entry in entries for name in entry.message_names]
        in_place = bool(self.hand.link) and is_hand(numbers)
        for group, entry in enumerate(entries):
            raw = is_raw_pose(entry.topic, entry.type)
            take, topic = partial(self._take, group, entry, raw), entry.topic
            if entry.link or in_place:
                take, topic = partial(self._take_joints, group, entry), JOINTS_TOPIC
                kind: type = JointState
            elif raw:
                kind, topic = Odometry, human_topic(entry)
            else:
                kind = message_class(entry.type)
            deep = qos.keep_last(100, reliable=False)  # kept while onset filters again
            self._subscriptions.append(self._node.create_subscription(kind, topic, take, deep))

    def close(self) -> None:
        """Unsubscribe."""
        while self._subscriptions:
            self._node.destroy_subscription(self._subscriptions.pop())

    def _take(self, group: int, entry: DofEntry, raw: bool, message: Any) -> None:
        now_ns = self._node.get_clock().now().nanoseconds
        stamp = stamp_of(entry, message, now_ns)
        by_name = entry.joints and "*" not in "".join(entry.joints)
        if stamp is None or (by_name and of_other_joints(message, entry.joints)):
            return
        self._use(
            group, entry.topic, stamp, partial(extract, entry, message.pose if raw else message)
        )

    def _take_joints(self, group: int, entry: DofEntry, message: JointState) -> None:
        """Compute the pose of the arm's hand from its joints, and use it."""
        if (arm := self.hand.arm) is None or of_other_joints(message, arm.joint_names):
            return

        def hand() -> Floats:
            pose = arm.forward_kinematics(joint_values(message, arm.joint_names))
            return dofs_of(entry, hand_numbers(entry, pose))

        self._use(group, JOINTS_TOPIC, stamp_ns(message), hand)

    def _use(self, group: int, topic: str, stamp: int, values_of: Callable[[], Floats]) -> None:
        self._diagnostics.tick(topic)
        self._received = True
        now_ns = self._node.get_clock().now().nanoseconds
        if self.left_overs.include(group, stamp):
            self._diagnostics.count("left_over")
            return
        # one sample from the future would make all later ones seem late
        if 0 < max(now_ns, self.left_overs.last_ns.get(group, 0)) < stamp - 1_000_000_000:
            self._diagnostics.reject("posture_in_future", f"{topic} at {stamp} ns")
            return
        self.left_overs.last_ns[group] = stamp
        try:
            values = values_of()
        except IntentError as error:
            self._diagnostics.reject("posture_missing_dof", str(error))
            return
        observation = Observation(stamp, group, values)
        reasons = [estimator.update_controlled(observation) for estimator in self.estimators]
        if reason := next(filter(None, reasons), None):
            self._diagnostics.reject(f"posture_{reason}", f"{topic} at {stamp} ns")

    def note(self, prediction: Prediction, person: str = "") -> None:
        """Report whether the prediction for a person could use the start posture."""
        key = (prediction.onset_ns, prediction.task, prediction.start)
        if not self._subscriptions or key == self._noted.get(person):
            return
        self._noted[person] = key
        self._diagnostics.value("start posture", prediction.start)
        if prediction.start == POSTURE_OUTSIDE:
            self._diagnostics.count("start_posture_outside")
        elif prediction.start == POSTURE_UNKNOWN and self._received:
            self._diagnostics.count("start_posture_unknown")


class NextTaskOutput:
    """Publishes the probabilities of the next task whenever they change.

    `intent/next_task` is a sensor_msgs/JointState used as a stamped named vector: `name` = task
    labels, `position` = their probabilities for the next movement (sum 1), `header.frame_id` = the
    last task or empty, and the stamp that of the observation which ended the last movement.
    """

    def __init__(self, node: Node, topic: str = "intent/next_task"):
        self._publisher = node.create_publisher(JointState, topic, qos.LATCHED)
        self._known: tuple[TaskMemory, Floats] | None = None
        self._published: JointState | None = None

    def update(self, estimator: IntentEstimator) -> bool:
        """Publish if memory or expectation changed since the last call; returns whether it did."""
        expectation = estimator.expectation
        known, prior = self._known or (None, None)
        if expectation.memory is known and expectation.prior is prior:
            return False
        self._known = expectation.memory, expectation.prior
        message = to_joint_state(
            estimator.library.labels, expectation.prior, time_ns=expectation.memory.ended_ns
        )
        message.header.frame_id = expectation.last_task
        if message == self._published:  # the end of a movement computes it twice
            return False
        self._published = message
        self._publisher.publish(message)
        return True
