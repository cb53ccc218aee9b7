# SPDX-License-Identifier: Apache-2.0
"""Whole turns: what is added is a multiple of 2 pi, and wherever angles were wrapped they agree."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.signals import Demonstration, Signal
from intent_recognition.signals.turns import begin_near, continuous, turn_reference

STAMPS = np.arange(50) * 20_000_000


def wrap(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize(("unit", "size"), [("rad", 1.0), ("deg", np.pi / 180)])
@given(st.floats(-20, 20), st.floats(-12, 12))
def test_a_wrapped_angle_is_what_it_was_but_for_whole_turns(unit, size, start, extent):
    truth = start + extent * np.linspace(0, 1, 50)
    made, names = continuous(Signal(("q",), STAMPS, wrap(truth)[:, None] / size, unit))
    turns = (made.values[:, 0] * size - truth) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns[0]), atol=1e-9)
    assert names == (("q",) if np.ptp(wrap(truth) - truth) > 1 else ())


def test_other_units_and_other_jumps_are_left_alone():
    values = np.r_[np.full(25, 3.1), np.full(25, -3.1)][:, None]
    in_metres = Signal(("x",), STAMPS, values, "m")
    assert continuous(in_metres) == (in_metres, ())
    component = Signal(("v",), STAMPS, 0.7 * values, "rad")  # of a rotation vector, say
    assert continuous(component) == (component, ())


@given(st.lists(st.floats(-1.5, 1.5), min_size=1, max_size=9), st.floats(-3.2, 3.2), st.data())
def test_angles_on_one_half_of_the_circle_come_together(angles, middle, data):
    turns = data.draw(st.lists(st.integers(-2, 2), min_size=len(angles), max_size=len(angles)))
    truth = middle + np.array(angles)
    reference = turn_reference(truth + 2 * np.pi * np.array(turns))
    for angle, turn in zip(truth, turns, strict=True):
        signal = Signal(("q",), STAMPS, np.full((50, 1), angle + 2 * np.pi * turn), "rad")
        (made,) = begin_near((signal,), 0, (reference,))
        apart = made.values[0, 0] - truth
        whole = np.round(apart / (2 * np.pi))
        assert np.ptp(whole) == 0


@pytest.mark.parametrize("wrapped", [True, False])
def test_a_recording_with_jumps_says_so(wrapped):
    times, reach = np.linspace(0, 1, 50), np.linspace(0, 0.5, 50)[:, None] * np.ones(3)
    joint = 2.6 + 1.2 * np.linspace(0, 1, 50)[:, None]
    arguments = (times, reach, wrap(joint) if wrapped else joint)
    if wrapped:
        with pytest.warns(UserWarning, match="robot_0 jumps by 2 pi"):
            made = Demonstration.from_arrays(*arguments)
    else:
        made = Demonstration.from_arrays(*arguments)
    np.testing.assert_allclose(made.controlled[0].values, joint, atol=1e-9)
    assert made.wrapped == (("robot_0",) if wrapped else ())
