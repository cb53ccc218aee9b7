# SPDX-License-Identifier: Apache-2.0
"""Boxes as parameters of the activation node: nothing moves into one, and both bodies are named."""

from types import SimpleNamespace

import numpy as np
import pytest
from activation_graph import GOALS, HOME, START_NS
from activation_graph import Graph as ActivationGraph
from clearance_world import ROBOT
from joint_trajectories import build_joint_trajectory
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import String

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import hand_position, parse_boxes
from intent_recognition.nodes.conversions import to_pose, trajectory_arrays
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from intent_recognition.registry import ANSWERS
from intent_recognition.share import share_path

GOAL = HOME + GOALS["plate"]
PERSON = ["wrist.x", "wrist.y", "wrist.z"]


def box_at(q):
    return "crate " + " ".join(f"{x:.3f}" for x in hand_position(q)) + " 0.1 0.1 0.1"


class Graph(ActivationGraph):
    """An arm that stays at home, and a hand that is described when the test says so."""

    def __init__(self, harness, **parameters):
        super().__init__(harness, **{"n_observations": 2} | parameters)
        self.begin("plate")

    def describe(self, text):
        self.hear("robot_description", String(data=text))

    def step(self):
        self.tick()
        self.send_joints(HOME)
        self.send_prediction()
        self.send_tasks()


def test_the_example_names_its_boxes(harness):
    example = share_path("config/examples/boxes.params.yaml")
    node = harness.add(PrimitiveActivation(cli_args=["--ros-args", "--params-file", str(example)]))
    boxes = parse_boxes(node.get_parameter("boxes").value)
    assert [box.name for box in boxes] == ["table", "crate"]
    assert node.get_parameter("clearance").value == 0.02


@pytest.mark.parametrize("given", [{}, {"replan_budget": 0.0}])
def test_a_path_into_a_box_is_planned_anew_or_not_followed_and_both_bodies_are_named(
    harness, given
):
    graph = Graph(harness, clearance=0.02, boxes=[box_at(0.5 * (HOME + GOAL))], **given)
    told = []
    graph.node.diagnostics.reject = lambda reason, text: told.append((reason, text))
    graph.describe(ROBOT.description)
    graph.run(4)
    if given:
        assert graph.commands == []
        texts = [text for reason, text in told if reason == "would_touch"]
        assert texts and all("plate: lwr_a" in text for text in texts), told
        assert all("would touch crate at phase" in text for text in texts)
        return
    q = trajectory_arrays(graph.commands[0])[1]
    np.testing.assert_allclose(q[-1], GOAL, atol=1e-6)
    assert np.abs(q - HOME - (GOAL - HOME) * (q[:, :1] - HOME[0]) / 0.4).max() > 0.02
    assert graph.node.activation.counts["replanned"] >= 1


@pytest.mark.slow
def test_a_path_into_a_thing_of_the_planning_scene_waits_until_it_is_gone(harness, ros_interfaces):
    """How things are read: test_planning_scene.py."""
    ros_interfaces("moveit_msgs")
    from moveit_msgs.msg import CollisionObject, PlanningScene

    graph = Graph(harness, clearance=0.02, planning_scene="read")
    (box,) = parse_boxes([box_at(GOAL)])
    thing = CollisionObject(id="container")
    thing.header.frame_id = "world"
    thing.pose = to_pose(np.array(box.center), np.array(box.quaternion))
    thing.primitives = [SolidPrimitive(type=SolidPrimitive.CYLINDER, dimensions=[0.1, 0.05])]
    graph.describe(ROBOT.description)
    for operation, waits in ((CollisionObject.ADD, True), (CollisionObject.REMOVE, False)):
        thing.operation = operation
        scene = PlanningScene(is_diff=True)
        scene.world.collision_objects = [thing]
        graph.node._things._scene.take(scene)
        graph.run(4)
        assert bool(graph.commands) != waits
        message = graph.node.diagnostics._message
        assert ("waits: plate: lwr_a" in message) == waits, message
    assert graph.node.activation.counts["waited"] == 1


@pytest.mark.parametrize(
    ("needs", "reason"),
    [
        ({"clearance": 0.02}, "bad_robot_description"),
        ({"person_dofs": PERSON}, "wrong_joint_names"),
    ],
)
def test_without_the_arms_shape_nothing_moves(harness, needs, reason):
    graph = Graph(harness, **needs)
    graph.step()
    assert graph.node.diagnostics.rejected("no_robot_description") == 1
    graph.describe(ROBOT.description.replace("lwr_a3_joint", "elbow"))
    graph.step()
    assert graph.node.diagnostics.rejected(reason) == 1
    assert graph.commands == []
    graph.describe(ROBOT.description)
    graph.run(3)
    assert graph.commands


@pytest.mark.parametrize(
    "wrong, message",
    [
        ({"boxes": ["table 0 0 0 1 1 0.1"]}, "clearance: expected above 0 m with boxes"),
        ({"planning_scene": "read"}, "clearance: expected above 0 m with a planning scene"),
        ({"clearance": 0.02, "boxes": ["table 0 0"]}, "boxes: expected 'name x y z"),
        ({"person_dofs": ["x"]}, "person_dofs: expected 3 names"),
    ],
)
def test_what_cannot_be_kept_clear_of_is_an_error_at_start(harness, wrong, message):
    with pytest.raises(ArgumentError, match=message):
        Graph(harness, **wrong)


def tell_person(graph, position, names=PERSON, times_s=(0.0, 5.0)):
    where, std = np.tile(position, (2, 1)), np.full((2, 3), 0.02)
    message = build_joint_trajectory(names, np.array(times_s), where, None, std, time_ns=START_NS)
    graph.hear("intent/human_trajectory", message)


@pytest.mark.parametrize("near", [True, False])
def test_the_arm_slows_where_the_person_is_predicted_to_be(harness, near):
    offset = np.array([0.0, 0.0, 1.0])
    graph = Graph(harness, person_dofs=PERSON, person_offset=offset.tolist())
    graph.describe(ROBOT.description)
    tell_person(graph, (hand_position(GOAL) if near else np.array([6.0, 0.0, 0.0])) - offset)
    graph.run(3)
    assert bool(graph.node.activation.counts["slowed by person"]) == near
    times_s, q, _ = trajectory_arrays(graph.commands[0])
    np.testing.assert_allclose(q[-1], GOAL, atol=1e-6)
    assert (times_s[-1] > 3.0) == near


def test_a_person_may_be_observed_in_millimetres_but_not_in_other_units(harness):
    graph = Graph(harness, person_dofs=PERSON, person_offset=[0.0, 0.0, 1.0])
    library = SimpleNamespace(observed_names=PERSON, observed_units=("mm",) * 3)
    graph.node._person.know(library)
    tell_person(graph, np.array([100.0, 200.0, 300.0]))
    (person,) = graph.node._person.people
    np.testing.assert_allclose(person.positions, np.tile([0.1, 0.2, 1.3], (2, 1)))
    np.testing.assert_allclose(person.std, 2e-5 * np.sqrt(3.0))
    for wrong in ({"observed_units": ("m", "m", "rad")}, {"observed_names": ["a", "b", "c"]}):
        with pytest.raises(ArgumentError, match="person_dofs: expected positions that the model"):
            graph.node._person.know(SimpleNamespace(**vars(library) | wrong))


@pytest.mark.parametrize(("behind_s", "shift_s"), [(0.1, 0.0), (0.9, 0.9), (-0.5, -0.5)])
def test_a_trackers_clock_that_is_off_does_not_shift_a_person(harness, behind_s, shift_s):
    """A prediction begins where the person was measured; it may be late, but not by the age."""
    graph = Graph(harness, person_dofs=PERSON)
    graph.run(3)
    begin_s = (graph.now_ns - START_NS) * 1e-9 - behind_s
    tell_person(graph, np.zeros(3), times_s=(begin_s, begin_s + 2.0))
    (person,) = graph.node._person.people
    np.testing.assert_allclose(
        (person.times_ns - START_NS) * 1e-9 - shift_s, [begin_s, begin_s + 2.0]
    )
    _, values = graph.report()
    assert values["people behind"] == f"{behind_s:.3f} s"


def test_a_person_who_waits_at_the_end_does_not_seem_late(harness):
    graph = Graph(harness, person_dofs=PERSON)
    graph.run(3)
    tell_person(graph, np.zeros(3), times_s=(-9.0, -9.0))
    assert "people behind" not in graph.report()[1]


@pytest.mark.parametrize("names, where", [(["a", "b", "c"], 0.0), (PERSON, np.nan)])
def test_a_broken_prediction_does_not_clear_the_way_of_a_person(harness, capfd, names, where):
    graph = Graph(harness, person_dofs=PERSON)
    graph.describe(ROBOT.description)
    tell_person(graph, np.zeros(3), times_s=(5.0, 5.0))  # at the end of the movement
    (person,) = graph.node._person.people
    assert len(person.times_ns) == 1
    tell_person(graph, np.full(3, where), names)
    assert graph.node._person.people == (person,)
    assert graph.node.diagnostics.rejected("bad_human_trajectory") == 1
    what = "points: expected finite" if names == PERSON else f"joint_names: expected {PERSON[0]}"
    assert f"bad_human_trajectory: intent/human_trajectory: {what}" in capfd.readouterr().err


def test_where_time_waits_for_the_node_a_search_takes_none(harness):
    graph = Graph(harness)
    assert graph.node._things._spent_s() > 0.0
    harness.said(graph.node, ANSWERS)  # somebody waits
    assert graph.node._things._spent_s() == 0.0
