# SPDX-License-Identifier: Apache-2.0
"""The activation node goes ahead to where the expected task begins, and leaves again."""

from dataclasses import replace

import numpy as np
import pytest
from model_builder import WRIST, learned_model, make_dofs, true_library
from nodes.test_primitive_activation import HOME, LABELS, Graph, check_commands
from sensor_msgs.msg import JointState

from intent_recognition.model.file import save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_joint_state
from intent_recognition.recognition.start_posture import start_mean

TASKS = LABELS[:2]
AHEAD = HOME + np.array([0.3, -0.2, 0.1, -0.2, 0.0, -0.1, 0.4])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A model whose plate begins at home and whose screw begins elsewhere."""
    dofs = make_dofs(WRIST)
    model = learned_model(dofs, true_library(dofs, n_tasks=2))
    library = model.library
    means = library.weight_mean.copy()
    for task, start in enumerate((HOME, AHEAD)):  # the basis functions sum to one
        shift = start - start_mean(library, task)
        means[task, library.n_observed_weights :] += np.repeat(shift, library.basis.n_basis)
    library = replace(library, labels=TASKS, weight_mean=means)
    np.testing.assert_allclose(start_mean(library, 1), AHEAD, atol=1e-9)
    path = tmp_path_factory.mktemp("ahead") / "model.npz"
    save_model(path, replace(model, library=library))
    return path


class AheadGraph(Graph):
    """The fake estimator also says what it expects, when a movement has ended."""

    def __init__(self, harness, path, **parameters):
        values = {"model": str(path), "pretrigger_threshold": 0.7, **parameters}
        super().__init__(harness, **values)
        self.next_task = harness.publisher(JointState, "intent/next_task", qos.LATCHED)
        harness.connect(self.next_task)

    def expect(self, p=(0.1, 0.9), names=TASKS, ahead_s=0.0):
        message = to_joint_state(names, p, time_ns=self.now_ns + round(ahead_s * 1e9))
        self.send(self.next_task, message, "intent/next_task")


@pytest.mark.slow
def test_it_waits_at_the_start_of_the_expected_task(harness, path):
    graph = AheadGraph(harness, path)
    graph.begin("plate")
    graph.until(lambda: graph.mode == "executing")
    graph.run(30)
    graph.task = "idle"
    graph.step()
    graph.expect()
    graph.until(lambda: graph.mode == "pretriggered")
    graph.run(100)
    np.testing.assert_allclose(graph.arm(), AHEAD, atol=1e-6)
    status, values = graph.report()
    assert status.message == "pretriggered: screw" and values["mode"] == "pretriggered"
    assert values["expected task"] == "screw (0.90)" and values["count pretriggered"] == "1"
    assert values["count activated"] == "1" and values["active task"] == "none"
    check_commands(graph.commands)


def test_bad_expectations_are_counted_and_not_used(harness, path):
    graph = AheadGraph(harness, path)
    for p, names in (((0.5,), TASKS), ((float("nan"), 1.0), TASKS), ((0.9, 0.9), TASKS), ((), ())):
        before = graph.rejected("bad_next_task")
        graph.expect(p, names)
        assert graph.rejected("bad_next_task") == before + 1
    graph.expect(ahead_s=0.9)  # as clocks of a graph may differ
    graph.step()
    assert graph.report()[1]["expected task"] == "screw (0.90)"
    graph.expect((0.8, 0.2), ahead_s=1.1)
    graph.step()
    assert graph.rejected("stamp_in_future") == 1
    assert graph.report()[1]["expected task"] == "screw (0.90)"
    graph.expect((0.7, 0.3))
    graph.step()
    assert graph.report()[1]["expected task"] == "plate (0.70)"


@pytest.mark.parametrize(("limit", "told"), [(1e-5, True), (10.0, False)])
def test_tasks_whose_ends_are_never_certain_enough_are_told_at_start(harness, path, limit, told):
    graph = AheadGraph(harness, path, max_end_std=limit)
    values = graph.report()[1]
    for task in TASKS:
        key = f"never certain enough: {task} [rad]"
        assert (key in values) == told
        assert not told or float(values[key]) >= 0.0
