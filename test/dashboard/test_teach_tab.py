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
    commands = SimpleNamespace(offers=lambda name: True, notify=None)
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


@pytest.mark.parametrize("by_hand", [True, False])
def test_discarding_lets_go_on(by_hand):
    said, asked = [], []

    def trigger(service, done):
        asked.append(service)
        done(True, "kept aside")

    commands = SimpleNamespace(trigger=trigger, notify=lambda *what: said.append(what))
    session = TeachingSession(None, commands, None)
    session.busy = session.recording = by_hand
    session.discard()
    assert asked == ["task_teacher/discard"] and said == [(True, "kept aside")]
    assert not session.busy and not session.recording


def test_the_steps_name_the_buttons(tab):
    labels = [field.label for field in (tab._take, tab._record, tab._learn, tab._reach)]
    labels.append("Stop")
    named = {name for line in (*BY_GOALS, *BY_POINTER) for name in line.split("`")[1::2]}
    assert named == set(labels)
