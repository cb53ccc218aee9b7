# SPDX-License-Identifier: Apache-2.0
"""A person who holds the arm is yielded to, and goes on with what was corrected."""

from dataclasses import replace

import numpy as np
import pytest
from activation_world import DURATION_S, GOALS, HOME, World, prediction
from simulation import make_library

from intent_recognition.activation.states import Mode
from intent_recognition.motion import Correction, DeviationDetector, Spread

AWAY = np.array([0.1, 0.0, -0.05, 0.0, 0.0, 0.0, 0.0])
DETECTOR = DeviationDetector(np.zeros((3, 7)), np.full(7, 1e-3), 0.5, 0.05)
LIBRARY = make_library(np.random.default_rng(0), n_controlled=7)
SPREADS = {"plate": Spread.given_person(LIBRARY.primitive(0))}


class Held(World):
    """An arm that a person may hold somewhere: it is there, whatever is asked of it."""

    held: np.ndarray | None = None

    def arm(self):
        return super().arm() if self.held is None else self.held


def world(**settings):
    chosen = {"correction": Correction(DETECTOR, SPREADS), "hold_s": 9.0} | settings
    held = Held(**chosen)
    held.shift = 0.0
    held.rng = type("Still", (), {"normal": lambda *_: 0.0})()
    held.serve("plate")
    return held


def hold(held, offset, seconds):
    """Hold the arm this far from where it is, then let go."""
    held.held = held.arm() + offset
    held.run(seconds)
    held.held = None


@pytest.mark.slow
def test_where_the_arm_is_left_becomes_the_end_and_nothing_jumps():
    held = world()
    held.run(DURATION_S + 0.5)
    before = held.arm().copy()
    hold(held, AWAY, 2.0)
    held.run(0.5)
    activation = held.activation
    assert Mode.YIELDING in held.modes and activation.counts["corrected"] == 1
    np.testing.assert_allclose(held.arm(), before + AWAY, atol=5e-3)
    np.testing.assert_allclose(
        activation.motions.corrected.path.spline(1.0), before + AWAY, atol=5e-3
    )
    held.check_continuous()
    held.task = "idle"
    held.run_until(Mode.HOMING)
    held.serve("plate")
    held.run(DURATION_S)
    assert activation.motions.corrected is None  # of the next interaction
    np.testing.assert_allclose(held.arm(), HOME + GOALS["plate"], atol=1e-3)


def test_the_reference_of_a_held_arm_keeps_the_distance_that_the_controller_explains():
    """Then an arm that sinks under its load by so much does not sink further and further."""
    detector = replace(DETECTOR, explained=np.full(7, 0.02))
    held = world(correction=Correction(detector, SPREADS))
    held.run(DURATION_S + 0.5)
    held.held = held.arm() + AWAY
    held.run(2.0)
    assert held.activation.mode is Mode.YIELDING
    short = held.held - held.commands[-1].at(held.now_ns).position
    np.testing.assert_allclose(short[[0, 2]], 0.02 * np.sign(AWAY[[0, 2]]), atol=1e-3)


def test_an_arm_that_is_led_is_followed_as_often_as_plans_are_updated_and_keep_limits(monkeypatch):
    held = world()
    held.run(DURATION_S + 0.5)
    hold(held, AWAY, 1.0)
    before, held.held = len(held.commands), held.arm()
    for _ in range(50):
        held.held = held.held + 0.02 * AWAY
        held.run(0.02)
    assert held.activation.mode is Mode.YIELDING
    assert 20 <= len(held.commands) - before <= 26  # in a second
    monkeypatch.setattr("intent_recognition.activation.motions.posture_plan", lambda *_: None)
    before, held.held = len(held.commands), held.held + AWAY
    held.run(0.1)
    assert held.activation.mode is Mode.YIELDING and len(held.commands) == before


@pytest.mark.slow
def test_an_arm_left_on_its_way_goes_on_from_there():
    held = world()
    held.run(0.3)
    done = held.commands[-1].phase_at(held.now_ns)[0]
    hold(held, AWAY, 1.2)
    held.run_until(Mode.EXECUTING)
    assert held.activation.counts["corrected"] == 1
    assert held.commands[-1].phase_at(held.now_ns)[0] >= done
    held.run(3.0)
    held.check_continuous()
    expected = held.activation.motions.corrected.path.spline(1.0)
    np.testing.assert_allclose(held.arm(), expected, atol=1e-6)


@pytest.mark.parametrize("offset, seconds", [(AWAY, 0.4), (6.0 * AWAY, 0.15)])
def test_bumps_change_nothing_that_lasts(offset, seconds):
    """The second is off by more than the arm may be: it yields at once, and goes on as before."""
    held = world()
    held.run(DURATION_S + 0.3)
    hold(held, offset, seconds)
    held.run(1.5)
    counts = held.activation.counts
    assert counts["corrected"] == 0 and counts["yielded"] == (np.abs(offset).max() > 0.4)
    assert held.activation.mode is Mode.EXECUTING
    np.testing.assert_allclose(held.arm(), HOME + GOALS["plate"], atol=1e-3)
    held.check_continuous()


def test_an_unknown_task_yields_and_goes_on_and_without_corrections_a_push_is_no_wish():
    held = world(correction=Correction(DETECTOR, {}))
    held.run(DURATION_S)
    hold(held, AWAY, 1.5)
    held.run(1.5)
    assert held.activation.counts["yielded"] == 1 and held.activation.motions.corrected is None
    np.testing.assert_allclose(held.arm(), HOME + GOALS["plate"], atol=1e-3)
    held = world(correction=None)
    held.run(DURATION_S)
    hold(held, AWAY, 1.0)
    held.run(0.5)
    assert Mode.YIELDING not in held.modes
    np.testing.assert_allclose(held.arm(), HOME + GOALS["plate"], atol=1e-3)


def test_the_arm_does_not_go_home_while_somebody_holds_it_and_can_be_called_back():
    held = world(hold_s=0.3)
    while held.commands[-1].phase_at(held.now_ns)[0] < 1.0:
        held.step()
    held.held = held.arm() + AWAY
    held.run(0.45)
    assert held.activation.mode is Mode.EXECUTING
    held.run(0.15)
    assert held.activation.mode is Mode.YIELDING
    held.activation.reset(held.now_ns)
    assert held.activation.mode is Mode.HOMING


def test_an_arm_that_was_moved_and_has_no_other_task_to_begin_is_not_pushed_any_more():
    """Of where it was moved to nothing was asked."""
    held = world()
    held.run(4.0)
    held.task = "idle"
    held.run(1.0)
    held.activation.motions.interact = lambda *_: None  # no plan keeps the limits
    held.begin("screw", already_s=0.2)
    held.held = held.arm() + 2.0 * AWAY
    held.run(1.0)
    assert held.activation.mode is Mode.EXECUTING
    held.task, held.held = "idle", None
    held.run_until(Mode.IDLE)
    np.testing.assert_allclose(held.commands[-1].plan.end, HOME, atol=1e-6)


def test_an_ordered_task_goes_on_by_what_is_recognised_alone():
    """Somebody bumps into it while a movement of the same task is predicted, but not active."""
    held = world()
    held.activation.reset(held.now_ns)
    held.task = "idle"
    held.run_until(Mode.IDLE)
    ordered = prediction("plate", 0, duration_s=4.0)
    held.activation.inbox.order(ordered)
    held.run(0.2)
    held.task = "none"
    held.run(0.3)
    held.activation.take_prediction(held.now_ns, prediction("plate", held.now_ns, 0.3))
    hold(held, 6.0 * AWAY, 0.15)
    held.run_until(Mode.EXECUTING)
    held.run(5.0)
    assert held.activation.counts["yielded"] == 1 and held.activation.active_task == "plate"
    np.testing.assert_allclose(held.arm(), ordered.path.spline(1.0), atol=1e-3)
