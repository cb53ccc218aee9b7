# SPDX-License-Identifier: Apache-2.0
"""Fit one task's interaction primitive alone: no timing, unknown movements or validation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from intent_recognition.errors import ArgumentError, TrainingError, number
from intent_recognition.gaussian import Gaussian
from intent_recognition.learning.examples import make_example
from intent_recognition.learning.fitting import predictive_covariances
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.statistics import summarize, variance_scales
from intent_recognition.promp import InteractionProMP, NormalizedRBFBasis
from intent_recognition.signals import Demonstration, numbered


def fit_interaction_promp(
    demonstrations: Sequence[Demonstration],
    *,
    basis: NormalizedRBFBasis | None = None,
    ridge: float = TrainingSettings.ridge,
    strength: float = 10.0,
) -> InteractionProMP:
    """Fit the joint Gaussian over both agents' weights to demonstrations of one task.

    The phase runs evenly from 0 to 1 between the start and the end of each demonstration; use
    `cut_to_movement` if recordings begin or end at rest. The sample covariance (Maeda et al.
    2014, Eq. 5) is shrunk toward a structured target (`promp.structured_target`), because few
    demonstrations leave it singular. `learn` fits all tasks at once.

    Args:
        demonstrations: two or more with the same DOFs, all of one task.
        basis: basis functions of each DOF; None for the default of `learn`.
        ridge: relative curvature penalty of the weights' regression.
        strength: equivalent sample size of the target, in demonstrations, positive.

    Raises:
        TrainingError: there are fewer than two demonstrations, they lack one of the agents, or one
            is too short or has too few samples.
        ArgumentError: the demonstrations differ in their DOFs or tasks, or `strength` or `ridge`
            is not positive.
    """
    if not number(strength) > 0:
        raise ArgumentError.about("strength", "a positive number", strength, "Try 10.")
    demonstrations = [*numbered(demonstrations)]
    if len(demonstrations) < 2:
        got, cure = len(demonstrations), "A covariance takes more than one; record more."
        raise TrainingError.about("demonstrations", "two or more", got, cure)
    if not (demonstrations[0].observed and demonstrations[0].controlled):
        expected, alone = "signals of both agents", "signals of one agent"
        cure = "Record the other one, too."
        raise TrainingError.about("demonstrations", expected, alone, cure)
    for demonstration in demonstrations[1:]:
        _check_alike(demonstrations[0], demonstration)
    if basis is None:
        basis = NormalizedRBFBasis(TrainingSettings.n_basis, TrainingSettings.width)
    task = summarize([make_example(recorded, basis, ridge) for recorded in demonstrations])
    signals = (*demonstrations[0].observed, *demonstrations[0].controlled)
    units = [signal.unit for signal in signals for _ in signal.names]
    floor, noise = variance_scales({"": task}, units)
    (covariance,) = predictive_covariances({"": task}, strength, floor)
    return InteractionProMP(
        basis,
        Gaussian(task.mean.ravel(), covariance),
        sum(len(signal.names) for signal in demonstrations[0].observed),
        noise,
        float(np.exp(task.log_duration_mean)),
    )


def _check_alike(first: Demonstration, other: Demonstration) -> None:
    """Refuse demonstrations of several tasks or DOFs."""
    for argument, expected, got in (
        ("task", first.task, other.task),
        ("observed DOFs", *([s.names for s in d.observed] for d in (first, other))),
        ("controlled DOFs", *([s.names for s in d.controlled] for d in (first, other))),
    ):
        if expected != got:
            raise ArgumentError.about(
                f"{argument} of {other.name}",
                f"{expected} as in {first.name}",
                got,
                "Pass demonstrations of one task with the same DOFs; `learn` takes several.",
            )
