# SPDX-License-Identifier: Apache-2.0
"""The steps of the tab Teach: what is done is ticked, and they name the buttons there are."""

from types import SimpleNamespace

import numpy as np
import pytest

from intent_recognition.dashboard.cell import CellState, NodeHealth
from intent_recognition.dashboard.teach_tab import BY_GOALS, BY_HAND, BY_POINTER, TeachTab
from intent_recognition.dashboard.teaching_session import TeachingSession
from intent_recognition.dashboard.widgets import PageAccess
from intent_recognition.model import WAITING

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
    """Answers what is asked of the teacher and the activation; refuses one of it."""

    def __init__(self, refused="", activation=True, helping=True):
        self.asked, self.said, self.helping = [], [], helping
        self._refused, self.can_switch_help = refused, lambda: activation
        self.notify = lambda *what: self.said.append(what)

    def _answer(self, asked, done):
        self.asked.append(asked)
        done(asked != self._refused, asked)

    def trigger(self, service, done):
        self._answer(service.removeprefix("task_teacher/"), done)

    def set_parameter(self, node, name, value, done):
        self._answer(name, done)

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
