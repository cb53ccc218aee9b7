# SPDX-License-Identifier: Apache-2.0
"""Via points of a library: by identities, online, and what is refused."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from kinematics.robots import lwr_urdf
from model_builder import make_dofs, true_library
from online_stream import feed, humans, learned, movement, same
from simulation import make_library

from intent_recognition.composing import (
    BentLibrary,
    ViaPoint,
    bend_all,
    check_via_points,
    read_via_points,
    write_via_points,
)
from intent_recognition.composing.bending import control_point
from intent_recognition.errors import ArgumentError, IntentError, KinematicsError
from intent_recognition.gaussian import regression
from intent_recognition.kinematics import Arm
from intent_recognition.promp import controlled_at, via_point
from intent_recognition.recognition import IntentEstimator
from intent_recognition.signals import merge


@cache
def reaches():
    return learned(humans())


@cache
def lwr():
    """Three tasks of the LWR's joints, about a posture that is not stretched, and the arm."""
    library = true_library(make_dofs())
    mean = library.weight_mean.reshape(3, 10, -1).copy()
    mean[:, 3:] += np.array([0.0, 0.5, 0.0, -1.4, 0.0, 0.8, 0.0])[:, None]
    return replace(library, weight_mean=mean.reshape(3, -1)), Arm.from_urdf(lwr_urdf())


def joint(name="j", value=0.1, task="task_0", phase=0.6, std=0.001, dof="robot_1"):
    return ViaPoint(name, {dof: (value,)}, (std,), phase, None, task)


def near(library, task, phase, dof=1, stds=2.0):
    """A value some standard deviations from what a task does."""
    at = controlled_at(library, task, phase)
    return float(at.mean[dof] + stds * np.sqrt(at.covariance[dof, dof]))


def test_it_is_the_via_point_of_the_primitive_and_leaves_the_person_to_the_bit(rng):
    library = make_library(rng, n_controlled=2, n_basis=6)
    point = joint(value=near(library, 0, 0.6), std=0.01)
    bent = bend_all(library, [point])
    expected = via_point(
        library.primitive(0), 1.2, point.values["robot_1"], dofs=[4], covariance=[1e-4]
    ).weights
    np.testing.assert_allclose(bent.weight_mean[0], expected.mean, atol=1e-12)
    np.testing.assert_allclose(bent.weight_covariance[0], expected.covariance, atol=1e-12)
    np.testing.assert_array_equal(bent.observed_mean, library.observed_mean)
    np.testing.assert_array_equal(bent.observed_covariance, library.observed_covariance)
    np.testing.assert_array_equal(bent.weight_mean[1:], library.weight_mean[1:])
    control = control_point(library, 0, point)
    design = np.kron(control.matrix, library.basis.design_matrix(np.array([0.6])))
    slopes, offset, left = library.regressions[0]
    gain = left @ design.T @ np.linalg.inv(design @ left @ design.T + control.covariance)
    expected_offset = offset + gain @ (control.values - design @ offset)
    rule = slopes - gain @ design @ slopes, expected_offset, left - gain @ design @ left
    for one, other in zip(rule, bent.regressions[0], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-7)
    assert bend_all(library, []) is library


def test_a_point_of_all_tasks_is_one_of_each_and_a_time_is_a_phase(rng):
    library = make_library(rng, n_controlled=2, n_basis=6)
    library = replace(library, log_duration_mean=np.log([2.0, 3.0, 4.0]))
    everywhere = ViaPoint("p", {"robot_0": (0.1,)}, (0.01,), None, 1.5)
    each = [
        joint(f"{k}", task=f"task_{k}", phase=1.5 / s, dof="robot_0", std=0.01)
        for k, s in enumerate((2.0, 3.0, 4.0))
    ]
    np.testing.assert_allclose(
        bend_all(library, [everywhere]).weight_mean, bend_all(library, each).weight_mean, atol=1e-12
    )
    with pytest.raises(ArgumentError, match=r"at most 2\.00 s, as task_0 takes"):
        bend_all(library, [replace(everywhere, time_s=2.5)])


@pytest.mark.slow
def test_online_the_path_passes_whenever_the_point_came_and_recognition_stays():
    library = reaches()
    point = joint(value=near(library, 1, 0.6), task="task_1")
    recording = movement(humans(), 1, np.random.default_rng(7))
    observations = list(merge(recording.observed))
    plain, early, late = (IntentEstimator(library) for _ in range(3))
    early.bend(BentLibrary([point]).through)
    half = len(observations) // 2
    expected = feed(plain, observations[:half])
    feed(late, observations[:half])
    for one, other in zip(expected, feed(early, observations[:half]), strict=True):
        same(one, other)
    late.bend(BentLibrary([point]).through)
    pairs = zip(feed(early, observations[half:90]), feed(late, observations[half:90]), strict=True)
    for one, other in pairs:
        same(one, other, 1e-9)
    found = [e.predict_controlled(101).trajectory.positions for e in (plain, early, late)]
    np.testing.assert_allclose(found[1], found[2], atol=1e-9)
    missed = [abs(path[60, 1] - point.values["robot_1"][0]) for path in found]
    assert missed[1] < 0.2 * missed[0], "of a phase that is not known to the hundredth"


@pytest.mark.slow
def test_taken_back_nothing_is_left_of_it():
    library = reaches()
    estimator, plain = IntentEstimator(library), IntentEstimator(library)
    estimator.bend(BentLibrary([joint(value=near(library, 1, 0.6), task="task_1")]).through)
    estimator.swap(library)
    assert estimator.library is not library, "it is kept with another model"
    estimator.bend(BentLibrary([]).through)
    assert estimator.library is library
    observations = list(merge(movement(humans(), 1, np.random.default_rng(8)).observed))[:60]
    feed(estimator, observations), feed(plain, observations)
    one, other = estimator.predict_controlled(), plain.predict_controlled()
    np.testing.assert_array_equal(one.trajectory.positions, other.trajectory.positions)


def test_the_position_of_a_hand_that_is_predicted_is_three_of_its_dofs(rng):
    library = make_library(rng, n_controlled=6, n_basis=6)
    names = [f"hand/pose.pose.position.{axis}" for axis in "xyz"]
    library = replace(library, controlled_names=(*names, *"abc"))
    goal = controlled_at(library, 1, 0.4).mean[:3] + 0.002
    point = ViaPoint("p", {"hand": tuple(goal)}, (0.0,) * 3, 0.4, None, "task_1")
    found = controlled_at(bend_all(library, [point]), 1, 0.4)
    np.testing.assert_allclose(found.mean[:3], goal, atol=1e-6)


def test_the_hand_of_an_arm_whose_joints_are_predicted_passes():
    library, arm = lwr()
    for task, phase in ((0, 0.5), (2, 1.0)):
        joints = controlled_at(library, task, phase)
        goal = arm.forward_kinematics(joints.mean)[:3, 3] + [0.01, -0.02, 0.005]
        point = ViaPoint("bottle", {"hand": tuple(goal)}, (1e-4,) * 3, phase, None, f"task_{task}")
        check_via_points(library, [point], arm)
        bent = bend_all(library, [point], arm)
        row = bent.basis.design_matrix(np.array([phase]))[0]
        hand = arm.forward_kinematics(controlled_at(bent, task, phase).mean)[:3, 3]
        np.testing.assert_allclose(hand, goal, atol=5e-4)
        # of a person who differs by a standard deviation, 5 mm at most
        rule = regression(bent.primitive(task).weights, bent.n_observed_weights)
        weights = bent.observed_mean[task] + np.sqrt(np.diag(bent.observed_covariance[task]))
        posture = (rule.matrix @ weights + rule.offset).reshape(7, -1) @ row
        assert np.linalg.norm(arm.forward_kinematics(posture)[:3, 3] - goal) < 0.005


@pytest.mark.parametrize(
    ("point", "error", "text"),
    [
        (ViaPoint("a", {"hand": (3.0, 0.0, 0.5)}, (0.01,) * 3, 0.5), KinematicsError, "reach"),
        (ViaPoint("a", {"lwr_a2_joint": (2.2,)}, (9.0,), 0.5), ArgumentError, "2.094"),
        (ViaPoint("a", {"lwr_a2_joint": (2.0,)}, (0.01,), 0.5), ArgumentError, "at most 6"),
        (ViaPoint("a", {"elbow": (2.0,)}, (0.01,), 0.5), ArgumentError, "lwr_a1_joint"),
        (ViaPoint("a", {"lwr_a2_joint": (0.0,)}, (0.1,), 0.5, None, "x"), ArgumentError, "task_0"),
    ],
)
def test_what_no_task_can_pass_is_refused_in_one_line(point, error, text):
    library, arm = lwr()
    with pytest.raises(error, match=text) as caught:
        check_via_points(library, [point], arm)
    assert "\n" not in str(caught.value)


def test_without_a_description_the_hand_is_not_known_and_two_points_may_contradict(rng):
    library, _ = lwr()
    with pytest.raises(ArgumentError, match="no robot_description"):
        check_via_points(library, [ViaPoint("a", {"hand": (0.3, 0.0, 0.5)}, (0.01,) * 3, 0.5)])
    library = make_library(rng, n_controlled=2)
    value = near(library, 0, 0.6)
    pair = [joint("a", value, std=0.0), joint("b", value - 0.01, std=0.0)]
    check_via_points(library, pair[:1])
    with pytest.raises(ArgumentError, match="contradicts another"):
        check_via_points(library, pair)


def test_a_library_without_the_task_passes_through_the_other_points():
    library = reaches()
    points = [joint(n, near(library, int(n), 0.6), task=f"task_{n}") for n in "01"]
    bent = BentLibrary(points)
    fewer = replace(library, labels=("other", *library.labels[1:]))
    found = bent.through(fewer)
    assert bent.not_passed == ("0",)
    np.testing.assert_array_equal(found.weight_mean[0], library.weight_mean[0])
    assert not np.array_equal(found.weight_mean[1], library.weight_mean[1])
    bent.through(library)
    assert bent.not_passed == ()


def test_what_is_written_is_read():
    text = """
    - {name: bottle, task: plate, phase: 0.6, hand: [0.4, 0.1, 0.3], std: 0.02}
    - {name: elbow, time: 2.5, dofs: {lwr_a4_joint: -1.2, lwr_a5_joint: 0}, std: [0.1, 0.2]}
    """
    points = read_via_points(text)
    assert points[0] == ViaPoint(
        "bottle", {"hand": (0.4, 0.1, 0.3)}, (0.02,) * 3, 0.6, None, "plate"
    )
    assert points[1].std == (0.1, 0.2) and points[1].task == ""
    assert read_via_points(write_via_points(points)) == points
    assert read_via_points("") == () and write_via_points(()) == ""
    assert str(points[0]) == "bottle: hand 0.4 0.1 0.3 +- 0.02 at phase 0.6 of plate"


@pytest.mark.parametrize(
    "text",
    [
        "{a: 1}",
        "- 5",
        "- {phase: 0.5, hand: [0, 0, 0]}",
        "- {name: a, phase: 1.5, hand: [0, 0, 0]}",
        "- {name: a, phase: 0.5, time: 1, hand: [0, 0, 0]}",
        "- {name: a, phase: 0.5}",
        "- {name: a, phase: 0.5, hand: [0, 0]}",
        "- {name: a, phase: 0.5, hand: [0, 0, .nan]}",
        "- {name: a, phase: true, dofs: {b: 1}}",
        "- {name: a, phase: 0.5, dofs: {b: 1}, std: [1, 2]}",
        "- {name: a, phase: 0.5, dofs: {b: 1}, std: -1}",
        "- {name: a, phase: 0.5, dofs: {b: 1}, colour: 1}",
        "- {name: a, phase: 0.5, dofs: {b: 1}}\n- {name: a, phase: 0.6, dofs: {b: 1}}",
        "[",
    ],
)
def test_what_is_no_list_of_via_points_is_refused(text):
    with pytest.raises(IntentError) as caught:
        read_via_points(text)
    assert "\n" not in str(caught.value)
