# SPDX-License-Identifier: Apache-2.0
"""What the page remembers is the newest and a bounded past."""

import numpy as np

from intent_recognition.dashboard.cell import (
    FORCES,
    PLOTTED_S,
    PLOTTED_STEP_S,
    SENSOR,
    WRIST_S,
    CellState,
    NodeHealth,
    PersonState,
    Posterior,
    TransferState,
)


def posterior(*labels, best=0):
    probabilities = np.full(len(labels), 0.1)
    probabilities[best] = 1.0 - 0.1 * (len(labels) - 1)
    return Posterior(labels, probabilities, np.zeros(len(labels)))


def test_an_hour_of_messages_takes_no_more_room_than_a_minute():
    def sizes(seconds):
        state = CellState()
        person, transfer = state.person, state.transfer
        for k in range(int(seconds * 100)):
            person.take_wrist(np.zeros(3), k * 0.01)
            person.take_posterior(posterior("a", "none"), k * 0.01)
            transfer.take_sensor(1.0, k * 0.01)
        return len(person._wrist_past), len(person.past), len(transfer.forces)

    assert sizes(60) == sizes(600)


def test_the_past_is_that_of_the_last_seconds_and_ends_now():
    person = PersonState()
    for k in range(5000):
        person.take_posterior(posterior("a", "none"), k * 0.01)
        person.take_wrist(np.array([k, 0.0, 0.0]), k * 0.01)
    times, a, none = person.past.columns(("a", "none"), 50.0)
    assert times[0] >= -PLOTTED_S
    assert times[-1] <= 0.0
    assert np.all(np.diff(times) >= PLOTTED_STEP_S - 1e-9)
    np.testing.assert_allclose(a + none, 1.0)
    path = person.wrist_path(50.0)
    assert path[0, 0] >= 100 * (50.0 - WRIST_S)
    assert path[-1, 0] == 4999


def test_a_task_that_was_learned_later_has_no_past():
    person = PersonState()
    person.take_posterior(posterior("a", "none"), 0.0)
    person.take_posterior(posterior("a", "b", "none", best=1), 1.0)
    _, b = person.past.columns(("b",), 1.0)
    assert np.isnan(b[0])
    assert b[1] > 0.5
    assert person.posterior.best == "b"


def test_the_person_is_whom_the_arm_helps_or_the_first_one():
    state = CellState()
    only, anna = state.person, PersonState()
    state.people["anna"] = anna
    assert state.person is only
    state.helped = "anna"
    assert state.person is anna
    state.helped = "nobody known"
    assert state.person is only


def test_forces_are_named_while_there_are_any_in_the_plotted_time():
    transfer = TransferState()
    assert transfer.names(0.0) == () and transfer.newest("load") is None
    transfer.take_sensor(5.0, 0.0)
    assert transfer.names(1.0) == (SENSOR,)
    felt = {"load": 4.0, "weight": 3.9, "grip_force": 12.0, "load_share": 0.5, "slip": 0.0}
    transfer.take("offering", felt, 0.5)
    transfer.take("offering", felt, 5.0)  # the sensor is silent since
    times, load, sensor = transfer.forces.columns(("load", SENSOR), 5.0)
    np.testing.assert_array_equal(times, [-5.0, -4.5, 0.0])
    np.testing.assert_array_equal(load, [np.nan, 4.0, 4.0])
    np.testing.assert_array_equal(sensor, [5.0, 5.0, np.nan])
    assert transfer.names(5.0 + PLOTTED_S) == FORCES
    assert transfer.names(6.0 + PLOTTED_S) == ()


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
