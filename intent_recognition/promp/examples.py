# SPDX-License-Identifier: Apache-2.0
"""One recording as an example to learn from: cut to the movement, turned into weights."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from intent_recognition.alignment.segment import movement_span, onset_settings
from intent_recognition.errors import TrainingError, describe
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.selection import SCORED_PHASES
from intent_recognition.promp.signals import Signal
from intent_recognition.promp.weights import MIN_SAMPLES, fit_weights

SAMPLES_PER_MOVEMENT = 30
"""Samples of one movement that count as independent evidence; denser ones share it."""
MIN_DURATION_S = 0.2


class Recorded(Protocol):
    """What training needs of a demonstration, a dataclass (`storage.Demonstration` has it)."""

    name: str
    task: str | None
    observed: tuple[Signal, ...]
    controlled: tuple[Signal, ...]
    start_ns: int
    end_ns: int


class Example(NamedTuple):
    """One demonstration as weights.

    Attributes:
        name: of the recording.
        task: its label.
        weights: (D, N), observed DOFs first.
        residual_variance: (D,).
        duration_s: of the interaction.
        observed: samples at evenly spaced phases, (m, P).
        controlled: at the scored phases, (s, Q).
    """

    name: str
    task: str
    weights: np.ndarray
    residual_variance: np.ndarray
    duration_s: float
    observed: np.ndarray
    controlled: np.ndarray


def sample_phases() -> np.ndarray:
    """Phases of the samples that hyperparameters are scored on, (m,)."""
    return (np.arange(SAMPLES_PER_MOVEMENT) + 0.5) / SAMPLES_PER_MOVEMENT


def scored_phases() -> np.ndarray:
    """Phases at which the controlled agent's prediction is scored, (s,)."""
    return np.linspace(0.0, 1.0, SCORED_PHASES)


def make_example(recorded: Recorded, basis: NormalizedRBFBasis, ridge: float) -> Example:
    """Weights of one demonstration from its start to its end.

    Raises:
        TrainingError: too short, or a DOF has too few samples.
    """
    start_ns, end_ns = recorded.start_ns, recorded.end_ns
    duration = (end_ns - start_ns) * 1e-9
    if duration < MIN_DURATION_S:
        raise TrainingError(
            describe(
                "demonstration", f"at least {MIN_DURATION_S} s", f"{duration:.3f} s", "Re-record."
            )
        )
    weights, residuals, samples = [], [], {True: [], False: []}
    for observed, signal in [(True, s) for s in recorded.observed] + [
        (False, s) for s in recorded.controlled
    ]:
        part = signal.between(start_ns, end_ns)
        if len(part.stamps_ns) < MIN_SAMPLES:
            raise TrainingError(
                describe(
                    ", ".join(signal.names),
                    f"at least {MIN_SAMPLES} samples during the movement",
                    len(part.stamps_ns),
                    "Record it again, or leave it out.",
                )
            )
        phase = part.seconds(start_ns) / duration
        fit = fit_weights(basis, phase, part.values, ridge)
        weights.append(fit.weights)
        residuals.append(fit.residual_variance)
        at = sample_phases() if observed else scored_phases()
        samples[observed].append(
            np.stack([np.interp(at, phase, column) for column in part.values.T], axis=1)
        )
    return Example(
        recorded.name,
        str(recorded.task),
        np.vstack(weights),
        np.concatenate(residuals),
        duration,
        np.hstack(samples[True]),
        np.hstack(samples[False]),
    )


def cut_to_movement(demonstrations: Sequence[Recorded]) -> list[Recorded]:
    """The same recordings, each from the human's onset to both agents' rest.

    Thresholds come from the recordings themselves; the onset is found as it would be online.
    """
    if not demonstrations:
        return []
    observed = onset_settings([recorded.observed for recorded in demonstrations])
    controlled = onset_settings([recorded.controlled for recorded in demonstrations])
    spans = [
        movement_span(r.observed, r.controlled, observed, controlled, r.start_ns, r.end_ns)
        for r in demonstrations
    ]
    return [
        replace(recorded, start_ns=start, end_ns=end)
        for recorded, (start, end) in zip(demonstrations, spans, strict=True)
    ]
