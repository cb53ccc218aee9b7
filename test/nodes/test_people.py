# SPDX-License-Identifier: Apache-2.0
"""Two people through the nodes: each is followed as if alone, and the arm helps one at a time."""

from dataclasses import replace
from unittest.mock import Mock, call

import numpy as np
import pytest
from activation_graph import Graph
from geometry_msgs.msg import PoseStamped
from model_builder import WRIST, learned_model, make_dofs, perform, true_library
from sensor_msgs.msg import JointState

from intent_recognition.errors import ArgumentError
from intent_recognition.filtering import TaskPosterior
from intent_recognition.model.file import save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import PoseNumbers, stamp_ns, to_pose, to_stamp
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.people import IdentityInput
from intent_recognition.recognition import IntentEstimator
from intent_recognition.signals import Observation
from intent_recognition.tracking import IngestSettings, IngestState, ingest_pose

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
TASKS = {"anna": 0, "ben": 1}
BESIDE = {"anna": np.zeros(3), "ben": np.array([0.0, 0.2, 0.0])}
T0 = 10**18
STEP_NS = 2 * 10**7


@pytest.fixture(scope="module")
def truth():
    return true_library(make_dofs(WRIST))


@pytest.fixture(scope="module")
def model(truth):
    return learned_model(make_dofs(WRIST), truth)


def paths(truth):
    """Where the wrists of two people are, (T, 3) each, at 50 Hz: ben's is beside anna's."""
    found = {who: perform(truth, task, 300 + task).observed[0] for who, task in TASKS.items()}
    n = min(len(signal.values) for signal in found.values())
    return {who: s.values[:n] + BESIDE[who] for who, s in found.items()}


def alone(model, path):
    """What the library makes of a path without anybody else."""
    state, estimator, found = IngestState(), IntentEstimator(model.library), []
    for k, position in enumerate(path):
        stamp = T0 + k * STEP_NS
        state, pose = ingest_pose(IngestSettings(), state, stamp, position, UPRIGHT, "world")
        seen = Observation(stamp, 0, pose.position, covariance=pose.position_covariance)
        found.append(estimator.update(seen))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("persons", [["anna", "ben"], ["*"]])
def test_each_is_recognised_as_if_alone_though_the_tracker_exchanges_them(
    harness, truth, model, tmp_path, persons
):
    save_model(tmp_path / "model.npz", model)
    wrists = paths(truth)
    for label in TASKS:  # whoever is there is met by the topics that appear
        harness.publisher(PoseStamped, f"mocap/{label}/wrist/pose", qos.SENSOR)
    ingest = harness.node(MocapIngest, persons=persons)
    named = {"persons": persons, "model": str(tmp_path / "model.npz")}
    estimator = harness.node(IntentEstimatorNode, **named)
    tasks = {p: harness.collect(JointState, f"intent/{p}/tasks", qos.keep_last(999)) for p in TASKS}
    harness.spin_until(lambda: len(ingest._waiting) == 2, what="both met")
    apart = np.linalg.norm(wrists["anna"] - wrists["ben"], axis=1)
    k0 = int(np.argmax((apart > 0.1) & (np.arange(len(apart)) > 70)))

    def show(stamp, at, labels):
        for who, label in zip(TASKS, labels, strict=True):
            message = PoseStamped(pose=to_pose(at[who], UPRIGHT))
            message.header.frame_id, message.header.stamp = "world", to_stamp(stamp)
            harness.hear(ingest, f"mocap/{label}/wrist/pose", message)

    sent, first = 0, {who: path[0] for who, path in wrists.items()}
    while not len(ingest._identity._who) == len(estimator.people) == 2:  # met, and forgotten by T0
        sent += 1
        harness.executor.spin_once(timeout_sec=0.01)
        show(T0 - 10**11 + sent * STEP_NS, first, TASKS)
    outputs = [belief.output.tasks for belief in estimator.people.values()]
    harness.connect(*ingest._outputs.values(), *outputs)
    show(T0 - STEP_NS, first, TASKS)  # whether time has jumped is known once it goes on
    for k in range(len(apart)):
        at = {who: path[k] for who, path in wrists.items()}
        show(T0 + k * STEP_NS, at, list(reversed(TASKS)) if k >= k0 else TASKS)
        harness.spin_until(
            lambda k=k: all(m and stamp_ns(m[-1]) == T0 + k * STEP_NS for m in tasks.values()),
            what="tasks of both",
        )
    for who in TASKS:
        expected = alone(model, wrists[who])
        for message, estimate in zip(tasks[who][-len(expected) :], expected, strict=True):
            assert stamp_ns(message) == estimate.stamp_ns
            np.testing.assert_allclose(message.position, estimate.probabilities, atol=1e-9)
    assert ingest._diagnostics._counts["identity_undone"] == 1
    assert {id(b.estimator.library) for b in estimator.people.values()} == {
        id(estimator.people["anna"].estimator.library)
    }


@pytest.mark.slow
def test_a_frame_that_is_stamped_wrong_changes_nobody_and_a_clock_may_go_back():
    sent, diagnostics = [], Mock()
    people = IdentityInput("wrist", lambda who, _, p: sent.append((who, *p.pose)), diagnostics)

    def show(stamp, labels):
        sent.clear()
        for x, label in enumerate(labels):
            pose = PoseNumbers(stamp, "world", np.array([x, 0.0, 0.0, *UPRIGHT]), None)
            people.take(label, "wrist", pose, IngestSettings())
        return "".join(who for who, x, *_ in sent if x == 0.0)

    for k in range(1, 80):
        exchanged = ("anna", "ben") if k < 20 else ("ben", "anna")
        off_s = {30: 3600, 50: -2}.get(k, 0)
        seen = show(T0 + k * STEP_NS + off_s * 10**9, exchanged)
        assert seen == ("" if off_s else "anna") or k == 1
    assert diagnostics.count.mock_calls.count(call("stamp_jumped")) == 4
    assert show(T0 // 2, exchanged) == ""
    for k in range(1, 4):
        seen = show(T0 // 2 + k * STEP_NS, exchanged)
    assert seen == "ben"
    slow = [show(T0 + k * 1_100_000_000, exchanged) for k in range(20)]
    assert all(slow[2:])  # less than one frame a second


def test_the_arm_hears_each_on_topics_of_their_own_and_says_whom_it_helps(harness):
    """Whom it helps first: test_people.py of the activation."""
    graph = Graph(harness, person="ben", persons=["anna", "ben"])
    helped = harness.said(graph.node, "intent/active_person")
    graph.begin("screw")
    for _ in range(10):  # without joint states no motion begins
        graph.tick()
        graph.send_prediction()
        graph.send_tasks()
    assert graph.node.activation.attended == ""
    graph.until(lambda: graph.node.activation.attended == "ben")
    assert graph.node.activation.active_task == "screw"
    assert helped[-1].data == "ben"


@pytest.mark.parametrize("names", [["anna", "anna"], ["no/topic"], ["1st"]])
def test_names_that_cannot_be_told_apart_or_be_topics_are_refused(harness, names):
    with pytest.raises(ArgumentError, match="persons"):
        harness.node(MocapIngest, persons=names)


PLAN = "steps: [{step: task_0}, {step: task_1}]\nby_hand: {task_0 < task_1: 1}\n"


def test_what_one_has_done_of_a_plan_counts_for_all_and_stays_done_when_one_is_lost(
    harness, model, tmp_path
):
    save_model(tmp_path / "model.npz", replace(model))
    named = {"persons": ["anna", "ben"], "model": str(tmp_path / "model.npz"), "plan": PLAN}
    node = harness.node(IntentEstimatorNode, **named)
    anna, ben = (node.people[who] for who in ("anna", "ben"))
    n = len(model.labels)
    first, second = (model.labels.index(label) for label in ("task_0", "task_1"))
    assert ben.estimator.expectation.prior[first] > 0.7
    ones = np.ones(n + 1)
    done = TaskPosterior(np.eye(n + 1)[first], 0.0 * ones, ones, ones, ones[:, None])
    anna.estimator.expectation.remember(T0, done)
    node._publish(anna)
    assert ben.estimator.expectation.prior[second] > 0.7
    ben.forget()  # not seen for a while
    assert ben.estimator.expectation.prior[second] > 0.7
    node._forget()
    for belief in (anna, ben):
        assert belief.estimator.expectation.prior[first] > 0.7
