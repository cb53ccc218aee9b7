# SPDX-License-Identifier: Apache-2.0
"""Timing of demonstrations: templates to align with, and deviations from steady progress.

Templates and the standard deviation of the phase deviation are estimated once and are part of the
preprocessing. Each later recording is aligned on its own with the same template (Maeda et al. 2014,
part III-E).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from intent_recognition.alignment import Template, Warp, align, align_to, even_trajectory
from intent_recognition.array_types import Floats
from intent_recognition.learning.hyperparameters import is_clear
from intent_recognition.learning.persons import compares_people
from intent_recognition.promp import LAGS, STEADY, PhaseDeviation, steady_phase
from intent_recognition.signals import GROUP, Demonstration

BRIDGE = np.linspace(0.0, 1.0, 51) * np.linspace(1.0, 0.0, 51)
"""u (1 - u) at evenly spaced phases u: a phase deviation is zero at both ends."""
MIN_DEVIATION_STD, DEFAULT_DEVIATION_STD = 0.004, 0.03
"""Smallest standard deviation of the phase deviation, and its peak along the movement if no task
has two recordings, as shares of the duration."""
DEVIATION_CORRELATION = 0.4
"""Correlation length of the phase deviation, in phase (docs/prediction.md)."""
DEVIATION_EVIDENCE = 0.15
"""Exponent of the evidence on the phase deviation, in (0, 1] (docs/decisions/one_filter.md)."""
ALIGNED_FLOOR = 0.04
"""Smallest scale of the phase deviation of aligned primitives, a share of the duration
(docs/decisions/one_filter.md)."""
STEADY_SHARE, STEADY_FLOOR = 0.5, 0.01
"""Share of the phase deviation that the covariance of primitives at steady progress does not hold
(docs/decisions/one_filter.md), and its smallest scale, a share of the duration."""

DISPLACEMENT_EXPONENTS = (1.0, 2.0)
"""Exponents of the controlled agent's displacement that are tried besides zero: the agent
integrates the observed agent's action once, as a velocity that follows a force, or twice."""
FEWEST_COMPARED, MOST_COMPARED = 5, 60
"""Fewest and most recordings of a task on which these exponents are tried; the latter bounds
computing time."""
RIDGES_COMPARED = (1e-4, 1e-3, 1e-2, 0.1, 1.0)
"""Ridges that are tried, relative to the mean eigenvalue."""

PhaseMap = Callable[[Floats], Floats]
PACES = ("steady", "own", "shared", "aligned")
"""Whose phase deviates from steady progress: nobody's, the observed agent's alone, both agents'
together, or both together over a reference phase to which demonstrations are aligned."""


@dataclass(frozen=True, eq=False)
class Timing:
    """Templates of tasks, and how far the phase of recordings deviates from steady progress."""

    templates: Mapping[str, Template]  # template of each label with two recordings
    deviation_std: Floats  # standard deviation of the phase deviation at even recorded phases, (U,)
    duration_exponent: float = 0.0  # how progress depends on the duration (`promp.steady_phase`)
    # geometric mean of the durations of each of these labels [s]; see `usual_of`
    usual_s: Mapping[str, float] = field(default_factory=dict)
    displacement_exponent: float = 0.0  # as in `promp.TaskLibrary`
    delay_s: float = 0.0  # as in `promp.TaskLibrary`

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Timing) and self._numbers() == other._numbers()

    def _numbers(self) -> tuple[object, ...]:
        templates = {
            label: [part.tolist() for part in template]
            for label, template in self.templates.items()
        }
        own = self.duration_exponent, self.displacement_exponent, self.delay_s, self.usual_s
        return templates, self.deviation_std.tolist(), *own

    __hash__ = None  # type: ignore[assignment]  # arrays have no hash

    def phase_deviation(self, pace: str) -> PhaseDeviation:
        """The prior of a person's phase deviation, for one of `PACES`."""
        if pace == "steady":
            return replace(STEADY, duration_exponent=self.duration_exponent)
        aligned = pace == "aligned"
        share, floor = (1.0, ALIGNED_FLOOR) if aligned else (STEADY_SHARE, STEADY_FLOOR)
        scale = np.maximum(share * self.deviation_std, floor)
        follows = pace != "own"
        return PhaseDeviation(
            scale, DEVIATION_CORRELATION, DEVIATION_EVIDENCE, follows, self.duration_exponent
        )

    def usual_of(self, label: str) -> float:
        """Usual duration of a task [s]; the geometric mean of all tasks' for a later task."""
        known = [self.usual_s[label]] if label in self.usual_s else [*self.usual_s.values()]
        return float(np.exp(np.mean(np.log(known or [1.0]))))

    def steady(self, recordings: Sequence[Demonstration]) -> list[PhaseMap]:
        """Map from the recorded phase to the reference phase at steady progress, per recording."""
        usual_s = [self.usual_of(str(one.task)) for one in recordings]
        bent = replace(STEADY, duration_exponent=self.duration_exponent)
        return [
            partial(steady_phase, bent, relative=one.duration_s / usual)
            for one, usual in zip(recordings, usual_s, strict=True)
        ]

    def warps(self, recordings: Sequence[Demonstration]) -> list[Warp]:
        """Warps from reference phase to recorded phase; the identity without a template."""
        found = [Warp.identity()] * len(recordings)
        for label, indices in _by_task(recordings).items():
            if label in self.templates:
                paths = [_path(recordings[index]) for index in indices]
                warps = align_to(self.templates[label], paths)
                for index, warp in zip(indices, warps, strict=True):
                    found[index] = warp
        return found


def estimate_timing(recordings: Sequence[Demonstration]) -> Timing:
    """Templates and phase deviations of labelled recordings that are cut to their movements.

    Recordings without a sample of some signal are ignored. The duration exponent is estimated only
    where people can be compared, since the durations of one person differ too little.
    """
    usable = [recorded for recorded in recordings if _has_samples(recorded)]
    templates, deviations, logs, usual_s, paths = {}, [], [], {}, []
    by_task = {label: [usable[i] for i in own] for label, own in _by_task(usable).items()}
    for label, own in by_task.items():
        if len(own) < 2:
            continue
        log_s = np.log([recorded.duration_s for recorded in own])
        usual_s[label] = float(np.exp(log_s.mean()))
        paths.append(np.array([*map(_path, own)]))
        alignment = align([*paths[-1]])
        templates[label] = alignment.template
        deviations.append(_deviations(alignment.warps))
        logs.append(log_s - log_s.mean())
    groups = [[one.metadata.get(GROUP, "") for one in task] for task in by_task.values()]
    exponent = estimate_duration_exponent(deviations, logs) if compares_people(groups) else 0.0
    n_observed = sum(len(signal.names) for signal in usable[0].observed) if usable else 0
    following = estimate_following(paths, logs, [*usual_s.values()], n_observed)
    for rows, log_relative in zip(deviations, logs, strict=True):
        rows -= exponent * np.outer(log_relative, BRIDGE)
    return Timing(
        dict(sorted(templates.items())),
        _deviation_std(deviations),
        exponent,
        dict(sorted(usual_s.items())),
        *following,
    )


def estimate_duration_exponent(
    deviations: Sequence[Floats], log_relative: Sequence[Floats]
) -> float:
    """Estimate how phase deviations depend on durations (`promp.steady_phase`).

    To first order a deviation is the exponent times the log relative duration times u (1 - u). The
    exponent is the slope of a regression with the prior N(0, 1), whose noise variance is the
    variance of the recordings at an exponent of zero.

    Args:
        deviations: phase deviations of each task's recordings, two or more, (n, U).
        log_relative: logarithms of their durations less the mean of the task, (n,).
    """
    if not deviations:
        return 0.0
    along = BRIDGE / (BRIDGE @ BRIDGE)
    share = np.concatenate([(rows - rows.mean(axis=0)) @ along for rows in deviations])
    pace = np.concatenate(log_relative)
    variance = share @ share / (len(pace) - len(deviations))
    return float(pace @ share / max(pace @ pace + variance, 1e-300))


def estimate_following(
    paths: Sequence[Floats],
    log_relative: Sequence[Floats],
    usual_s: Sequence[float],
    n_observed: int,
) -> tuple[float, float]:
    """Estimate the exponent of the controlled agent's displacement, and its delay [s].

    The displacement grows as this power of the duration. The exponent is the one with which ridge
    regression on the observed agent's whole path best predicts left-out recordings
    (docs/mathematics.md). A delay is returned instead if the observed agent's place that much
    earlier predicts better than this regression and than its place a share of the duration earlier.
    Values other than zero must be better by twice the standard error over the recordings.

    Args:
        paths: paths of each task's recordings at even phases, (n, T, D), observed DOFs first.
        log_relative: logarithms of their durations less the mean of the task, (n,).
        usual_s: usual duration of each task [s].
        n_observed: number of observed DOFs.
    """
    compared = [
        (path[::step], log_s[::step], usual)
        for path, log_s, usual in zip(paths, log_relative, usual_s, strict=True)
        for step in [-(-len(path) // MOST_COMPARED)]
        if len(path) >= FEWEST_COMPARED
    ]
    if not compared:
        return 0.0, 0.0
    spread = np.std(np.concatenate([path[:, ::4] for path, *_ in compared]), axis=(0, 1))
    delays_s = LAGS * np.exp(np.mean(np.log([usual for *_, usual in compared])))
    tried, by_all, by_share, by_delay = (0.0, *DISPLACEMENT_EXPONENTS), [], [], []
    for path, log_s, usual in compared:
        scaled, pace = path / np.where(spread > 0.0, spread, 1.0), np.exp(-log_s) / usual
        observed, controlled = np.split(scaled[:, ::4], [n_observed], axis=2)
        by_all.append([_left_out_errors(observed, controlled, np.exp(b * log_s)) for b in tried])
        by_share.append([_copy_errors(scaled, n_observed, share) for share in LAGS])
        by_delay.append([_copy_errors(scaled, n_observed, delay * pace) for delay in delays_s])
    usual_way, of_all, exponent = _best(by_all)
    (_, of_share, _), (_, of_delay, delay) = _best(by_share), _best(by_delay)
    if is_clear(of_all - of_delay, 2.0) and is_clear(of_share - of_delay, 2.0):
        return 0.0, float(delays_s[delay])
    return tried[exponent] if is_clear(usual_way - of_all, 2.0) else 0.0, 0.0


def _best(errors: Sequence[Sequence[Floats]]) -> tuple[Floats, Floats, int]:
    """Log errors of all recordings under the first and the best candidate; the best's index."""
    found = np.log(np.maximum(np.hstack(errors), 1e-12))
    best = int(np.argmin(found.mean(axis=1)))
    return found[0], found[best], best


def _copy_errors(path: Floats, n_observed: int, lag: Floats | float) -> Floats:
    """Mean squared residuals of regression on the observed DOFs a lag (n,) earlier, (n,)."""
    at, moved = np.arange(0, path.shape[1], 4), path - path[:, :1]
    places = at - np.rint(np.reshape(lag, (-1, 1)) * (path.shape[1] - 1)).astype(np.int64)
    before = moved[np.arange(len(path))[:, None], np.maximum(places, 0), :n_observed]
    known, goal = (one - one.mean(axis=0) for one in (before, moved[:, at, n_observed:]))
    rows = known.reshape(-1, n_observed)
    slopes = np.linalg.lstsq(rows, goal.reshape(len(rows), -1), rcond=1e-3)[0]
    return np.asarray(np.mean((goal - known @ slopes) ** 2, axis=(1, 2)))


def _left_out_errors(observed: Floats, controlled: Floats, factor: Floats) -> Floats:
    """Mean squared error of each recording's displacement predicted from the others, (n,).

    Displacements of controlled paths (n, T, Q), divided by factors (n,), are regressed on observed
    paths (n, T, P); each recording is left out in closed form (Hastie et al. 2009, Eq. 7.64).
    """
    n = len(factor)
    known = (observed - observed.mean(axis=0)).reshape(n, -1)
    goal = (controlled - controlled[:, :1]).reshape(n, -1) / factor[:, None]
    goal -= goal.mean(axis=0)
    values, vectors = np.linalg.eigh(known @ known.T)
    values, found = np.maximum(values, 0.0), []
    for ridge in RIDGES_COMPARED:
        kept = values / (values + max(ridge * values.mean(), 1e-300))
        smoother = (vectors * kept) @ vectors.T
        left = (goal - smoother @ goal) / (1.0 - 1.0 / n - np.diag(smoother))[:, None]
        found.append(factor**2 * np.mean(left**2, axis=1))
    return min(found, key=lambda one: float(one.mean()))


def _deviations(warps: Iterable[Warp]) -> Floats:
    """Reference phase less recorded phase of each warp at even recorded phases, (n, U)."""
    recorded = np.linspace(0.0, 1.0, len(BRIDGE))
    return np.array([np.clip(warp.inverse(recorded), 0.0, 1.0) for warp in warps]) - recorded


def _deviation_std(deviations: Sequence[Floats]) -> Floats:
    """Pooled standard deviation of the phase deviation, (U,), with variance c^2 4 u (1 - u)."""
    bridge = 4.0 * BRIDGE
    largest = DEFAULT_DEVIATION_STD
    if deviations:
        freedom = sum(len(rows) - 1 for rows in deviations)
        variance = sum(np.sum(rows**2, axis=0) for rows in deviations) / freedom
        largest = np.sqrt(variance @ bridge / (bridge @ bridge))
    return np.maximum(largest * np.sqrt(bridge), MIN_DEVIATION_STD)


def _by_task(recordings: Sequence[Demonstration]) -> dict[str, list[int]]:
    groups: dict[str, list[int]] = {}
    for index, recorded in enumerate(recordings):
        groups.setdefault(str(recorded.task), []).append(index)
    return groups


def _has_samples(recorded: Demonstration) -> bool:
    start_ns, end_ns = recorded.start_ns, recorded.end_ns
    return end_ns > start_ns and all(
        signal.between(start_ns, end_ns).stamps_ns.size
        for signal in (*recorded.observed, *recorded.controlled)
    )


def _path(recorded: Demonstration) -> Floats:
    """All DOFs at even recorded phases, (T, D)."""
    signals = (*recorded.observed, *recorded.controlled)
    return even_trajectory(signals, recorded.start_ns, recorded.end_ns)
