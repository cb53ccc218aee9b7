# SPDX-License-Identifier: Apache-2.0
"""Exponents of the evidence for the duration and for the task, by held-out validation.

Duration: left-out demonstrations are filtered under several durations, as online. The exponent of
the evidence and the coupling of the residuals (`learning.coupling`) are those under which the
controlled agent is predicted best at true times.

Task: where the model does not fit a person, the innovations of a movement are correlated, and their
product counts evidence several times: n of them are worth only a share a of n independent ones. The
evidence for the task is therefore raised to the power a, which has a uniform prior on (0, 1]. Its
log likelihood is minus the log loss of each left-out demonstration's own task, averaged over the
movement because the samples of a movement are not independent either. The posterior mean of a is
used, since a few demonstrations that are all recognised say little about it.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import softmax

from intent_recognition.array_types import Floats, Integers
from intent_recognition.filtering import duration_offsets
from intent_recognition.gaussian import Gaussian
from intent_recognition.learning.coupling import HeldOutResiduals, learn_coupling
from intent_recognition.learning.examples import scored_phases
from intent_recognition.learning.held_out import (
    Followed,
    batches_of,
    filter_samples,
    predict_agents,
    samples_at,
)
from intent_recognition.learning.held_out_examples import LeftOutExample
from intent_recognition.learning.hyperparameters import EXPONENTS, clearly_best
from intent_recognition.promp import ResidualCoupling, TaskLibrary

N_DURATIONS = 7
"""Number of durations under which a demonstration is filtered; bounds computing time."""
POWERS = np.linspace(0.1, 1.0, 10)
"""Values of the exponent a that are tried, evenly spaced up to 1 (docs/decisions/new_people.md)."""


def follow_durations(
    library: TaskLibrary, left_out: Sequence[LeftOutExample]
) -> Iterator[Followed]:
    """Filter left-out demonstrations under S durations of their own task.

    Yields:
        The hypotheses after each sample.
    """
    offsets, _ = duration_offsets(N_DURATIONS)
    size, task = library.n_observed_weights, [one.task for one in left_out]
    log_usual = np.array([one.log_duration for one in left_out])[:, None]
    log_usual = log_usual + library.log_duration_std[task][:, None] * offsets
    pace = np.array([one.duration_s for one in left_out])[:, None] / np.exp(log_usual)
    own = np.arange(pace.size).reshape(pace.shape)
    relative = np.exp(log_usual) / library.usual_s[task][:, None]
    n_others = np.maximum(library.n_demonstrations[task] - 1, 1)
    mean = np.array([one.mean[:size] for one in left_out])
    covariance = np.array([one.covariance for one in left_out])
    covariance = covariance * (1.0 + 1.0 / n_others)[:, None, None]
    values = np.array([one.observed for one in left_out])
    mean, covariance, values = (
        np.repeat(part, N_DURATIONS, axis=0) for part in (mean, covariance, values)
    )
    samples, prior = np.swapaxes(values, 0, 1), Gaussian(mean, covariance)
    for progress in filter_samples(library, prior, pace.ravel(), relative.ravel(), samples):
        yield Followed(progress, own, pace, relative)


def follow(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], shares: Sequence[float]
) -> tuple[Floats, Floats, Floats]:
    """Log evidence of S durations of n left-out demonstrations after each of f shares, (f, n, S).

    Also returns the means of both agents at the scored phases, (f, n, S, s, P) and
    (f, n, S, s, Q).
    """
    evidence, observed, controlled = [], [], []
    for followed in follow_durations(library, left_out):
        if followed.progress.n_samples in samples_at(shares):
            evidence.append(followed.progress.log_evidence[followed.own])
            human, robot = predict_agents(library, left_out, followed)
            observed.append(human)
            controlled.append(robot)
    return np.array(evidence), np.array(observed), np.array(controlled)


def duration_weights(log_evidence: Floats, exponent: float) -> Floats:
    """Posterior probabilities of the durations under an exponent, from log evidence (..., S)."""
    log_weight = duration_offsets(N_DURATIONS)[1] + exponent * log_evidence
    return np.asarray(softmax(log_weight, axis=-1))


def choose_duration_evidence(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    shares: Sequence[float],
    variance: Floats,
) -> tuple[float, ResidualCoupling]:
    """Choose the exponent of the duration's evidence, with the coupling of the residuals.

    The default exponent is kept unless another is clearly better.

    Args:
        library: provides basis, noise and timing.
        left_out: the demonstrations.
        shares: shares of the movement after which it is predicted, (f,).
        variance: divides the squared errors of the controlled DOFs, (Q,).
    """
    parts = [follow(library, some, shares) for some in batches_of(library, left_out, N_DURATIONS)]
    log_evidence, observed, controlled = (
        np.concatenate(part, axis=1) for part in zip(*parts, strict=True)
    )
    tasks = np.array([one.task for one in left_out])
    couplings, errors = [], []
    for exponent in EXPONENTS:
        weight = duration_weights(log_evidence, exponent)
        human, robot = (
            np.einsum("fnh,fnhsd->fnsd", weight, path) for path in (observed, controlled)
        )
        residuals = HeldOutResiduals(
            tasks,
            scored_phases(),
            np.array(shares),
            np.array([one.seen for one in left_out]) - human,
            np.array([one.truth for one in left_out]) - robot,
        )
        coupling, left = learn_coupling(residuals, variance, library.durations_s)
        couplings.append(coupling)
        errors.append(np.mean(left / variance, axis=(0, 2)))
    chosen = clearly_best(np.array(errors))
    return EXPONENTS[chosen], couplings[chosen]


def log_losses(log_evidence: Floats, own: Integers) -> Floats:
    """Log loss of each demonstration's own task under each of `POWERS`, (A, n).

    Args:
        log_evidence: log evidence of the tasks that each demonstration is compared with, one
            demonstration after the other, (h,).
        own: indices of the own tasks, each the first of its demonstration, (n,).
    """
    counted = POWERS[:, None] * log_evidence
    return np.asarray(np.logaddexp.reduceat(counted, own, axis=1) - counted[:, own])


def expected_power(losses: Floats) -> float:
    """Posterior mean of the exponent a, from log losses of left-out demonstrations, (A, n)."""
    log_likelihood = -losses.sum(axis=1)
    weight = np.exp(log_likelihood - log_likelihood.max())
    return float(weight @ POWERS / weight.sum())
