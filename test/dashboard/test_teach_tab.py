# SPDX-License-Identifier: Apache-2.0
"""The tab Teach, via points and the plan: steps, buttons, and what they ask for."""

import asyncio
from types import SimpleNamespace

import numpy as np
import pytest

from intent_recognition.composing import ViaPoint, read_via_points
from intent_recognition.dashboard.cell import CellState, NodeHealth
from intent_recognition.dashboard.plan_panel import MUST, NEED_NOT, SAVE, PlanPanel
from intent_recognition.dashboard.teach_tab import BY_GOALS, BY_HAND, BY_POINTER, TeachTab
from intent_recognition.dashboard.teaching_session import TeachingSession
from intent_recognition.dashboard.via_controls import ViaPointControls
from intent_recognition.dashboard.widgets import PageAccess
from intent_recognition.errors import ArgumentError
from intent_recognition.model import WAITING
from intent_recognition.plans import WorkPlan, read_plan
from intent_recognition.plans.work_plan import WorkStep

TICK = "&#10003;"


def state(waiting=0, **known):
    health = NodeHealth(0, "idle", {WAITING: str(waiting)}, 0.0)
    return CellState(nodes={"task_teacher": health}, **known)


@pytest.fixture
def tab(server):
    teleoperation = SimpleNamespace(
        holds_wrist=True,
        position=np.zeros(3),
        hand=lambda: np.zeros(3),
        others_move_wrist=lambda: False,
        can_move_arm=lambda: True,
    )
    commands = SimpleNamespace(offers=lambda name: True, notify=None, trigger=print)
    session = TeachingSession(teleoperation, commands, None)
    made = TeachTab(PageAccess(server, commands, lambda do: do()), teleoperation, session)
    made._task.value = "wave"
    return made


def ticks(tab, active="", *, waiting=0):
    tab.update(state(waiting, active=active))
    return tab._hint.content.count(TICK)


def test_the_last_step_is_done_when_the_robot_has_helped(tab):
    session = tab._session
    assert ticks(tab) == ticks(tab, "wave") == 1
    assert ticks(tab, waiting=3) == 2
    session.learned = True
    assert ticks(tab, "another") == 3
    assert ticks(tab, "wave") == ticks(tab) == len(BY_GOALS)
    assert ticks(tab, waiting=1) == 1, "another task begins"
    assert ticks(tab) == 3


def test_what_waits_or_is_recorded_by_hand_can_be_discarded(tab):
    session = tab._session
    tab.update(state())
    assert tab._discard.disabled and tab._learn.label == "Learn"
    tab.update(state(1))
    assert not tab._discard.disabled and tab._learn.label == "Learn (1)"
    session.busy = True
    tab.update(state(1))
    assert tab._discard.disabled
    session.recording, tab._how.value = True, BY_HAND
    tab.update(state())
    assert not tab._discard.disabled


class Graph:
    """Answers what is asked of other nodes; refuses one of it."""

    def __init__(self, refused="", activation=True, helping=True):
        self.asked, self.said, self.set, self.helping = [], [], {}, helping
        self.refused, self.can_switch_help = refused, lambda: activation
        self.notify = lambda *what: self.said.append(what)

    def _answer(self, asked, done):
        self.asked.append(asked)
        done(asked != self.refused, asked)

    def trigger(self, service, done):
        self._answer(service.removeprefix("task_teacher/"), done)

    def set_parameter(self, node, name, value, done=lambda *_: None):
        if name != self.refused:
            self.set[node, name] = value
        self._answer(name, done)

    def offers(self, service):
        return service == SAVE

    def robot_helps(self, enabled, done):
        self._answer(f"help {enabled}", done)
        self.helping = enabled


def teaching(graph, dragged=()):
    teleoperation = SimpleNamespace(holds_wrist=True, drag_hand=lambda to: dragged.append(to))
    return TeachingSession(teleoperation, graph, None)


OFF, ON = "help False", "help True"
STEPS = [OFF, "learn_at_stop", "task", "start"]


@pytest.mark.parametrize("refused", STEPS)
def test_nothing_is_recorded_unless_all_went_well_and_the_robot_helps_again(refused):
    session = teaching(graph := Graph(refused))
    session.start_by_hand("wave")
    assert graph.asked == [*STEPS[: STEPS.index(refused) + 1], ON]
    assert graph.said == [(False, refused)]
    assert not session.busy and not session.recording


@pytest.mark.parametrize("end", ["discard", "learn"])
@pytest.mark.parametrize("refused", ["", "discard", "learn"])
def test_the_robot_helps_again_at_every_end(end, refused):
    dragged = []
    session = teaching(graph := Graph(refused), dragged)
    session.drag_hand(1)
    session.start_by_hand("wave")
    session.drag_hand(2)
    assert dragged == [2] and session.recording
    session.stop_by_hand()
    session.start_by_hand("wave")
    session.stop_by_hand()
    getattr(session, end)()
    assert graph.asked == [*STEPS, "stop", *STEPS, "stop", end, ON]
    assert graph.said[-1] == (end != refused, end)
    assert not session.busy and not session.recording


@pytest.mark.parametrize("graph", [Graph(activation=False), Graph(helping=False)])
def test_a_robot_that_did_not_help_is_left_alone(graph):
    session = teaching(graph, dragged := [])
    session.drag_hand(1)
    session.start_by_hand("wave")
    assert dragged == [1] and session.recording
    session.discard()
    assert graph.asked[-2:] == ["start", "discard"]
    assert graph.said[-1] == (True, "discard") and not session.recording


def test_the_steps_name_the_buttons(tab):
    labels = [field.label for field in (tab._take, tab._record, tab._learn, tab._reach)]
    labels.append("Stop")
    named = {name for line in (*BY_GOALS, *BY_POINTER) for name in line.split("`")[1::2]}
    assert named == set(labels)


PATH = ("plate", np.outer(np.linspace(0.0, 1.0, 5), [0.4, 0.2, 0.1]))


@pytest.fixture
def controls(server, monkeypatch):
    graph = Graph()
    monkeypatch.setattr(server, "get_clients", lambda: {0: None})
    made = ViaPointControls(PageAccess(server, graph, lambda action: action()))
    points = lambda: read_via_points(graph.set.get(("intent_estimator", "via_points"), ""))  # noqa: E731
    return SimpleNamespace(made=made, points=points, handle=made._handle)


def drag(controls, place, phase):
    event = SimpleNamespace(phase=phase, target=SimpleNamespace(position=place), client_id=0)
    asyncio.run(controls.made._dragged._update(event))


def test_what_is_dropped_passes_there_until_it_is_removed(controls):
    made, points = controls.made, controls.points
    made.update((), PATH)
    assert not controls.handle.visible, "it is shown on demand"
    made._drag.value = True
    made.update((), PATH)
    np.testing.assert_allclose(controls.handle.position, [0.2, 0.1, 0.05])
    drag(controls, (0.25, 0.1, 0.05), "start")
    made.update((), (PATH[0], PATH[1] + 1.0))
    np.testing.assert_allclose(controls.handle.position, [0.2, 0.1, 0.05], err_msg="it is held")
    assert points() == ()
    drag(controls, (0.25, 0.1, 0.05), "end")
    expected = ViaPoint("page 1", {"hand": (0.25, 0.1, 0.05)}, (0.01,) * 3, 0.5, None, "plate")
    assert points() == (expected,)
    made.update(points(), PATH)
    np.testing.assert_allclose(controls.handle.position, [0.2, 0.1, 0.05])
    drag(controls, (0.3, 0.0, 0.0), "end")
    made.update(points(), PATH)
    assert made._chosen.options == ("page 1", "page 2") and made._chosen.value == "page 2"
    made._chosen.value = "page 1"
    made.remove()
    made.update(points(), PATH)
    assert [point.name for point in points()] == ["page 2"]
    made.remove()
    made.update(points(), PATH)
    assert made._remove.disabled and points() == ()


def test_before_a_prediction_there_is_nothing_to_drag(controls):
    controls.made._drag.value = True
    controls.made.update((), None)
    drag(controls, (0.3, 0.0, 0.0), "end")
    assert not controls.handle.visible and controls.points() == ()


CHAIN = WorkPlan(tuple(WorkStep(n, n, 0.9) for n in "abc"), {("a", "b"): 0.9, ("b", "c"): 0.9})


@pytest.fixture
def shown(server):
    """A panel of a plan that is in force as it was set, and how it is pressed."""
    graph, state = Graph(), CellState(plan=CHAIN)
    panel = PlanPanel(PageAccess(server, graph, lambda action: None))
    panel.update(state)

    def plan():
        if text := graph.set.get(("intent_estimator", "plan")):
            state.plan = read_plan(text)
        panel.update(state)
        panel.update_controls()
        return state.plan

    def press(step, change="", wait="", other=""):
        panel._step.value = step
        if change:
            panel._change.value = change
            panel._press_change()
        else:
            panel._other.value, panel._wait.value = other, wait
            panel._press_wait()
        return plan()

    return SimpleNamespace(panel=panel, graph=graph, press=press, plan=plan, state=state)


def test_steps_are_moved_required_forgotten_and_made_to_wait(shown):
    assert shown.press("c", "Earlier").names == ("a", "c", "b")
    assert shown.press("c", "Later").names == ("a", "b", "c")
    assert shown.press("b", "Require").steps[1].share == 1.0
    assert shown.press("c", wait=NEED_NOT, other="b").before[1, 2] == 0.0
    assert shown.press("c", wait=MUST, other="b").before[1, 2] > 0.99
    assert shown.press("a", "Forget").names == ("b", "c")
    assert shown.panel._step.options == ("b", "c")
    assert shown.panel._step.value == "c"  # the last one, since what was chosen is gone
    assert [ok for ok, _ in shown.graph.said] == [True] * 6


def test_each_change_can_be_taken_back_and_a_refused_one_is_none(shown):
    panel, graph = shown.panel, shown.graph
    graph.refused = "plan"
    shown.press("a", "Forget")
    assert graph.said == [(False, "plan")] and panel._undo.disabled
    graph.refused = ""
    shown.press("a", "Forget")
    shown.press("c", "Require")
    graph.refused = "plan"
    panel._press_undo()
    graph.refused = ""
    for names in (("b", "c"), CHAIN.names, CHAIN.names):
        panel._press_undo()
        assert shown.plan().names == names
    assert panel._undo.disabled
    np.testing.assert_allclose(shown.plan().before, CHAIN.before)


def test_what_cannot_be_is_said_and_nothing_is_sent(shown):
    with pytest.raises(ArgumentError, match="another step"):
        shown.press("a", wait=MUST, other="a")
    with pytest.raises(ArgumentError, match="circle"):
        shown.press("a", wait=MUST, other="c")
    shown.panel._step.value = "no step any more"
    with pytest.raises(ArgumentError, match="it has changed"):
        shown.panel._press_change()
    assert not shown.graph.asked


def test_without_a_plan_there_is_no_folder_and_nothing_is_done(shown):
    shown.state.plan = None
    shown.plan()
    shown.press("a", "Forget")
    shown.press("a", wait=MUST, other="b")
    assert not shown.panel._folder.visible and not shown.graph.asked
