# SPDX-License-Identifier: Apache-2.0
"""A plan is changed from the page by the node that holds it, which may refuse; undo, save."""

from types import SimpleNamespace

import numpy as np
import pytest

from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.plan_panel import MUST, NEED_NOT, SAVE, PlanPanel
from intent_recognition.dashboard.widgets import PageAccess
from intent_recognition.errors import ArgumentError
from intent_recognition.plans import WorkPlan, read_plan
from intent_recognition.plans.work_plan import WorkStep

CHAIN = WorkPlan(tuple(WorkStep(n, n, 0.9) for n in "abc"), {("a", "b"): 0.9, ("b", "c"): 0.9})


class Estimator:
    """Takes the parameter as the node does, or refuses."""

    def __init__(self):
        self.state, self.refusal, self.called, self.told = CellState(plan=CHAIN), "", [], []

    def set_parameter(self, node, name, value, done):
        assert (node, name) == ("intent_estimator", "plan")
        if not self.refusal:
            self.state.plan = read_plan(value)
        done(not self.refusal, self.refusal)

    def notify(self, ok, text):
        self.told.append((ok, text))

    def trigger(self, service):
        self.called.append(service)

    def offers(self, service):
        return service == SAVE


@pytest.fixture
def shown(server):
    estimator = Estimator()
    panel = PlanPanel(PageAccess(server, estimator, lambda action: None))

    def press(step, change="", wait="", other=""):
        panel.update(estimator.state)
        panel._step.value = step
        if change:
            panel._change.value = change
            panel._press_change()
        else:
            panel._other.value, panel._wait.value = other, wait
            panel._press_wait()
        panel.update(estimator.state)
        panel.update_controls()
        return estimator.state.plan

    return SimpleNamespace(panel=panel, estimator=estimator, press=press)


def test_steps_are_moved_required_forgotten_and_made_to_wait(shown):
    assert shown.press("c", "Earlier").names == ("a", "c", "b")
    assert shown.press("c", "Later").names == ("a", "b", "c")
    assert shown.press("b", "Require").steps[1].share == 1.0
    assert shown.press("c", wait=NEED_NOT, other="b").before[1, 2] == 0.0
    assert shown.press("c", wait=MUST, other="b").before[1, 2] > 0.99
    assert shown.press("a", "Forget").names == ("b", "c")
    assert shown.panel._step.options == ("b", "c")
    assert [ok for ok, _ in shown.estimator.told] == [True] * 6


def test_each_change_can_be_taken_back_and_a_refused_one_is_none(shown):
    panel, estimator = shown.panel, shown.estimator
    estimator.refusal = "no step of these tasks"
    shown.press("a", "Forget")
    assert estimator.told == [(False, estimator.refusal)] and panel._undo.disabled
    estimator.refusal = ""
    shown.press("a", "Forget")
    shown.press("c", "Require")
    estimator.refusal = "it has not answered the last call yet"
    panel._press_undo()
    estimator.refusal = ""
    for names in (("b", "c"), CHAIN.names, CHAIN.names):
        panel._press_undo()
        assert estimator.state.plan.names == names
    panel.update(estimator.state)
    panel.update_controls()
    assert panel._undo.disabled
    np.testing.assert_allclose(estimator.state.plan.before, CHAIN.before)


def test_what_cannot_be_is_said_and_nothing_is_sent(shown):
    with pytest.raises(ArgumentError, match="another step"):
        shown.press("a", wait=MUST, other="a")
    with pytest.raises(ArgumentError, match="circle"):
        shown.press("a", wait=MUST, other="c")
    shown.panel._step.value = "no step any more"
    with pytest.raises(ArgumentError, match="it has changed"):
        shown.panel._press_change()
    assert not shown.estimator.told


def test_without_a_plan_there_is_no_folder_and_nothing_is_done(shown):
    shown.estimator.state.plan = None
    shown.press("a", "Forget")
    shown.press("a", wait=MUST, other="b")
    assert not shown.panel._folder.visible and not shown.estimator.told
