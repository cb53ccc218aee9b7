# SPDX-License-Identifier: Apache-2.0
"""One recorded demonstration, and the reason why a recording did not become one."""

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
    """What both agents did in one recording, as it was measured.

    Attributes:
        name: name of the bag; in a session "<bag>#<index>".
        source: path of the bag, empty when it came from arrays.
        task: label, None when the recording has none.
        observed: one signal per observed entry of the DOF file, in its order.
        controlled: one signal per controlled entry, in its order.
        start_ns: first stamp over the observed signals; in a session the start marker.
        end_ns: last stamp over the observed signals; in a session the end marker.
        metadata: further labels of the bag.
        rejected: number of messages dropped, by reason.
        delays_s: median time from stamp to log time of each signal, observed ones first [s]; empty
            where it was not recorded.
        context: one signal per context entry; what it says holds from its stamp on, also before
            and after the movement.
        frames: by topic the frames its poses are in, where the recording names any.
        wrapped: names of the angles that jumped by whole turns; these are taken out
            (`signals.turns`).
        known: what is known beforehand of each controlled signal, such as the limits of the arm's
            joints; empty for nothing.
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
        """Copy the mappings, so that nobody else can change them; make angles continuous."""
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
        """A demonstration from arrays, one signal for each agent.

        Rows that are NaN throughout were not measured: they are left out, and nothing is put in
        their place. Rows that are NaN in part are refused. What the arrays hold is checked as
        `read_demonstrations` checks a recording: what cannot be learned from is refused, and what
        gives reason to doubt, such as a human who does not move, is a warning.

        Args:
            times_s: times of the samples, increasing, (T,) [s], or datetime64 or timedelta64; they
                are rounded to nanoseconds.
            human: positions of the observed DOFs, (T, P), in `observed_unit`.
            robot: positions of the controlled DOFs, (T, Q), in `controlled_unit`; without a column
                where the human alone was recorded.
            robot_times_s: times of the robot's samples where they are not the human's, (U,) [s], on
                the same clock; `robot` is (U, Q) then.
            context: what was known of the scene, such as where a box stood, (M,), in
                `context_unit`; None for nothing.
            task: label, of 1 to 80 printable characters without a slash, and not "none"; None for
                an unlabelled demonstration.
            observed_names: P names; None for human_0, human_1, ...
            controlled_names: Q names; None for robot_0, robot_1, ...
            context_names: M names; None for context_0, context_1, ...
            observed_unit: unit of all observed DOFs. Thresholds in metres and radians hold for "m"
                and "rad" only; what is in other units is measured by its own range.
            controlled_unit: unit of all controlled DOFs.
            context_unit: unit of the context.
            name: of the demonstration, for reports and messages; those without one are numbered
                there, in the order in which they are learned from.
            group: the person, or the pair, who did it (`metadata["group"]`), so that what differs
                between people is learned; "" where that is not known. With few people less is
                known of a new one, who is helped later (docs/recognition.md).

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
            # Python tells the same text of one line once
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
        """The context in which the movement began, (M,): what was known last, or else first."""
        rows = (np.searchsorted(one.stamps_ns, self.start_ns, "right") - 1 for one in self.context)
        known = (one.values[max(row, 0)] for one, row in zip(self.context, rows, strict=True))
        return np.concatenate([np.empty(0), *known])


def numbered(recordings: Iterable[Demonstration]) -> Iterator[Demonstration]:
    """The recordings; those that were given no name have their place, from 0, in it.

    Raises:
        ArgumentError: they, or one of them, are something else.
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
    """The signal of a context that was known from a stamp on."""
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
    """The signal of one agent, its arrays checked; messages name the caller's arguments."""
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
        elif samples.ndim < 2 and argument == "robot" and samples.size in (0, times.size):
            cure = "Pass robot[:, None] for one joint; numpy.empty((T, 0)) without a robot."
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
        cure = f"Write {own!r}: by any other name it is a unit of its own."
        raise ArgumentError.about(argument, f"the unit {own}", repr(unit), cure)
    return unit


def _check(argument: str, times_name: str, times_s: Floats, samples: Floats) -> None:
    """Refuse what no signal can be made of."""
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
    """Why a recording, or a part of a session, is left out."""

    path: str  # the bag
    topic: str  # the topic at fault, "" when it is the whole bag
    stamp_ns: int  # when in the recording, 0 when unknown
    reason: str  # one sentence
    cure: str = ""  # what helps against it, a sentence; empty where the reason says enough

    @classmethod
    def of(cls, path: str, error: IntentError, kind: str = "", stamp_ns: int = 0) -> Rejection:
        """The rejection for which an error is the reason, without the path that both name."""
        reason = one_line(error).removesuffix(error.cure).removesuffix(". ")
        reason = reason.removeprefix(f"{path}: ").removeprefix(f"{path}/")
        return cls(path, "", stamp_ns, f"{kind}: {reason}" if kind else reason, error.cure)

    def __str__(self) -> str:
        topic = f" topic {self.topic}" if self.topic else ""
        time = f" at {self.stamp_ns} ns" if self.stamp_ns else ""
        cure = f". {self.cure}" if self.cure else ""
        return f"{self.path}{topic}{time}: {self.reason}{cure}"
