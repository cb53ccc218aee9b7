# SPDX-License-Identifier: Apache-2.0
"""Demonstrations made of arrays."""

import warnings
from datetime import datetime, timedelta

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.learning.examples import make_example
from intent_recognition.promp import NormalizedRBFBasis
from intent_recognition.signals.demonstration import Demonstration

TIMES_S = np.linspace(0.0, 1.0, 11)
HUMAN = np.stack([TIMES_S, TIMES_S**2], axis=1)
ROBOT = np.cos(TIMES_S)[:, None]
LONG_S = np.linspace(0.0, 2.0, 101)


def test_arrays_become_one_signal_per_agent_and_one_line():
    made = Demonstration.from_arrays(TIMES_S, HUMAN, ROBOT, task="reach", observed_names=("x", "y"))
    (human,), (robot,) = made.observed, made.controlled
    assert (human.names, human.unit) == (("x", "y"), "m")
    assert (robot.names, robot.unit) == (("robot_0",), "rad")
    assert np.array_equal(human.values, HUMAN) and np.array_equal(robot.values, ROBOT)
    assert np.allclose(human.seconds(made.start_ns), TIMES_S, rtol=0, atol=1e-9)
    assert (made.task, made.duration_s) == ("reach", 1.0)
    made = Demonstration.from_arrays(TIMES_S, HUMAN, ROBOT, group="anna")
    assert make_example(made, NormalizedRBFBasis(4), ridge=1e-3).group == "anna"
    assert not Demonstration.from_arrays(TIMES_S, HUMAN, ROBOT).metadata
    made = Demonstration.from_arrays(TIMES_S, HUMAN, ROBOT[::2], robot_times_s=TIMES_S[::2] + 0.01)
    assert len(made.controlled[0].stamps_ns) == 6
    assert (made.start_ns, made.end_ns) == (0, 1_000_000_000)
    shown = repr(Demonstration.from_arrays(TIMES_S, HUMAN, ROBOT, task="reach", name="first"))
    assert shown == (
        "<Demonstration 'first': task 'reach', 1.00 s, 2 observed and 1 controlled DOFs>"
    )


def test_rows_that_were_not_measured_or_are_masked_are_left_out():
    human = HUMAN.copy()
    human[[0, 4]] = np.nan
    made = Demonstration.from_arrays(TIMES_S, human, ROBOT)
    assert np.array_equal(made.observed[0].values, np.delete(HUMAN, [0, 4], axis=0))
    assert made.start_ns == 100_000_000
    assert len(made.controlled[0].stamps_ns) == 11
    human = np.ma.masked_array(HUMAN, mask=np.isin(TIMES_S, TIMES_S[[0, 4]])[:, None] | (HUMAN < 0))
    made = Demonstration.from_arrays(TIMES_S, human, ROBOT)
    assert np.array_equal(made.observed[0].values, np.delete(HUMAN, [0, 4], axis=0))


@pytest.mark.parametrize(
    ("times_s", "human", "robot", "options", "error", "says"),
    [
        (TIMES_S, HUMAN[:-1], ROBOT, {}, ShapeError, "human: expected shape"),
        (TIMES_S, HUMAN[:, 0], ROBOT, {}, ShapeError, "human: expected shape"),
        (TIMES_S, HUMAN, ROBOT[:-1], {}, ShapeError, "robot: expected shape .* robot_times_s"),
        (
            TIMES_S,
            HUMAN,
            ROBOT,
            {"robot_times_s": TIMES_S[1:]},
            ShapeError,
            "each of 10 times, .* Pass one row per time and one column",
        ),
        (TIMES_S, HUMAN, ROBOT, {"group": 0}, ArgumentError, "group: expected a str, got"),
        (TIMES_S, HUMAN, ROBOT, {"name": 7}, ArgumentError, r"name: .* Pass a name, such as str"),
        ([], [], [], {}, ArgumentError, "times_s: expected at least 4 times, got none"),
        (TIMES_S, HUMAN, ROBOT[:, 0], {}, ShapeError, r"robot\[:, None\] for one joint"),
        (TIMES_S, HUMAN, [], {}, ShapeError, r"numpy.empty\(\(T, 0\)\) without a robot"),
        (TIMES_S, HUMAN, None, {}, ShapeError, r"numpy.empty\(\(T, 0\)\) without a robot"),
        (TIMES_S, HUMAN.T, ROBOT, {}, ShapeError, "Pass it transposed: human.T"),
        (TIMES_S, HUMAN[:, 0], ROBOT, {}, ShapeError, r"Pass human\[:, None\] for one DOF"),
        (TIMES_S, HUMAN + 1j, ROBOT, {}, ShapeError, "human: .*complex numbers"),
        (TIMES_S, HUMAN, ROBOT, {"observed_unit": "Meters"}, ArgumentError, "Write 'm'"),
        (TIMES_S, HUMAN, ROBOT, {"controlled_unit": "degrees"}, ArgumentError, "Write 'deg'"),
        (TIMES_S[:, None], HUMAN, ROBOT, {}, ShapeError, "times_s: expected shape"),
        (TIMES_S, "abc", ROBOT, {}, ShapeError, "human: expected an array of numbers"),
        (TIMES_S, [[0.0], [0.0, 1.0]], ROBOT, {}, ShapeError, "human: expected an array"),
        (TIMES_S, HUMAN, ROBOT, {"observed_names": ("x",)}, ShapeError, "observed_names"),
        (TIMES_S, HUMAN, ROBOT, {"observed_names": ("x", "x")}, ArgumentError, "2 different texts"),
        (TIMES_S, HUMAN, ROBOT, {"observed_names": (1, 2)}, ArgumentError, r"got \[1, 2\]"),
        (TIMES_S[::-1], HUMAN, ROBOT, {}, ArgumentError, "got 0.9 after 1 in row 1"),
        (np.full(11, np.nan), HUMAN, ROBOT, {}, ArgumentError, "got nan in row 0"),
        (TIMES_S * 1e9 + 1.7e18, HUMAN, ROBOT, {}, ArgumentError, "Likely nanoseconds since 1970"),
        (TIMES_S, HUMAN, ROBOT, {"controlled_unit": 3}, ArgumentError, "controlled_unit"),
        (TIMES_S, HUMAN, ROBOT, {"task": "none"}, ArgumentError, "task: expected a label"),
        (TIMES_S, HUMAN, ROBOT, {"task": "a/b"}, ArgumentError, "task: expected a label"),
        (TIMES_S, HUMAN, ROBOT, {"task": 3}, ArgumentError, "got 3"),
        (["10:00:00"] * 11, HUMAN, ROBOT, {}, ShapeError, "Pass seconds as numbers, or datetime64"),
        (TIMES_S * 1e-11, HUMAN, ROBOT, {}, ArgumentError, "stamps_ns"),
        (TIMES_S[:3], HUMAN[:3], ROBOT[:3], {}, ArgumentError, "at least 4 samples"),
        (TIMES_S, np.full_like(HUMAN, np.nan), ROBOT, {}, ArgumentError, "at least 4 samples"),
        (TIMES_S, HUMAN, np.full_like(ROBOT, np.inf), {}, ArgumentError, "robot: expected finite"),
    ],
)
def test_what_no_demonstration_can_be_made_of(times_s, human, robot, options, error, says):
    with pytest.raises(error, match=says):
        Demonstration.from_arrays(times_s, human, robot, **options)


def reach(share: float = 1.0) -> np.ndarray:
    """A column that moves within so much of the time and then rests."""
    way = np.clip((LONG_S - 0.4) / share, 0.0, 1.0)[:, None]
    return 0.4 * way**3 * (10.0 - 15.0 * way + 6.0 * way**2)


@pytest.mark.parametrize(
    ("human", "robot", "options", "says"),
    [
        (
            1000.0 * reach(),
            reach(),
            {},
            "first: human_0 moves over 400 m at .* metres. Likely mill.* as observed_unit",
        ),
        (reach(), reach()[:40], {"robot_times_s": LONG_S[:40]}, "robot_0 covers 39% of the"),
    ],
)
def test_what_no_recording_could_be_learned_from_is_refused_as_in_bags(human, robot, options, says):
    with pytest.raises(ArgumentError, match=says):
        Demonstration.from_arrays(LONG_S, human, robot, name="first", **options)


@pytest.mark.parametrize(
    ("human", "robot", "says"),
    [
        (0.0 * reach(), reach(), "first: the observed agent does not move"),
        (reach(), np.degrees(reach()) * 2.0, "first: robot_0: Likely deg.* as controlled_unit"),
        (reach(), 68 + np.degrees(reach()) * 0.1, "first: robot_0: Likely deg.* controlled_unit"),
    ],
)
def test_what_gives_reason_to_doubt_in_bags_is_a_warning(human, robot, says):
    with pytest.warns(UserWarning, match=says):
        Demonstration.from_arrays(LONG_S, human, robot, name="first")


def test_many_recordings_of_one_fault_are_one_warning():
    with pytest.warns(UserWarning) as told:
        warnings.simplefilter("default")
        for turns in (2.0, 2.1, 2.2):
            Demonstration.from_arrays(LONG_S, reach(), np.degrees(reach()) * turns)
    assert len(told) == 1


def test_the_human_may_be_alone_but_not_missing_nor_measured_in_part():
    alone = Demonstration.from_arrays(LONG_S, reach(), np.empty((101, 0)))
    assert alone.controlled == ()
    with pytest.raises(ShapeError, match=r"human: expected at least one column, got \(101, 0\)"):
        Demonstration.from_arrays(LONG_S, np.empty((101, 0)), reach())
    human = HUMAN.copy()
    human[3, 1] = np.nan
    with pytest.raises(ArgumentError, match=r"column 1 at 0\.3 s"):
        Demonstration.from_arrays(TIMES_S, human, ROBOT)


class Foreign:
    """An array of another library, which numpy takes in that library's way alone."""

    def __init__(self, values, error):
        self._values, self._error = values, error

    def __array__(self, dtype=None, copy=None):
        if dtype is not None or isinstance(self._error, RuntimeError):
            raise self._error
        return self._values.astype(object)

    def to_numpy(self, dtype, na_value):
        """As of pandas, whose nullable columns hold objects that are no numbers."""
        return np.where(np.equal(self._values, None), na_value, self._values).astype(dtype)


def test_arrays_of_other_libraries_are_taken_or_refused_with_their_words():
    human = np.where((TIMES_S == 0.0)[:, None], None, HUMAN)
    missing = Foreign(human, TypeError("float() argument must be a number, not 'NAType'"))
    made = Demonstration.from_arrays(TIMES_S, missing, ROBOT)
    assert np.array_equal(made.observed[0].values, HUMAN[1:])
    tensor = Foreign(HUMAN, RuntimeError("Use tensor.detach().numpy() instead."))
    del Foreign.to_numpy
    for arrays in ((TIMES_S, tensor, ROBOT), (tensor, HUMAN, ROBOT)):
        with pytest.raises(ShapeError, match=r"expected an array of numbers, .*detach"):
            Demonstration.from_arrays(*arrays)


@pytest.mark.filterwarnings("ignore:the observed movement")
def test_zeros_for_nothing_and_samples_far_away_are_named():
    place = np.hstack([reach(), 0.3 + reach(), 0.8 - reach()])
    for number, word in ((0.0, "zero"), (0.05, "0.05")):
        lost = place.copy()
        lost[60:65] = number
        with pytest.warns(UserWarning, match=f"is at exactly {word} in 5 of 101 samples"):
            Demonstration.from_arrays(LONG_S, lost, reach())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Demonstration.from_arrays(LONG_S, place - place[0], reach())  # a rest at the origin
    for first, n, far in ((50, 1, 40.0), (40, 30, 0.8)):
        human = np.hstack([reach(), reach()])
        human[first : first + n] += far
        with pytest.raises(ArgumentError, match=f"m from .* in {n} of 101 .* error") as told:
            Demonstration.from_arrays(LONG_S, human, reach())
        assert "metres for" not in str(told.value) and "for metres" not in str(told.value)
    human = np.hstack([reach(), reach()])
    human[60:] += 0.8  # steps away and stays, as a set point may
    with pytest.warns(UserWarning, match="Likely centimetres for metres"):
        Demonstration.from_arrays(LONG_S, human, reach())


def test_dates_and_durations_are_times_in_utc_where_they_have_no_zone():
    first = datetime(2024, 1, 31, 10)
    times = [first + timedelta(seconds=second) for second in TIMES_S.tolist()]
    made = Demonstration.from_arrays(times, HUMAN, ROBOT)
    assert made.start_ns == 1_706_695_200_000_000_000 and made.duration_s == 1.0
    in_ns = np.round(TIMES_S * 1e9).astype(np.int64)
    for lengths in ([one - first for one in times], in_ns.astype("M8[ns]"), in_ns.astype("m8[ns]")):
        made = Demonstration.from_arrays(lengths, HUMAN, ROBOT)
        np.testing.assert_allclose(made.observed[0].stamps_ns, in_ns, atol=1)
    with pytest.raises(ArgumentError, match="use float64"):
        Demonstration.from_arrays((TIMES_S + 1.7e9).astype(np.float32), HUMAN, ROBOT)


@pytest.mark.parametrize("gap", [None, np.nan, np.datetime64("NaT")])
@pytest.mark.parametrize("row", [0, 10])
@pytest.mark.parametrize("of", [float, datetime, timedelta])
def test_a_time_that_is_missing_is_named(of, row, gap):
    first = {float: 0.0, datetime: datetime(2024, 1, 31, 10), timedelta: timedelta()}[of]
    times = [first + (t if of is float else timedelta(seconds=t)) for t in TIMES_S.tolist()]
    times[row] = gap
    with pytest.raises(ArgumentError, match=f"got nan in row {row}. Leave that sample out"):
        Demonstration.from_arrays(times, HUMAN, ROBOT)
