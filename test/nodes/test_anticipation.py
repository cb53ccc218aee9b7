# SPDX-License-Identifier: Apache-2.0
"""The estimator node with the arm's posture at onset and with tasks that follow one another."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from estimator_graph import DOFS, Folder, message_for, predictions_of, shifted
from estimator_graph import Graph as EstimatorGraph
from model_builder import ROBOT

from intent_recognition.model.file import save_model
from intent_recognition.nodes.anticipation import NextTaskOutput
from intent_recognition.nodes.conversions import stamp_ns, to_joint_state, trajectory_arrays
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.recognition.estimator import IntentEstimator
from intent_recognition.recognition.start_posture import POSTURE_USED, start_mean
from intent_recognition.recognition.transitions import HABIT_TRUST, TaskMemory

RING = np.array([[0.04, 0.92, 0.04], [0.04, 0.04, 0.92], [0.92, 0.04, 0.04], [1 / 3] * 3])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A model whose tasks follow one another."""
    made = Folder(tmp_path_factory.mktemp("ring"), DOFS)
    made.model = replace(made.model, library=replace(made.model.library, transition_prior=RING))
    save_model(made.path, made.model)
    return made


class Graph(EstimatorGraph):
    """With a fake arm, and what it says of the task that is expected."""

    def __init__(self, harness, folder, **parameters):
        super().__init__(harness, folder, listen=False, publish_rate=1000.0, **parameters)
        self.next = harness.said(self.node, "intent/next_task")

    def send_arm(self, message):
        self.harness.hear(self.node, "joint_states", message)

    def feed(self, observations, arm=lambda stamp: None):
        """Human and arm in turn: the arm's sample of a stamp after the human's."""
        for observation in observations:
            self.send(message_for(DOFS, observation))
            posture = arm(observation.stamp_ns)
            if posture is not None:
                self.send_arm(to_joint_state(ROBOT.joints, posture, time_ns=observation.stamp_ns))


@pytest.mark.slow
def test_predictions_from_the_start_posture_are_the_library_s_and_as_the_contract_says(
    harness, folder
):
    """That the posture leaves the probabilities alone: test_start_posture.py."""
    start = start_mean(folder.model.library, 1) + 0.003
    graph = Graph(harness, folder)
    observations = folder.observations(1)
    graph.feed(observations, lambda stamp: start)
    predictions = predictions_of(folder.model.library, observations, start)
    assert sum(p.start == POSTURE_USED for p in predictions) > 50
    for message, prediction in zip(graph.robot, predictions, strict=True):
        times, positions, rest = trajectory_arrays(message)
        assert list(message.joint_names) == list(folder.model.controlled_names)
        assert message.header.frame_id == prediction.task
        assert stamp_ns(message) == prediction.onset_ns
        np.testing.assert_allclose(times, prediction.trajectory.times_s, atol=1e-9)
        np.testing.assert_array_equal(positions, prediction.trajectory.positions)
        np.testing.assert_array_equal(rest["velocities"], prediction.trajectory.velocities)
        np.testing.assert_array_equal(rest["effort"], prediction.trajectory.std)


def test_bad_joint_states_and_a_posture_outside_are_counted_and_harm_nothing(harness, folder):
    graph = Graph(harness, folder)
    start = start_mean(folder.model.library, 1)
    names, stamp = list(ROBOT.joints), 1_600_000_000_000_000_000
    for position, labels, time_ns, reason in (
        (start, names, stamp, ""),
        (start, names, stamp, "posture_stamp_not_increasing"),
        (start, names, 0, "posture_zero_stamp"),
        (np.full(7, np.nan), names, stamp + 10, "posture_not_finite"),
        (start[:3], names[:3], stamp + 20, "posture_missing_dof"),
        (start, names, graph.node.get_clock().now().nanoseconds + 10**12, "posture_in_future"),
        (start, names, stamp + 30, ""),  # which does not shut out the others
    ):
        message = to_joint_state(labels, position, time_ns=time_ns)
        graph.send_arm(message)
        assert not reason or graph.rejected(reason) == 1
    assert graph.rejected("posture_stamp_not_increasing") == 1
    graph.feed(folder.observations(1), lambda stamp: start + 0.8)
    assert graph.rejected("start_posture_outside")
    status = graph.node._diagnostics.report()
    assert values_of(status)["start posture"] == "outside" and status.level == b"\x00"


@pytest.mark.slow
def test_the_next_task_is_published_when_a_movement_ends(harness, folder):
    graph = Graph(harness, folder)
    observations = folder.observations(1)
    graph.feed(observations)
    (after,) = graph.next
    assert list(after.name) == list(folder.model.labels)
    assert after.header.frame_id == "task_1"
    assert abs(sum(after.position) - 1.0) <= 1e-9
    row = HABIT_TRUST * RING[1] + (1 - HABIT_TRUST) / 3
    np.testing.assert_allclose(after.position, row, atol=0.02)  # the last task is 0.98 sure
    idle = [m for m in graph.tasks if stamp_ns(m) >= stamp_ns(after)]
    assert stamp_ns(idle[0]) == stamp_ns(after) and idle[0].position[-1] == 1.0
    later = shifted(folder.observations(2), 6.0)
    graph.feed(later[:70])
    both = [IntentEstimator(folder.model.library, transitions=on) for on in (True, False)]
    for estimator in both:
        ours = [estimator.update(o).probabilities for o in (*observations, *later[:70])]
        same = np.allclose([m.position for m in graph.tasks], ours, rtol=0.0, atol=1e-12)
        assert same == (estimator is both[0])
    assert graph.call("reset").success
    assert graph.next[-1].header.frame_id == ""
    np.testing.assert_allclose(graph.next[-1].position, 1 / 3)


def test_what_is_expected_as_before_is_not_published_again(harness):
    output = NextTaskOutput(harness.probe, "intent/next_task_again")

    def estimator(*prior: float) -> SimpleNamespace:
        expected = SimpleNamespace(
            memory=TaskMemory.empty(2), prior=np.array(prior), last_task="task_1"
        )
        return SimpleNamespace(expectation=expected, library=SimpleNamespace(labels=("a", "b")))

    told = [output.update(estimator(*prior)) for prior in ((0.4, 0.6), (0.4, 0.6), (0.5, 0.5))]
    assert told == [True, False, True]


@pytest.mark.slow
def test_when_the_clock_goes_back_the_estimator_starts_anew_at_once(harness, folder):
    graph = Graph(harness, folder, use_sim_time=True)
    observations = folder.observations(1)
    left_over = shifted(observations[-1:], 0.01)
    for late in ([], left_over):  # the second pass of a recording, and what the first left
        harness.set_clock(graph.node, observations[0].stamp_ns)
        graph.feed([*late, *observations])
        harness.set_clock(graph.node, observations[-1].stamp_ns)
    n = len(observations)
    for first, second in zip(graph.tasks[:n], graph.tasks[n:], strict=True):
        assert stamp_ns(first) == stamp_ns(second)
        np.testing.assert_allclose(first.position, second.position, atol=1e-9)
