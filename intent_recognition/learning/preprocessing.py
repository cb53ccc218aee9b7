# SPDX-License-Identifier: Apache-2.0
"""How recordings become examples: basis, onset thresholds, DOFs and templates, all fixed once.

The `Preprocessing` is fixed before the first example is made, so that statistics accumulated at
other times, or by other processes, can be merged.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrainingError, describe
from intent_recognition.learning.examples import TrainingExample, cut_one, make_example
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.learning.timing import Timing, estimate_timing
from intent_recognition.promp import NONE, NormalizedRBFBasis
from intent_recognition.signals import (
    TURNS,
    Demonstration,
    OnsetSettings,
    Signal,
    Size,
    StreamFinding,
    begin_near,
    differing_unit,
    first_values,
    likely_slips,
    median_size,
    onset_settings,
    place_of,
    size_of,
    turn_reference,
)


class SignalNames(NamedTuple):
    """The DOFs of one signal and their unit."""

    names: tuple[str, ...]
    unit: str


@dataclass(frozen=True)
class Preprocessing:
    """How each recording becomes an example."""

    settings: TrainingSettings  # including basis, ridge and segmentation
    # observed, controlled: DOFs of each signal
    observed: tuple[SignalNames, ...]
    controlled: tuple[SignalNames, ...]
    # onset, controlled_onset: thresholds of the movement for each signal
    onset: tuple[OnsetSettings, ...]
    controlled_onset: tuple[OnsetSettings, ...]
    timing: Timing  # templates for alignment, and the timing of the tasks
    source: str = ""  # name of the recording that the DOFs are from
    context: tuple[SignalNames, ...] = ()  # names of each context signal
    # reference start of each DOF that is an angle, in its unit: recordings are shifted to the turn
    # in which they start nearest to it; observed DOFs first, None for DOFs that are no angles
    angles: tuple[float | None, ...] = ()

    def basis_of(self, aligned: bool) -> NormalizedRBFBasis:
        """Basis functions over recorded phase, or over reference phase if `aligned`."""
        settings = self.settings
        n_basis = settings.n_aligned_basis if aligned else settings.n_basis
        return NormalizedRBFBasis(n_basis, settings.width)

    @property
    def n_observed(self) -> int:
        """Number of observed DOFs."""
        return sum(len(signal.names) for signal in self.observed)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of all DOFs, observed first, (D,)."""
        return tuple(s.unit for s in (*self.observed, *self.controlled) for _ in s.names)

    def cut(self, recorded: Demonstration) -> Demonstration:
        """The recording with angles in the common turn, cut to the movement if settings say so."""
        recorded = in_turns(recorded, self.angles)
        if self.settings.segmentation == "movement":
            return cut_one(recorded, self.onset, self.controlled_onset)
        return recorded


def settle_preprocessing(
    recordings: Sequence[Demonstration], settings: TrainingSettings
) -> Preprocessing:
    """Determine DOFs, thresholds and templates from the recordings with the most frequent DOFs."""
    ((usual, _),) = Counter(map(_dofs, recordings)).most_common(1)
    recordings = [recorded for recorded in recordings if _dofs(recorded) == usual]
    first, angles = recordings[0], angle_references(recordings)
    recordings = [in_turns(recorded, angles) for recorded in recordings]
    onset = onset_settings([recorded.observed for recorded in recordings])
    controlled_onset = onset_settings([recorded.controlled for recorded in recordings])
    if settings.segmentation == "movement":
        recordings = [cut_one(recorded, onset, controlled_onset) for recorded in recordings]
    return Preprocessing(
        settings=settings,
        observed=_names(first.observed),
        controlled=_names(first.controlled),
        onset=onset,
        controlled_onset=controlled_onset,
        timing=estimate_timing(recordings),
        source=first.name,
        context=_names(first.context),
        angles=angles,
    )


def angle_references(recordings: Sequence[Demonstration]) -> tuple[float | None, ...]:
    """Reference start of each DOF that is an angle, which defines its turn; None for other DOFs."""
    agents = [(one.start_ns, (*one.observed, *one.controlled)) for one in recordings]
    starts = [
        np.concatenate([first_values(signal, start_ns) for signal in signals])
        for start_ns, signals in agents
        if all(signal.stamps_ns.size for signal in signals)
    ]
    _, signals = agents[0]
    units = [signal.unit for signal in signals for _ in signal.names]
    if not starts:
        return (None,) * len(units)
    return tuple(
        turn_reference(of_dof, TURNS[unit]) if unit in TURNS else None
        for unit, of_dof in zip(units, np.array(starts).T, strict=True)
    )


def in_turns(recorded: Demonstration, angles: Sequence[float | None]) -> Demonstration:
    """Shift each angle by whole turns so that it begins nearest to its reference."""
    if all(angle is None for angle in angles):
        return recorded
    n_observed = sum(len(signal.names) for signal in recorded.observed)
    observed = begin_near(recorded.observed, recorded.start_ns, angles[:n_observed])
    controlled = begin_near(recorded.controlled, recorded.start_ns, angles[n_observed:])
    return replace(recorded, observed=observed, controlled=controlled)


def examples_of(
    recordings: Sequence[Demonstration], preprocessing: Preprocessing
) -> list[TrainingExample | TrainingError]:
    """Turn each recording into an example with its aligned counterpart, or an error."""
    found: list[TrainingExample | TrainingError] = []
    usable, timing = [], preprocessing.timing
    for index, recorded in enumerate(recordings):
        try:
            if reason := reason_against(recorded, preprocessing):
                raise TrainingError(reason)
            cut = preprocessing.cut(recorded)
            (steady,) = timing.steady([cut]) if timing.duration_exponent else (None,)
            example = _example(cut, preprocessing, steady, aligned=False)
            found.append(example)
            usable.append((index, cut, example))
        except TrainingError as error:
            found.append(error)
    warps = timing.warps([cut for _, cut, _ in usable])
    for (index, cut, example), warp in zip(usable, warps, strict=True):
        aligned = _example(cut, preprocessing, warp.inverse, aligned=True)
        found[index] = example._replace(aligned=aligned)
    return found


def _example(
    cut: Demonstration,
    preprocessing: Preprocessing,
    warp: Callable[[Floats], Floats] | None,
    *,
    aligned: bool,
) -> TrainingExample:
    """Make an example whose controlled agent moves as far and as late as at the usual duration."""
    timing, n = preprocessing.timing, preprocessing.n_observed
    basis, ridge = preprocessing.basis_of(aligned), preprocessing.settings.ridge
    example = make_example(cut, basis, ridge, warp, recorded_samples=not aligned)
    if not (timing.displacement_exponent or timing.delay_s):
        return example
    duration_s, usual_s = example.duration_s, timing.usual_of(example.task)
    earlier = timing.delay_s * (1.0 / usual_s - 1.0 / duration_s)
    factor = (duration_s / usual_s) ** -timing.displacement_exponent
    scaling = basis.scaling(factor) @ basis.shifting(earlier)
    weights = np.vstack([example.weights[:n], example.weights[n:] @ scaling.T])
    return example._replace(weights=weights)


def examples_together(
    recordings: Sequence[Demonstration], settings: TrainingSettings
) -> list[TrainingExample | TrainingError]:
    """Do what `examples_of` does, with a preprocessing determined from the usable recordings."""
    reasons = [reason_against(recorded, None) for recorded in recordings]
    usable = [one for one, reason in zip(recordings, reasons, strict=True) if not reason]
    if not usable:
        return [TrainingError(reason) for reason in reasons]
    return examples_of(recordings, settle_preprocessing(usable, settings))


def example_of(recorded: Demonstration, preprocessing: Preprocessing) -> TrainingExample:
    """Turn one recording into an example.

    Raises:
        TrainingError: the recording cannot be used; the message says why.
    """
    (example,) = examples_of([recorded], preprocessing)
    if isinstance(example, TrainingError):
        raise TrainingError(f"{recorded.name}: {example}")
    return example


def reason_against(recorded: Demonstration, like: Preprocessing | None) -> str:
    """Why a recording cannot be learned from together with earlier ones, or an empty string."""
    if recorded.task is None:
        return "it has no label `task`"
    if recorded.task == NONE:
        return f"the label {NONE!r} is reserved"
    for agent in ("observed", "controlled"):
        if not getattr(recorded, agent):
            return (
                f"it has no {agent} degrees of freedom: add an entry to {agent} of the DOF file,"
                " or a column to the array"
            )
    if like is None:
        return ""
    expected, found = _dofs(like), _dofs(recorded)
    if expected == found:
        return ""
    return describe(
        "DOFs",
        f"those of {like.source or 'the model'}, {_in_words(expected)}",
        _in_words(found),
        "Give all the same names and units; read bags with one DOF file.",
    )


def _in_words(dofs: Iterable[Iterable[SignalNames]]) -> str:
    """Names and units: `x, y, z [m]; q1, q2 [rad]`."""
    signals = (signal for side in dofs for signal in side)
    return "; ".join(f"{', '.join(signal.names)} [{signal.unit}]" for signal in signals)


def _dofs(model: Demonstration | Preprocessing) -> tuple[tuple[SignalNames, ...], ...]:
    """Names and unit of each signal: observed, controlled and, where there is any, context."""
    if isinstance(model, Preprocessing):
        return model.observed, model.controlled, *([model.context] if model.context else [])
    context = [_names(model.context)] if model.context else []
    return _names(model.observed), _names(model.controlled), *context


def _names(signals: Iterable[Signal]) -> tuple[SignalNames, ...]:
    return tuple(SignalNames(signal.names, signal.unit) for signal in signals)


def other_units_of(
    tasks: Mapping[str, TaskStatistics],
    usual: Mapping[str, TaskStatistics],
    preprocessing: Preprocessing,
) -> list[StreamFinding]:
    """Demonstrations with a signal in another unit than most others, each with the likely unit."""
    known = [_sizes(example, preprocessing) for task in usual.values() for example in task.examples]
    medians = {name: median_size([each[name] for each in known]) for name in known[0]}
    return [
        StreamFinding(example.name, f"{name} {found.reason}")
        for task in tasks.values()
        for example in task.examples
        for name, size in _sizes(example, preprocessing).items()
        if (found := differing_unit(size, medians[name])) is not None
    ]


def slips_of(
    tasks: Mapping[str, TaskStatistics], preprocessing: Preprocessing
) -> list[StreamFinding]:
    """Demonstrations that lie elsewhere than others of their task, each with the likely slip.

    Those with a context are not compared: it says that places differ.
    """
    places = {
        task: [
            [place_of(*one) for one in _signals(example, preprocessing) if not example.context.size]
            for example in statistics.examples
        ]
        for task, statistics in tasks.items()
    }
    found = likely_slips(places)
    return [
        StreamFinding(example.name, slip)
        for task, statistics in tasks.items()
        for example, slip in zip(statistics.examples, found[task], strict=True)
        if slip
    ]


def _sizes(example: TrainingExample, preprocessing: Preprocessing) -> dict[str, Size]:
    """Size of each signal's values, keyed by its first DOF."""
    signals = _signals(example, preprocessing)
    return {names[0]: size_of(unit, values) for names, unit, values in signals}


def _signals(
    example: TrainingExample, preprocessing: Preprocessing
) -> Iterator[tuple[tuple[str, ...], str, Floats]]:
    """DOFs, unit and values (T, d) of each signal during the movement."""
    for signals, values in (
        (preprocessing.observed, example.observed),
        (preprocessing.controlled, example.controlled),
    ):
        first = 0
        for names, unit in signals:
            yield names, unit, values[:, first : first + len(names)]
            first += len(names)
