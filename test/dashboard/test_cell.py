# SPDX-License-Identifier: Apache-2.0
"""What the page remembers is the newest and a bounded past."""

import numpy as np

from intent_recognition.dashboard.cell import (
    PLOTTED_S,
    PLOTTED_STEP_S,
    WRIST_S,
    CellState,
    NodeHealth,
    Posterior,
)


def posterior(*labels, best=0):
    probabilities = np.full(len(labels), 0.1)
    probabilities[best] = 1.0 - 0.1 * (len(labels) - 1)
    return Posterior(labels, probabilities, np.zeros(len(labels)))


def test_an_hour_of_messages_takes_no_more_room_than_a_minute():
    def sizes(seconds):
        state = CellState()
        for k in range(int(seconds * 100)):
            state.take_wrist(np.zeros(3), k * 0.01)
            state.take_posterior(posterior("a", "none"), k * 0.01)
        return len(state._wrist_past), len(state._past)

    assert sizes(60) == sizes(600)


def test_the_past_is_that_of_the_last_seconds_and_ends_now():
    state = CellState()
    for k in range(5000):
        state.take_posterior(posterior("a", "none"), k * 0.01)
        state.take_wrist(np.array([k, 0.0, 0.0]), k * 0.01)
    times, columns = state.posterior_past(50.0)
    assert times[0] >= -PLOTTED_S
    assert times[-1] <= 0.0
    assert np.all(np.diff(times) >= PLOTTED_STEP_S - 1e-9)
    assert set(columns) == {"a", "none"}
    path = state.wrist_path(50.0)
    assert path[0, 0] >= 100 * (50.0 - WRIST_S)
    assert path[-1, 0] == 4999


def test_a_task_that_was_learned_later_has_no_past():
    state = CellState()
    state.take_posterior(posterior("a", "none"), 0.0)
    state.take_posterior(posterior("a", "b", "none", best=1), 1.0)
    _, columns = state.posterior_past(1.0)
    assert np.isnan(columns["b"][0])
    assert columns["b"][1] > 0.5
    assert state.posterior.best == "b"


def test_joint_states_may_come_in_parts():
    state = CellState()
    state.take_joints(["a", "b"], [1.0, 2.0], 5.0)
    state.take_joints(["b"], [3.0], 6.0)
    assert state.joints == {"a": 1.0, "b": 3.0}
    assert (state.joints_at_s(["a", "b"]), state.joints_at_s(["b"])) == (5.0, 6.0)


def test_silence_is_told_after_three_seconds():
    health = NodeHealth(0, "running", {}, 10.0)
    assert health.silent_s(12.0) == 0.0
    assert health.silent_s(15.0) == 5.0


def test_somebody_is_asked_once_a_question_has_stood_for_a_while():
    state = CellState()
    assert state.question(10.0) == ()
    state.take_question(("plate", "screw"), 10.0)
    assert state.question(10.4) == () and state.question(10.5) == ("plate", "screw")
    state.take_question((), 10.6)
    assert state.question(20.0) == ()
