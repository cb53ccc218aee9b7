# SPDX-License-Identifier: Apache-2.0
"""Signals: what they keep and refuse, whole turns of angles, and misspelt labels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulation import START_NS

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.signals import Demonstration, Signal, label_doubts
from intent_recognition.signals.turns import begin_near, continuous, turn_reference


def test_a_signal_copies_and_freezes_its_arrays_and_keeps_nanoseconds():
    stamps, values = np.array([1, 2]), np.zeros((2, 1))
    signal = Signal(("x",), stamps, values, "m")
    stamps[0] = 0
    values[0] = 9.0
    assert signal.stamps_ns.tolist() == [1, 2]
    assert signal.values.tolist() == [[0.0], [0.0]]
    with pytest.raises(ValueError, match="read-only"):
        signal.values[0] = 1.0
    stamps = START_NS + np.array([0, 1, 1_000_000_001])
    signal = Signal(("x",), stamps, np.zeros((3, 1)), "m")
    assert signal.stamps_ns.dtype == np.int64
    np.testing.assert_allclose(signal.seconds(START_NS), [0.0, 1e-9, 1.000000001], rtol=1e-15)
    empty = Signal(("x", "y"), [], np.zeros((0, 2)), "m")
    assert empty.between(0, 10).values.shape == (0, 2)


@given(st.lists(st.integers(1, 100), unique=True), st.integers(0, 101), st.integers(0, 101))
def test_between_keeps_both_ends(stamps, start, end):
    stamps = sorted(stamps)
    signal = Signal(("x",), stamps, np.array(stamps, dtype=float).reshape(-1, 1), "m")
    expected = [stamp for stamp in stamps if start <= stamp <= end]
    assert signal.between(start, end).stamps_ns.tolist() == expected
    assert signal.between(start, end).values[:, 0].tolist() == expected


@pytest.mark.parametrize(
    ("stamps", "values", "error", "words"),
    [
        ([1, 2], np.zeros((2, 2)), ShapeError, r"values: expected shape \(2, 1\).*got \(2, 2\)"),
        ([1, 2], np.zeros(2), ShapeError, r"values: .*got \(2,\).*Stack"),
        ([1, 1], np.zeros((2, 1)), ArgumentError, "stamps_ns: .*got 1 then 1.*duplicates"),
        ([1, 5, 3], np.zeros((3, 1)), ArgumentError, "got 5 then 3"),
        ([1, 2], [[0.0], [np.nan]], ArgumentError, "values: expected finite.*Leave such"),
        ([1, 2], [[0.0], [np.inf]], ArgumentError, "values: expected finite"),
    ],
)
def test_a_signal_says_what_is_wrong(stamps, values, error, words):
    with pytest.raises(error, match=words):
        Signal(("x",), stamps, values, "m")


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


def doubts(rare: str, often: str = "give_cup", n_rare: int = 1, n_often: int = 6) -> list[str]:
    labels = [often] * n_often + [rare] * n_rare
    return [str(found) for found in label_doubts((f"bag_{k}", one) for k, one in enumerate(labels))]


@pytest.mark.parametrize(
    "rare", ["give_cpu", "give_cu", "give_cupp", "give_cap", "Give cup", "GIVE-CUP", "givecup"]
)
def test_a_misspelt_label_is_named(rare):
    said = f"1 with the task {rare}, 6 with give_cup. Did you mean give_cup?"
    assert doubts(rare) == [f"bag_6: {said}"]


@pytest.mark.parametrize(
    ("rare", "often"),
    [
        ("give_plate", "give_cup"),
        ("give_cup2", "give_cup1"),
        ("give_cup_2", "give_cup"),
        ("reach_b", "reach_a"),
        ("a", "b"),
        ("nut", "cut"),
        ("left", "right"),
        ("___", "give_cup"),
    ],
)
def test_another_task_is_not(rare, often):
    assert doubts(rare, often) == []


def test_what_is_frequent_is_no_mistake():
    assert len(doubts("give_cpu", n_rare=2)) == 2
    assert doubts("give_cpu", n_rare=2, n_often=5) == doubts("give_cpu", n_rare=3, n_often=9) == []
    assert label_doubts([("a", None), ("b", "give")]) == label_doubts([]) == []
