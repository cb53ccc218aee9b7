# SPDX-License-Identifier: Apache-2.0
"""The steps of the tab Teach: what is done is ticked, and they name the buttons there are."""

from types import SimpleNamespace

import pytest
import viser
from dashboard.browser import free_port

from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.teach_tab import BY_GOALS, BY_POINTER, TeachTab

TICK = "&#10003;"


@pytest.fixture
def tab():
    server = viser.ViserServer(host="127.0.0.1", port=free_port(), verbose=False)
    teleoperation = SimpleNamespace(
        holds_wrist=True, others_move_wrist=lambda: False, can_move_arm=lambda: True
    )
    session = SimpleNamespace(busy=False, recording=False, recorded=0, learned=False)
    commands = SimpleNamespace(offers=lambda name: True)
    made = TeachTab(server, teleoperation, session, commands, lambda action: action())
    made._task.value = "wave"
    yield made
    server.stop()


def ticks(tab, active=""):
    tab.update(CellState(active=active))
    return tab._hint.content.count(TICK)


def test_the_last_step_is_done_when_the_robot_has_helped(tab):
    session = tab._session
    assert ticks(tab) == ticks(tab, "wave") == 1
    session.recorded = 3
    assert ticks(tab) == 2
    session.recorded, session.learned = 0, True
    assert ticks(tab, "another") == 3
    assert ticks(tab, "wave") == ticks(tab) == len(BY_GOALS)
    session.recorded = 1
    assert ticks(tab) == 1, "another task begins"
    session.recorded = 0
    assert ticks(tab) == 3


def test_the_steps_name_the_buttons(tab):
    labels = [field.label for field in (tab._take, tab._record, tab._learn, tab._reach)]
    labels.append("Stop")
    named = {name for line in (*BY_GOALS, *BY_POINTER) for name in line.split("`")[1::2]}
    assert named == set(labels)
