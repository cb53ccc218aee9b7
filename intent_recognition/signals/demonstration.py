# SPDX-License-Identifier: Apache-2.0
"""Recorded demonstrations, and rejections of recordings that cannot be used."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, settle
from intent_recognition.errors import ArgumentError, IntentError, ShapeError, check_type, one_line
from intent_recognition.signals.arrays import as_numbers, as_seconds, check_times
from intent_recognition.signals.signal import GROUP, LABEL, MIN_SAMPLES, Signal, can_name_task
from intent_recognition.signals.streams import recording_doubts, stream_defect
from intent_recognition.signals.turns import continuous
from intent_recognition.signals.units import Known, spelled

UNNAMED = "demonstration"


@dataclass(frozen=True, repr=False)
class Demonstration:
    """Measured movements of both agents in one recording.

    Attributes:
        name: name of the bag; in a session "<bag>#<index>".
        source: path of the bag, empty for a demonstration from arrays.
        task: label, None if the recording has none.
        observed: one signal per observed entry of the DOF file, in the file's order.
        controlled: one signal per controlled entry, in the file's order.
        start_ns: first stamp of the observed signals; in a session, time of the start marker.
        end_ns: last stamp of the observed signals; in a session, time of the end marker.
        metadata: further labels of the bag.
        rejected: number of dropped messages, by reason.
        delays_s: median time from stamp to log time of each signal, observed ones first [s]; empty
            if log times were not recorded.
        context: one signal per context entry; each sample holds from its stamp until the next, also
            before and after the movement.
        frames: frames of the poses by topic, where the recording names any.
        wrapped: names of the angles that jumped by whole turns; the jumps are removed
            (`signals.turns`).
        known: prior knowledge about each controlled signal, such as the limits of the arm's
            joints; empty if nothing is known.
    """

    name: str
    source: str
    task: str | None
    observed: tuple[Signal, ...]
    controlled: tuple[Signal, ...]
    start_ns: int
    end_ns: int
    metadata: Mapping[str, str] = field(default_factory=dict)
    rejected: Mapping[str, int] = field(default_factory=dict)
    delays_s: tuple[float, ...] = ()
    context: tuple[Signal, ...] = ()
    frames: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    known: tuple[Known | None, ...] = ()
    wrapped: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Copy the mappings, so that callers cannot change them, and make angles continuous."""
        for agent in ("observed", "controlled"):
            made = [continuous(signal) for signal in getattr(self, agent)]
            names = (*self.wrapped, *(name for _, jumped in made for name in jumped))
            settle(self, **{agent: tuple(signal for signal, _ in made), "wrapped": names})
        mappings = {name: dict(getattr(self, name)) for name in ("metadata", "rejected", "frames")}
        settle(self, **mappings)

    @classmethod
    def from_arrays(
        cls,
        times_s: ArrayLike,
        human: ArrayLike,
        robot: ArrayLike,
        *,
        robot_times_s: ArrayLike | None = None,
        context: ArrayLike | None = None,
        task: str | None = None,
        observed_names: Sequence[str] | None = None,
        controlled_names: Sequence[str] | None = None,
        context_names: Sequence[str] | None = None,
        observed_unit: str = "m",
        controlled_unit: str = "rad",
        context_unit: str = "m",
        name: str = UNNAMED,
        group: str = "",
    ) -> Demonstration:
        """Make a demonstration from arrays, with one signal for each agent.

        Rows that are all NaN were not measured: they are left out and not interpolated. Rows that
        are partly NaN are refused. The arrays are checked like a recording in
        `read_demonstrations`: unusable data are refused, and doubtful data, such as a human who
        does not move, cause a warning.

        Args:
            times_s: times of the samples, increasing, (T,) [s], or datetime64 or timedelta64; they
                are rounded to nanoseconds.
            human: positions of the observed DOFs, (T, P), in `observed_unit`.
            robot: positions of the controlled DOFs, (T, Q), in `controlled_unit`; Q = 0 if only the
                human was recorded.
            robot_times_s: times of the robot's samples if they differ from the human's, (U,) [s],
                on the same clock; `robot` is then (U, Q).
            context: known quantities of the scene, such as the position of a box, (M,), in
                `context_unit`; None if there are none.
            task: label, of 1 to 80 printable characters without a slash, and not "none"; None for
                an unlabelled demonstration.
            observed_names: P names; None for human_0, human_1, ...
            controlled_names: Q names; None for robot_0, robot_1, ...
            context_names: M names; None for context_0, context_1, ...
            observed_unit: unit of all observed DOFs. Thresholds in metres and radians apply to "m"
                and "rad" only; thresholds in other units are relative to the signal's range.
            controlled_unit: unit of all controlled DOFs.
            context_unit: unit of the context.
            name: name in reports and messages; demonstrations without a name are numbered in the
                order in which they are learned.
            group: the person or pair who moved (`metadata["group"]`), so that differences between
                people are learned; "" if unknown. With few people, less is known about a new
                person, whose task is then decided later (docs/recognition.md).

        Raises:
            ShapeError: the arrays do not fit each other or the names.
            ArgumentError: times do not increase, a value is not finite, there are fewer than four
                samples, metres cannot be the unit, the robot was not recorded while the human
                moved, two columns have one name, the group is no text, or the label cannot name a
                task.
        """
        if task is not None and not can_name_task(task):
            cure = "Give one such as give_cup; None where there is no label."
            raise ArgumentError.about("task", LABEL, repr(task), cure)
        observed = _signal("human", "times_s", times_s, human, observed_names, observed_unit)
        its, own_times_s = "robot_times_s", robot_times_s
        if own_times_s is None:
            its, own_times_s = "times_s", times_s
        controlled = _signal("robot", its, own_times_s, robot, controlled_names, controlled_unit)
        if not observed.names:
            cure = "Pass one column per DOF."
            raise ShapeError.about("human", "at least one column", observed.values.shape, cure)
        start_ns, end_ns = int(observed.stamps_ns[0]), int(observed.stamps_ns[-1])
        known = (
            () if context is None else (_constant(context, start_ns, context_names, context_unit),)
        )
        robots = (controlled,) if controlled.names else ()
        for argument, text in (("name", name), ("group", group)):
            check_type(argument, text, str, f"Pass a name, such as str({argument}).")
        whose = {GROUP: group} if group else {}
        made = cls(name, "", task, (observed,), robots, start_ns, end_ns, whose, context=known)
        if defect := stream_defect(made):
            raise ArgumentError(f"{name}: {defect}")
        for doubt in recording_doubts(made, brief=True):
            # Python shows the same warning from one line only once
            warnings.warn(f"{name}: {doubt}", stacklevel=2)
        return made

    def __repr__(self) -> str:
        """Name, label and sizes; the samples are in `observed` and `controlled`."""
        sides = [
            sum(len(signal.names) for signal in side) for side in (self.observed, self.controlled)
        ]
        label = "no label" if self.task is None else f"task {self.task!r}"
        return (
            f"<Demonstration {self.name!r}: {label}, {self.duration_s:.2f} s,"
            f" {sides[0]} observed and {sides[1]} controlled DOFs>"
        )

    @property
    def duration_s(self) -> float:
        """Length of the demonstration in seconds."""
        return (self.end_ns - self.start_ns) * 1e-9

    @property
    def context_values(self) -> Floats:
        """The context at the start of the movement, (M,): the last sample by then, or the first."""
        rows = (np.searchsorted(one.stamps_ns, self.start_ns, "right") - 1 for one in self.context)
        known = (one.values[max(row, 0)] for one, row in zip(self.context, rows, strict=True))
        return np.concatenate([np.empty(0), *known])


def numbered(recordings: Iterable[Demonstration]) -> Iterator[Demonstration]:
    """Yield the demonstrations, those without a name numbered by their place, from 0.

    Raises:
        ArgumentError: `recordings` is not a list of demonstrations.
    """
    cure = "Make them with `Demonstration.from_arrays` or `read_demonstrations`."
    if not isinstance(recordings, Iterable):
        cure = "Put it into a list." if isinstance(recordings, Demonstration) else cure
        found = type(recordings).__name__
        raise ArgumentError.about("demonstrations", "a list of Demonstration", found, cure)
    for place, recorded in enumerate(recordings):
        if not isinstance(recorded, Demonstration):
            argument, found = f"demonstrations[{place}]", type(recorded).__name__
            raise ArgumentError.about(argument, "a Demonstration", found, cure)
        unnamed = recorded.name == UNNAMED
        yield replace(recorded, name=f"{UNNAMED}_{place}") if unnamed else recorded


def _constant(context: ArrayLike, stamp_ns: int, names: Sequence[str] | None, unit: str) -> Signal:
    """The signal of a constant context that is known from a stamp on."""
    values = as_numbers("context", context)
    if values.ndim != 1 or (names is not None and len(names) != len(values)):
        expected = "shape (M,)" if names is None else f"shape ({len(names)},), one for each name"
        cure = "Pass one number for each quantity."
        raise ShapeError.about("context", expected, values.shape, cure)
    if not np.all(np.isfinite(values)):
        cure = "Leave the demonstration out."
        raise ArgumentError.about("context", "finite numbers", values, cure)
    own = tuple(names or (f"context_{k}" for k in range(len(values))))
    return Signal(own, np.array([stamp_ns]), values[None], _unit("context_unit", unit))


def _signal(
    argument: str,
    times_name: str,
    times_s: ArrayLike,
    values: ArrayLike,
    names: Sequence[str] | None,
    unit: str,
) -> Signal:
    """Check the arrays of one agent and make its signal; messages name the caller's arguments."""
    side = "observed" if argument == "human" else "controlled"
    times, samples = as_seconds(times_name, times_s), as_numbers(argument, values)
    if times.ndim != 1:
        cure = "Pass one time for each sample."
        raise ShapeError.about(times_name, "shape (T,)", times.shape, cure)
    if not times.size:
        expected = f"at least {MIN_SAMPLES} times"
        raise ArgumentError.about(times_name, expected, "none", "Check what was recorded.")
    if samples.ndim != 2 or len(samples) != len(times):
        expected = f"shape ({times.size}, number of DOFs), a row for each of {times.size} times"
        cure = "Pass one row per time and one column per DOF."
        if samples.ndim == 2 and samples.shape[1] == times.size:
            cure = f"Pass it transposed: {argument}.T."
        elif samples.ndim < 2 and argument == "robot" and samples.size in (0, 1, times.size):
            cure = "Pass robot[:, None] for one joint; numpy.empty((T, 0)) without a robot."
        elif samples.shape == times.shape:
            cure = "Pass human[:, None] for one DOF."
        elif samples.ndim == 2 and argument == "robot" and times_name == "times_s":
            cure = "Pass its own times as robot_times_s, or one row per time of the human."
        raise ShapeError.about(argument, expected, samples.shape, cure)
    n_dofs = samples.shape[1]
    names = [f"{argument}_{k}" for k in range(n_dofs)] if names is None else names
    if len(names) != n_dofs:
        expected, cure = f"{n_dofs}, one per column", "Name every DOF once."
        raise ShapeError.about(f"{side}_names", expected, len(names), cure)
    if len({name for name in names if isinstance(name, str) and name}) != n_dofs:
        expected, cure = f"{n_dofs} different texts", "Name every DOF once."
        raise ArgumentError.about(f"{side}_names", expected, list(names), cure)
    measured = ~np.all(np.isnan(samples), axis=1) | (n_dofs == 0)
    times, samples = times[measured], samples[measured]
    _check(argument, times_name, times, samples)
    stamps_ns = np.round(times * 1e9).astype(np.int64)
    return Signal(tuple(names), stamps_ns, samples, _unit(f"{side}_unit", unit))


def _unit(argument: str, unit: object) -> str:
    if not isinstance(unit, str) or not unit:
        cure = "Pass 'm', 'rad', or what the numbers are in."
        raise ArgumentError.about(argument, "a text", repr(unit), cure)
    if (own := spelled(unit)) != unit:
        cure = f"Write {own!r}: another spelling would count as another unit."
        raise ArgumentError.about(argument, f"the unit {own}", repr(unit), cure)
    return unit


def _check(argument: str, times_name: str, times_s: Floats, samples: Floats) -> None:
    if len(times_s) < MIN_SAMPLES:
        expected = f"at least {MIN_SAMPLES} samples that are not NaN"
        raise ArgumentError.about(argument, expected, len(times_s), "Record more.")
    if not np.all(np.isfinite(samples)):
        row, column = np.argwhere(~np.isfinite(samples))[0]
        got = f"{samples[row, column]} in column {column} at {times_s[row]:g} s"
        cure = "Leave that sample out, or make the whole row NaN."
        raise ArgumentError.about(argument, "finite numbers, or NaN in a whole row", got, cure)
    check_times(times_name, times_s)


@dataclass(frozen=True)
class Rejection:
    """Reason for leaving out a recording or a part of a session."""

    path: str  # path of the bag
    topic: str  # topic at fault, "" for the whole bag
    stamp_ns: int  # time of the fault in the recording, 0 if unknown
    reason: str  # one sentence
    cure: str = ""  # advice in one sentence, empty if the reason suffices

    @classmethod
    def of(cls, path: str, error: IntentError, kind: str = "", stamp_ns: int = 0) -> Rejection:
        """Make a rejection from an error, whose text is stripped of the path."""
        reason = one_line(error).removesuffix(error.cure).removesuffix(". ")
        reason = reason.removeprefix(f"{path}: ").removeprefix(f"{path}/")
        return cls(path, "", stamp_ns, f"{kind}: {reason}" if kind else reason, error.cure)

    def __str__(self) -> str:
        topic = f" topic {self.topic}" if self.topic else ""
        time = f" at {self.stamp_ns} ns" if self.stamp_ns else ""
        cure = f". {self.cure}" if self.cure else ""
        return f"{self.path}{topic}{time}: {self.reason}{cure}"
