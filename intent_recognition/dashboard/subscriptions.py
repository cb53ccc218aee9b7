# SPDX-License-Identifier: Apache-2.0
"""Subscriptions that fill the page's state of the cell from the topics."""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from intent_recognition.array_types import Floats
from intent_recognition.composing import HAND, read_via_points
from intent_recognition.dashboard.cell import (
    FORCES,
    PLOTTED_S,
    SHARE,
    SLIP,
    CellState,
    NodeHealth,
    PathMarkers,
    PersonState,
    Posterior,
    PredictedMotion,
    SkillRow,
)
from intent_recognition.dashboard.checks import (
    LONGEST_NAME,
    LONGEST_SENTENCE,
    MOST_NAMES,
    check,
    check_count,
    checked_names,
    checked_numbers,
    checked_text,
)
from intent_recognition.errors import ArgumentError, one_line
from intent_recognition.model import OUTCOME
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import position_array
from intent_recognition.nodes.diagnostics import ENDED
from intent_recognition.plans import read_plan

MOST_POINTS = 10_000
"""Largest number of points in a path, tube or trajectory: 100 s at 100 Hz."""
MOST_PEOPLE = 8
"""Largest number of named people shown; the one not seen for longest makes room."""
LONGEST_DESCRIPTION = 1_000_000
"""Largest number of characters in a URDF: thirty times the simulated arm's."""


class CellSubscriptions:
    """Fills a `CellState`; calls `reject` with a reason and a text for a message it cannot show."""

    def __init__(
        self,
        node: Node,
        state: CellState,
        body: str = "wrist",
        reject: Callable[[str, str], None] = lambda reason, text: None,
        clock: Callable[[], float] = time.monotonic,
    ):
        self._node, self._state, self._reject, self._clock = node, state, reject, clock
        self._body = body
        self._subscribe(
            (JointState, "joint_states", self._on_joints, qos.MEASURED),
            (PoseStamped, f"mocap/{body}/pose", partial(self._on_wrist, ""), qos.SENSOR),
            (JointState, "intent/transfer", self._on_transfer, qos.STATE),
            (WrenchStamped, "wrench", self._on_wrench, qos.SENSOR),
            (String, "intent/active_task", self._on_active, qos.LATCHED),
            (String, "intent/active_person", self._text("helped"), qos.LATCHED),
            (DiagnosticStatus, "intent/feedback", self._on_feedback, qos.FEEDBACK),
            (JointState, "intent/question", self._on_question, qos.LATCHED),
            (DiagnosticStatus, "intent/plan", self._on_plan, qos.LATCHED),
            (String, "coworker/task", self._text("truth"), qos.STATE),
            (String, "robot_description", self._text("description"), qos.LATCHED),
            (String, "teach/status", self._text("teaching"), qos.LATCHED),
            (DiagnosticArray, "teach/skills", self._on_skills, qos.LATCHED),
            (String, "intent/via_points", self._on_via_points, qos.LATCHED),
            (DiagnosticArray, "/diagnostics", self._on_diagnostics, 10),
        )
        self._beliefs: dict[str, list[Subscription]] = {}
        self._hear_estimator("")

    def meet(self, name: str) -> None:
        """Show a named person, too, as soon as a message about that person arrives."""
        wrist = partial(self._on_wrist, name)
        self._subscribe((Odometry, f"human/{name}/{self._body}", wrist, qos.SENSOR))

    def _is_shown(self, name: str) -> bool:
        """Whether a person can be shown; a person not seen for `PLOTTED_S` makes room."""
        people, now_s = self._state.people, self._clock()
        if name in people:
            return True
        named = [person for person in people if person]
        if len(named) >= MOST_PEOPLE:
            gone = min(named, key=lambda person: people[person].wrist_at_s)
            if now_s - people[gone].wrist_at_s <= PLOTTED_S:
                return False
            del people[gone]
            for subscription in self._beliefs.pop(gone):
                self._node.destroy_subscription(subscription)
        people[name] = PersonState()
        self._hear_estimator(name)
        return True

    def _hear_estimator(self, name: str) -> None:
        prefix = f"intent/{name}/" if name else "intent/"
        person = self._state.people[name]  # queued messages may come after its removal
        predicted = partial(self._on_predicted, person)
        self._beliefs[name] = self._subscribe(
            (JointState, f"{prefix}tasks", partial(self._on_tasks, person), qos.STATE),
            (JointTrajectory, f"{prefix}robot_trajectory", predicted, qos.COMMAND),
            (MarkerArray, f"{prefix}markers", partial(self._on_markers, person), qos.COMMAND),
        )

    def _subscribe(self, *inputs: tuple) -> list[Subscription]:
        return [
            self._node.create_subscription(kind, topic, partial(self._take, topic, handle), profile)
            for kind, topic, handle, profile in inputs
        ]

    def _take(self, topic: str, take: Callable, message: Any) -> None:
        """Handle a message, or count it as rejected if it cannot be shown."""
        try:
            take(message)
        except ArgumentError as error:
            self._reject(f"malformed {topic}", one_line(error))

    def _on_joints(self, message: JointState) -> None:
        names = checked_names("name", message.name)
        positions = checked_numbers("position", message.position, (len(names),))
        self._state.take_joints(names, positions.tolist(), self._clock())

    def _on_wrist(self, person: str, message: PoseStamped | Odometry) -> None:
        pose = message.pose if isinstance(message, PoseStamped) else message.pose.pose
        position = checked_numbers("position", position_array(pose), (3,))
        if self._is_shown(person):
            self._state.people[person].take_wrist(position, self._clock())

    def _on_tasks(self, person: PersonState, message: JointState) -> None:
        names = checked_names("name", message.name)
        check("name", "at least one task", len(names) > 0, "none")
        chances = checked_numbers("position", message.position, (len(names),))
        check("position", "probabilities", np.all((chances >= 0.0) & (chances <= 1.0)), chances)
        phase = checked_numbers("velocity", message.velocity, (len(names),))
        person.take_posterior(Posterior(names, chances, phase), self._clock())

    def _on_predicted(self, person: PersonState, message: JointTrajectory) -> None:
        names = checked_names("joint_names", message.joint_names)
        check_count("points", message.points, MOST_POINTS, "of a trajectory")
        rows = [checked_numbers("positions", p.positions, (len(names),)) for p in message.points]
        positions = np.array(rows).reshape(len(rows), len(names))
        task = checked_text("frame_id", message.header.frame_id)
        person.predicted = PredictedMotion(task, names, positions)
        person.predicted_at_s = self._clock()

    def _on_markers(self, person: PersonState, message: MarkerArray) -> None:
        lines = [_points(m) for m in message.markers if m.type == Marker.LINE_STRIP]
        tubes = [_points(m) for m in message.markers if m.type == Marker.TRIANGLE_LIST]
        if len(lines) == 2 and len(tubes) == 1:
            n = len(tubes[0])
            check("points", "three corners of each triangle", n % 3 == 0, n)
            person.drawn, person.drawn_at_s = PathMarkers(lines[1], tubes[0]), self._clock()

    def _on_transfer(self, message: JointState) -> None:
        names = checked_names("name", message.name)
        numbers = checked_numbers("position", message.position, (len(names),)).tolist()
        needed = {SHARE, SLIP, *FORCES}
        check("name", f"among them {', '.join(sorted(needed))}", needed <= {*names}, names)
        holding = checked_text("frame_id", message.header.frame_id)
        self._state.transfer.take(holding, dict(zip(names, numbers, strict=True)), self._clock())

    def _on_wrench(self, message: WrenchStamped) -> None:
        f = message.wrench.force
        force = checked_numbers("force", (f.x, f.y, f.z), (3,))
        self._state.transfer.take_sensor(float(np.linalg.norm(force)), self._clock())

    def _on_active(self, message: String) -> None:
        self._state.take_active(checked_text("data", message.data))

    def _on_feedback(self, message: DiagnosticStatus) -> None:
        _, values = _status_content(message)
        if OUTCOME in values:
            self._state.take_outcome(checked_text("name", message.name), values[OUTCOME])

    def _on_question(self, message: JointState) -> None:
        names = checked_names("name", message.name)
        self._state.take_question(names, self._clock())

    def _on_plan(self, message: DiagnosticStatus) -> None:
        steps = [pair for pair in message.values if pair.key != "yaml"]
        texts = [pair.value for pair in message.values if pair.key == "yaml"]
        _, content = _status_content(DiagnosticStatus(message=message.message, values=steps))
        plan = read_plan(checked_text("yaml", texts[0], 100_000)) if texts else None
        checked_names("step", plan.names if plan else ())
        self._state.plan = plan
        self._state.progress = {step: what.rpartition(" ")[0] for step, what in content.items()}

    def _text(self, field: str) -> Callable[[String], None]:
        """A callback that stores the newest text of a topic in a field of the state."""
        longest = {"description": LONGEST_DESCRIPTION, "teaching": LONGEST_SENTENCE}
        return lambda message: setattr(
            self._state, field, checked_text("data", message.data, longest.get(field, LONGEST_NAME))
        )

    def _on_via_points(self, message: String) -> None:
        points = read_via_points(checked_text("data", message.data, LONGEST_DESCRIPTION))
        for point in points:
            hand = point.values.get(HAND, ())
            checked_numbers(HAND, hand, (len(hand),))
        self._state.via_points = points

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now_s, nodes = self._clock(), self._state.nodes
        for status in message.status:
            name = checked_text("name", status.name)
            known = name in nodes or len(nodes) < MOST_NAMES
            check("status", f"at most {MOST_NAMES} nodes", known, f"{name}, too")
            text, values = _status_content(status)
            level = int.from_bytes(status.level, "little")
            nodes[name] = NodeHealth(level, text, values, now_s, ENDED in values)

    def _on_skills(self, message: DiagnosticArray) -> None:
        check_count("status", message.status, 2000, "changes")
        skills: dict[str, list[SkillRow]] = {}
        for status in message.status:
            row = SkillRow(*_status_content(status))
            skills.setdefault(checked_text("name", status.name), []).append(row)
        self._state.skills = skills


def _status_content(status: DiagnosticStatus) -> tuple[str, dict[str, str]]:
    """Message and values of a status."""
    check_count("values", status.values, 200, "rows")
    text = checked_text("message", status.message, LONGEST_SENTENCE)
    return text, {
        checked_text("key", pair.key): checked_text("value", pair.value, LONGEST_SENTENCE)
        for pair in status.values
    }


def _points(marker: Marker) -> Floats:
    """Points of a marker (T, 3)."""
    check_count("points", marker.points, MOST_POINTS, "of a marker")
    points = np.array([(p.x, p.y, p.z) for p in marker.points]).reshape(-1, 3)
    return checked_numbers("points", points, points.shape)
