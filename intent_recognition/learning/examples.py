# SPDX-License-Identifier: Apache-2.0
"""Turn one recording into an example to learn from: cut it to the movement and fit weights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrainingError
from intent_recognition.promp import NormalizedRBFBasis, fit_weights
from intent_recognition.signals import (
    GROUP,
    MIN_SAMPLES,
    Demonstration,
    OnsetSettings,
    movement_span,
    numbered,
    onset_settings,
)

SAMPLES_PER_MOVEMENT = 30
"""Samples of one movement that count as independent evidence; denser samples share this evidence
(docs/alignment.md)."""
SAMPLES_USED = 2 * SAMPLES_PER_MOVEMENT
"""Samples of one movement that the filter uses (`filtering.SPACING`)."""


class TrainingExample(NamedTuple):
    """One demonstration as weights."""

    name: str
    task: str
    weights: Floats  # (D, N), observed DOFs first
    residual_variance: Floats  # (D,)
    duration_s: float
    observed: Floats  # samples at evenly spaced phases, (m, P)
    controlled: Floats  # at `pose_phases`, (58, Q)
    # the example over the reference phase of its task, with another basis; None where nothing was
    # aligned
    aligned: TrainingExample | None = None
    context: Floats = np.empty(0)  # context values of the scene, (M,)
    # who gave the demonstration, such as a pair of people; "" if unknown
    group: str = ""


def sample_phases() -> Floats:
    """Phases of the samples that hyperparameters are scored on, (m,)."""
    return (np.arange(SAMPLES_USED) + 0.5) / SAMPLES_USED


def pose_phases() -> Floats:
    """Phases at which poses of the controlled agent are kept, (58,)."""
    return np.linspace(0.0, 1.0, 58)


def scored_phases() -> Floats:
    """Phases at which the controlled agent's prediction is scored, every third of those, (s,)."""
    return pose_phases()[::3]


def make_example(
    recorded: Demonstration,
    basis: NormalizedRBFBasis,
    ridge: float,
    warp: Callable[[Floats], Floats] | None = None,
    *,
    recorded_samples: bool = False,
) -> TrainingExample:
    """Fit weights to one demonstration from its start to its end.

    Args:
        recorded: the demonstration.
        basis: the basis functions.
        ridge: relative weight of the curvature penalty.
        warp: maps recorded phase to reference phase; None to use the recorded phase.
        recorded_samples: take the samples of the example at recorded phases even with a `warp`.

    Raises:
        TrainingError: the movement is too short, or a DOF has too few samples.
    """
    sampled = parts = _movement(recorded)
    if warp is not None:
        parts = [(np.clip(warp(phase), 0.0, 1.0), values) for phase, values in parts]
    fits = [fit_weights(basis, *part, ridge) for part in parts]
    sampled, n_observed = sampled if recorded_samples else parts, len(recorded.observed)
    return TrainingExample(
        recorded.name,
        str(recorded.task),
        np.vstack([fit.weights for fit in fits]),
        np.concatenate([fit.residual_variance for fit in fits]),
        recorded.duration_s,
        np.hstack([interpolated(sample_phases(), *part) for part in sampled[:n_observed]]),
        np.hstack([interpolated(pose_phases(), *part) for part in sampled[n_observed:]]),
        context=recorded.context_values,
        group=recorded.metadata.get(GROUP, ""),
    )


def _movement(recorded: Demonstration) -> list[tuple[Floats, Floats]]:
    """Phases (T,) and values (T, d) of each signal from start to end, observed ones first."""
    start_ns, duration = recorded.start_ns, recorded.duration_s
    if duration < 0.2:
        cure = "Record it again, or leave it out."
        raise TrainingError.about("movement", "at least 0.2 s", f"{duration:.3f} s", cure)
    parts = []
    for signal in (*recorded.observed, *recorded.controlled):
        part = signal.between(start_ns, recorded.end_ns)
        if len(part.stamps_ns) < MIN_SAMPLES:
            raise TrainingError.about(
                ", ".join(signal.names),
                f"at least {MIN_SAMPLES} samples during the movement",
                len(part.stamps_ns),
                "Record it again, or leave it out.",
            )
        parts.append((part.seconds(start_ns) / duration, part.values))
    return parts


def interpolated(phases: Floats, at: Floats, values: Floats) -> Floats:
    """Interpolate values (T, d), given at phases `at` (T,), linearly at `phases`, (s, d)."""
    columns = [np.interp(phases, at, column) for column in values.T]
    return np.stack(columns, axis=1)


def cut_to_movement(demonstrations: Sequence[Demonstration]) -> list[Demonstration]:
    """Cut recordings to the movement, from the human's onset until both agents rest.

    Thresholds are estimated from the recordings themselves; the onset is detected as online.
    """
    demonstrations = [*numbered(demonstrations)]
    if not demonstrations:
        return []
    observed = onset_settings([recorded.observed for recorded in demonstrations])
    controlled = onset_settings([recorded.controlled for recorded in demonstrations])
    return [cut_one(recorded, observed, controlled) for recorded in demonstrations]


def cut_one(
    recorded: Demonstration, observed: Sequence[OnsetSettings], controlled: Sequence[OnsetSettings]
) -> Demonstration:
    """Cut one recording from the human's onset until both agents rest, with given thresholds."""
    start_ns, end_ns = movement_span(
        recorded.observed,
        recorded.controlled,
        observed,
        controlled,
        recorded.start_ns,
        recorded.end_ns,
    )
    return replace(recorded, start_ns=start_ns, end_ns=end_ns)
