# SPDX-License-Identifier: Apache-2.0
"""Node: subscribes to the topics of a session and logs them; simulated time waits for it."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from intent_recognition.array_types import Floats, Integers
from intent_recognition.evaluation import ContactLog, SessionLog, TransferLog
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import position_array, stamp_ns
from intent_recognition.nodes.diagnostics import answer_of
from intent_recognition.nodes.runtime import now_ns
from intent_recognition.promp import NONE
from intent_recognition.registry import ANSWERS


class _Seen:
    """Messages on the topics of one person."""

    def __init__(self) -> None:
        self.labels: tuple[str, ...] = (NONE,)
        self.wrist: list[tuple[int, Floats]] = []
        self.tasks: list[tuple[int, Floats]] = []

    def take_wrist(self, message: PoseStamped) -> None:
        self.wrist.append((stamp_ns(message), position_array(message.pose)))

    def take_tasks(self, message: JointState) -> None:
        if len(message.position) != len(message.name):
            return
        if not self.tasks:
            self.labels = tuple(message.name)
        row = np.array(message.position)
        if tuple(message.name) != self.labels:  # a task was taught, or taken back
            by_label = dict(zip(message.name, message.position, strict=True))
            row = np.array([by_label.get(label, 0.0) for label in self.labels])
        self.tasks.append((stamp_ns(message), row))


class SessionObserver(Node):
    """Collects the topics of a toolbox session, for `log`.

    `on_task` is called with the ground truth label, or "" at the end of a movement, and the person;
    `on_active` with the active task whenever it changes. Without `people` there is one, unnamed.
    """

    def __init__(
        self,
        on_task: Callable[[str, str], None],
        on_active: Callable[[str], None],
        people: Sequence[str] = (),
        **kwargs: Any,
    ) -> None:
        super().__init__("session_observer", **kwargs)
        self._on_active = on_active
        self._people = {person: _Seen() for person in people or ("",)}
        self._active: list[tuple[int, str]] = []
        self._helped: list[tuple[int, str]] = []
        self._joints: list[tuple[int, Floats]] = []
        self._contacts: list[tuple[int, str, Floats]] = []
        self._transfers: list[tuple[int, str, Floats]] = []
        topics: list[tuple[type, str, Callable[[Any], None], QoSProfile]] = [
            (String, "intent/active_task", self._take_active, qos.LATCHED),
            (String, "intent/active_person", self._take_helped, qos.LATCHED),
            (JointState, "joint_states", self._take_joints, qos.MEASURED),
            (JointState, "coworker/hand", partial(self._keep, self._contacts, 3), qos.STATE),
            (JointState, "intent/transfer", partial(self._keep, self._transfers, 5), qos.STATE),
        ]
        for person, seen in self._people.items():
            prefix = f"{person}/" if person else ""
            topics += [
                (PoseStamped, f"mocap/{prefix}wrist/pose", seen.take_wrist, qos.SENSOR),
                (JointState, f"intent/{prefix}tasks", seen.take_tasks, qos.STATE),
                (String, f"coworker/{prefix}task", partial(_tell, on_task, person), qos.STATE),
            ]
        self._heard: Counter[str] = Counter()
        self._answers = self.create_publisher(JointState, ANSWERS, qos.FEEDBACK)
        self._inputs = [
            self.create_subscription(
                kind, topic, partial(self._take, topic, take), qos.each_of(profile)
            )
            for kind, topic, take, profile in topics
        ]

    def _take(self, topic: str, take: Callable[[Any], None], message: Any) -> None:
        if self._inputs:  # queued messages still come after `close`
            take(message)
            self._heard[topic] += 1
            self._answers.publish(answer_of(self.get_name(), self._heard))

    def close(self) -> None:
        """Unsubscribe: messages after the session are not part of it."""
        while self._inputs:
            self.destroy_subscription(self._inputs.pop())
        self._answers.publish(answer_of(self.get_name(), {}))

    def graph_is_complete(self) -> bool:
        """Whether the nodes that must run before the human moves have found one another."""
        needed = [("joint_trajectory", 1, 1), ("joint_states", 1, 3)]
        for person in self._people:
            prefix = f"{person}/" if person else ""
            needed += [(f"mocap/{prefix}wrist/pose", 0, 2), (f"intent/{prefix}tasks", 1, 2)]
        if "" in self._people:  # topics of named people may not exist before they are seen
            needed.append(("human/wrist", 1, 1))
        return all(
            self.count_publishers(topic) >= n_out and self.count_subscribers(topic) >= n_in
            for topic, n_out, n_in in needed
        )

    def log(self, person: str = "") -> SessionLog:
        """Everything so far, as arrays; for a named person, only what the arm did for that one."""
        seen = self._people[person]
        wrist_ns, wrist = _columns(seen.wrist, 3)
        tasks_ns, probabilities = _columns(seen.tasks, len(seen.labels))
        joint_ns, joints = _columns(self._joints, len(self._joints[0][1]) if self._joints else 7)
        active = self._active if not person else _of_person(self._active, self._helped, person)
        contacts, transfers = self._contacts, self._transfers
        if person:
            contacts, transfers = (_while_active(rows, active) for rows in (contacts, transfers))
        return SessionLog(
            seen.labels,
            wrist_ns,
            wrist,
            tasks_ns,
            probabilities,
            np.array([stamp for stamp, _ in active], dtype=np.int64),
            tuple(task for _, task in active),
            joint_ns,
            joints,
            ContactLog(*_states(contacts, 3)),
            TransferLog(*_states(transfers, 5)),
        )

    def _take_helped(self, message: String) -> None:
        self._helped.append((now_ns(self), message.data))

    def _take_active(self, message: String) -> None:
        if self._active or message.data:
            self._active.append((now_ns(self), message.data))
        self._on_active(message.data)

    def _take_joints(self, message: JointState) -> None:
        positions = np.array(message.position)
        if not self._joints or self._joints[0][1].shape == positions.shape:
            self._joints.append((stamp_ns(message), positions))

    def _keep(self, rows: list[tuple[int, str, Floats]], width: int, message: JointState) -> None:
        if len(message.position) == width:
            rows.append((stamp_ns(message), message.header.frame_id, np.array(message.position)))


def _tell(on_task: Callable[[str, str], None], person: str, message: String) -> None:
    on_task(message.data, person)


def _of_person(
    active: Sequence[tuple[int, str]], helped: Sequence[tuple[int, str]], person: str
) -> list[tuple[int, str]]:
    changes = [(ns, 0, text) for ns, text in active] + [(ns, 1, text) for ns, text in helped]
    now, found = ["", ""], dict[int, str]()
    for at_ns, which, text in sorted(changes, key=lambda change: change[0]):
        now[which] = text
        found[at_ns] = now[0] if now[1] == person else ""
    before = ["", *found.values()]
    return [row for row, last in zip(found.items(), before, strict=False) if row[1] != last]


def _while_active(
    rows: Sequence[tuple[int, str, Floats]], active: Sequence[tuple[int, str]]
) -> list[tuple[int, str, Floats]]:
    places = np.searchsorted([at_ns for at_ns, _ in active], [row[0] for row in rows], "right")
    return [row for row, k in zip(rows, places, strict=True) if k and active[k - 1][1]]


def _columns(rows: Sequence[tuple[int, Floats]], width: int) -> tuple[Integers, Floats]:
    stamps = np.array([stamp for stamp, _ in rows], dtype=np.int64)
    return stamps, np.array([row for _, row in rows]).reshape(len(rows), width)


def _states(
    rows: Sequence[tuple[int, str, Floats]], width: int
) -> tuple[Integers, tuple[str, ...], Floats]:
    stamps, values = _columns([(stamp, row) for stamp, _, row in rows], width)
    return stamps, tuple(state for _, state, _ in rows), values
