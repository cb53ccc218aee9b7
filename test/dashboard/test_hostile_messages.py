# SPDX-License-Identifier: Apache-2.0
"""No message of a subscribed type ends the page, and what it cannot show it counts."""

from array import array
from unittest.mock import Mock

import numpy as np
import pytest
from dashboard.test_bounded import Watched
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hostile.random_messages import TEXTS as ANY_TEXTS
from hostile.random_messages import random_message
from kinematics.robots import lwr_urdf
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from intent_recognition.dashboard.robot_view import MOST_JOINTS
from intent_recognition.dashboard.scene import DARK
from intent_recognition.dashboard.subscriptions import MOST_PEOPLE, PLOTTED_S, CellSubscriptions
from intent_recognition.kinematics.lwr import JOINT_NAMES

TEXTS = (*ANY_TEXTS, *JOINT_NAMES)
SHAPE = '<link name="a"><visual><geometry>{}</geometry></visual></link>'
LINK, URDF = '<link name="{}"/>', '<robot name="r">{}</robot>'
JOINT = (
    '<joint name="{name}" type="{type}"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{xyz}"/><axis xyz="0 0 1"/></joint>'
)


def chain(count, **changed):
    links = "".join(LINK.format(k) for k in range(count + 1))
    given = {"type": "revolute", "xyz": "0 0 1"} | changed
    joints = [JOINT.format(name=k, **({"parent": k, "child": k + 1} | given)) for k in range(count)]
    return URDF.format(links + "".join(joints))


URDFS = {
    "no xml": "robot",
    "half": lwr_urdf()[:3000],
    "zero": "\0",
    "empty robot": "<robot/>",
    "no links": URDF.format(""),
    "no such mesh": URDF.format(SHAPE.format('<mesh filename="/no.stl"/>')),
    "a device": URDF.format(SHAPE.format('<mesh filename="/dev/zero"/>')),
    "capsule": URDF.format(SHAPE.format('<capsule radius="1" length="1"/>')),
    "bad box": URDF.format(SHAPE.format('<box size="a b"/>')),
    "box of nan": URDF.format(SHAPE.format('<box size="nan nan nan"/>')),
    "circle": chain(2, parent=0, child=0),
    "nobody's child": chain(2, parent=7, child=9),
    "odd type": chain(2, type="strange"),
    "nan": chain(2, xyz="nan nan nan"),
    "far": chain(2, xyz="1e300 0 0"),
    "words": chain(2, xyz="here and there"),
    "two numbers": chain(2, xyz="1 2"),
    "long": chain(MOST_JOINTS + 1),
    "deep": "<robot name='r'>" + "<link>" * 20_000,
    "mimic of itself": URDF.format(
        LINK.format("a")
        + LINK.format("b")
        + JOINT.replace("<axis", '<mimic joint="j"/><axis').format(
            name="j", type="revolute", parent="a", child="b", xyz="0 0 0"
        )
    ),
    "entities": '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY a{k} "{"&a" * 0}{f"&a{k - 1 if k else str()};" * 10}">' for k in range(9))
    + "]>"
    + URDF.format("&a8;"),
    "a file": '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///dev/zero">]>' + URDF.format("&a;"),
}


class Fed(Watched):
    """A page that hears its topics, called without a middleware."""

    def __init__(self, harness):
        super().__init__(harness)
        self.rejected, self._node = [], harness.probe
        self._before = set(harness.probe.subscriptions)
        self.subscriptions = CellSubscriptions(
            harness.probe,
            self.state,
            reject=lambda reason, text: self.rejected.append((reason, text)),
            clock=lambda: self.now_s,
        )

    @property
    def topics(self):
        made = (s for s in self._node.subscriptions if s not in self._before)
        return {s.topic_name: s for s in made}

    def reasons(self):
        return [reason for reason, _ in self.rejected]

    def meet(self, name):
        self.subscriptions.meet(name)

    def hear(self, topic, message):
        serialize_message(message)  # it can be sent
        self.now_s += 1.1  # every part of the page is due
        self.topics[topic].callback(message)
        self.page.update()


@pytest.fixture
def fed(harness):
    fed = Fed(harness)
    yield fed
    fed.page.close()


@pytest.mark.slow
def test_random_messages_of_every_type_leave_it_running(fed):
    rng = np.random.default_rng(14)
    fed.meet("anna")
    for _ in range(25):
        for topic, subscription in fed.topics.items():
            if topic != "/robot_description":
                fed.hear(topic, random_message(rng, subscription.msg_type, TEXTS))
    assert len(fed.topics) == 22
    assert len(fed.rejected) > 100
    good = JointState(name=["a", "none"], position=[0.4, 0.6], velocity=[0.1, 0.0])
    fed.hear("/intent/tasks", good)
    assert fed.state.person.posterior.labels == ("a", "none")


def test_after_a_robot_that_cannot_be_drawn_the_next_one_is(fed):
    fed.hear("/joint_states", JointState(name=list(JOINT_NAMES), position=[0.1] * 7))
    fed.hear("/joint_states", JointState(name=["0", "1"], position=[0.1] * 2))
    for name, text in URDFS.items():
        fed.hear("/robot_description", String(data=text))
        bad = fed.page._scene.robot
        fed.hear("/robot_description", String(data=chain(2)))
        assert fed.page._scene.robot not in (None, bad), name


def test_what_else_cannot_be_drawn_is_not_laid_to_the_robot(fed, monkeypatch):
    fed.hear("/robot_description", String(data=chain(2)))
    robot = fed.page._scene.robot
    monkeypatch.setattr(fed.page._scene._things, "update", Mock(side_effect=RuntimeError("things")))
    with pytest.raises(RuntimeError, match="things"):
        fed.page.update()
    assert robot is not None and fed.page._scene.robot is robot
    monkeypatch.undo()


UNEQUAL = [([0.5], [0.5]), ([], []), ([0.5, 0.5], []), ([np.nan, 0.5], [0, 0]), ([7, -6], [0, 0])]


def test_a_posterior_of_unequal_sizes_is_counted(fed):
    for number, (position, velocity) in enumerate(UNEQUAL, 1):
        message = JointState(name=["a", "none"])
        message.position, message.velocity = array("d", position), array("d", velocity)
        fed.hear("/intent/tasks", message)
        fed.hear("/intent/tasks", JointState())
        assert fed.state.person.posterior is None
        assert fed.reasons() == ["malformed intent/tasks"] * 2 * number


FELT = {"load_share": 0.5, "load": 4.0, "weight": 3.9, "grip_force": 12.0, "slip": 0.0}
BIG = "steps: [" + ", ".join(f"{{step: {k}}}" for k in range(100)) + "]"


NO_FORCES = ({"load": np.nan}, {"load": np.inf}, {"load_share": 1e300})
NO_FORCES += ({"load": None}, {"slip": None})


def test_forces_that_are_no_forces_are_counted(fed):
    for number, changed in enumerate(NO_FORCES, 1):
        felt = {name: v for name, v in (FELT | changed).items() if v is not None}
        fed.hear("/intent/transfer", JointState(name=list(felt), position=list(felt.values())))
        assert fed.reasons() == ["malformed intent/transfer"] * number
        assert not fed.state.transfer.holding
    message = JointState(name=list(FELT), position=list(FELT.values()))
    message.header.frame_id = "offering"
    for _ in range(3):
        fed.hear("/intent/transfer", message)
    assert "offering" in fed.page._watch._transfer_line.content


NO_PLANS = ("", "[", "steps: 3", "steps: [{step: a}, {step: a}]", BIG, "x" * 200_000, "&a [*a]")


def test_a_plan_that_is_none_is_counted_and_the_one_before_stays(fed):
    good = [KeyValue(key="a", value="done 1.00"), KeyValue(key="yaml", value="steps: [{step: a}]")]
    fed.hear("/intent/plan", DiagnosticStatus(values=good))
    for number, text in enumerate(NO_PLANS, 1):
        fed.hear("/intent/plan", DiagnosticStatus(values=[KeyValue(key="yaml", value=text)]))
        assert fed.reasons() == ["malformed intent/plan"] * number
        assert fed.page._watch._plan._step.options == ("a",)
    fed.hear("/intent/plan", DiagnosticStatus(message="no plan"))
    assert fed.state.plan is None


def test_each_person_has_a_belief_a_hand_and_a_colour_and_the_helped_one_is_named(fed):
    for name, chance, x in (("anna", 0.9, 0.5), ("ben", 0.2, -0.5)):
        fed.meet(name)
        message = JointState(name=["a", "none"], position=[chance, 1 - chance], velocity=[0.1, 0])
        odometry = Odometry()
        odometry.pose.pose.position.x = x
        for _ in range(3):
            fed.hear(f"/human/{name}/wrist", odometry)
            fed.hear(f"/intent/{name}/tasks", message)
    fed.hear("/intent/active_task", String(data="a"))
    fed.hear("/intent/active_person", String(data="ben"))
    bars = {name: panel.bars.content for name, panel in fed.page._watch._people.items()}
    assert bars[""] == "" and "90%" in bars["anna"] and "20%" in bars["ben"]
    assert "&#9679;" in bars["ben"] and "&#9679;" not in bars["anna"], "whose task is executed"
    handles = fed.page._server.scene._handle_from_node_name
    hands = [handles[f"/people/{name}/wrist"] for name in ("anna", "ben")]
    assert [hand.position[0] for hand in hands] == [0.5, -0.5]
    assert tuple(hands[1].color) != DARK and "ben" in fed.page._now.content
    fed.hear("/intent/active_person", String(data="nobody known"))
    fed.hear("/intent/active_person", String(data="x" * 300))
    assert fed.reasons() == ["malformed intent/active_person"]


GOOD = {
    JointState: JointState(name=["a"], position=[1.0], velocity=[0.1]),
    JointTrajectory: JointTrajectory(),
    MarkerArray: MarkerArray(
        markers=[Marker(type=Marker.LINE_STRIP)] * 2 + [Marker(type=Marker.TRIANGLE_LIST)]
    ),
}


def test_who_is_seen_no_more_makes_room_for_somebody_new(fed):
    names = [f"p{k}" for k in range(MOST_PEOPLE + 1)]
    for name in names:
        fed.meet(name)
    for name in names:
        fed.hear(f"/human/{name}/wrist", Odometry())
    shown = lambda: [name for name in fed.state.people if name]  # noqa: E731
    assert shown() == names[:-1]  # all of them were seen within the plotted time
    fed.now_s += PLOTTED_S
    queued = [s for topic, s in fed.topics.items() if topic.startswith("/intent/p0/")]
    for name in names[1:]:
        fed.hear(f"/human/{name}/wrist", Odometry())
    assert shown() == names[1:] and set(fed.page._watch._people) == {"", *names[1:]}
    handles = fed.page._server.scene._handle_from_node_name
    assert "/people/p0/wrist" not in handles and f"/people/{names[-1]}/wrist" in handles
    assert "/intent/p0/tasks" not in fed.topics
    for subscription in queued:
        subscription.callback(GOOD[subscription.msg_type])
    fed.hear("/human/p0/wrist", Odometry())  # comes back: there is no room
    assert shown() == names[1:]


TOO_MUCH = [
    (["a", "a"], [0.5, 0.5], "name: expected names that differ, got ['a'] twice."),
    (["a"], [1e300], "position: expected numbers up to 1e+06, got [1.e+300]."),
    ([str(k) for k in range(101)], [], "name: expected at most 100 names, got 101."),
]


@pytest.mark.parametrize(("names", "positions", "text"), TOO_MUCH)
def test_what_is_not_shown_is_named(fed, names, positions, text):
    fed.hear("/joint_states", JointState(name=names, position=positions))
    ((reason, told),) = fed.rejected
    assert reason == "malformed joint_states" and told.startswith(text)


def test_names_without_end_take_no_room_without_end(fed):
    for k in range(3000):
        status = DiagnosticStatus(name=f"node {k}")
        fed.topics["/diagnostics"].callback(DiagnosticArray(status=[status]))
        fed.topics["/joint_states"].callback(JointState(name=[f"j{k}"], position=[0.0]))
    assert len(fed.state.nodes) <= 100
    assert len(fed.state.joints) <= 500
