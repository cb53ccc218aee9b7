# SPDX-License-Identifier: Apache-2.0
"""Uncertainty of a task's regression, from left-out demonstrations.

The controlled weights given the observed ones are N(A w_o + b, C), and A is estimated from perhaps
a dozen demonstrations. If its coefficients are normal with covariance r C (x) S_oo^-1, a prediction
from w_o has the covariance C (1 + r E[(w_o - mu_o)^T S_oo^-1 (w_o - mu_o)]): the farther a person
is from the demonstrations, the less certain is the robot's movement (the predictive distribution of
Bayesian linear regression; Bishop 2006, Eq. 3.59). Validation chooses r by the log density of
left-out demonstrations; where whole people are left out, these are demonstrations of new people.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import expected_distance
from intent_recognition.learning.examples import scored_phases
from intent_recognition.learning.held_out import (
    batches_of,
    expected_rows,
    follow_known,
    predict_agents,
    samples_at,
)
from intent_recognition.learning.held_out_examples import LeftOutExample
from intent_recognition.learning.hyperparameters import REGRESSION_VARIANCES, clearly_best
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import TaskLibrary


def choose_regression_variance(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    tasks: Mapping[str, TaskStatistics],
    shares: Sequence[float],
) -> float:
    """Choose the variance of the coefficients under which the controlled agent is most probable.

    The first value is kept unless another is clearly better. See `choose_duration_evidence`;
    `tasks` are the statistics of each label.
    """
    parts = [
        _losses(library, some, tasks, samples_at(shares)) for some in batches_of(library, left_out)
    ]
    return REGRESSION_VARIANCES[clearly_best(np.concatenate(parts, axis=1))]


def _losses(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    tasks: Mapping[str, TaskStatistics],
    numbers: Sequence[int],
) -> Floats:
    """Twice the mean negative log density of each demonstration under each variance, (r, n)."""
    size, n = library.n_observed_weights, len(left_out)
    shape = n, library.n_controlled, library.basis.n_basis
    gain = np.array([one.rule.matrix for one in left_out]).reshape(*shape, size)
    usual = np.array([one.mean[:size] for one in left_out])
    precision = np.array([np.linalg.inv(one.joint[:size, :size]) for one in left_out])
    given = np.array([one.rule.covariance for one in left_out]).reshape(*shape, *shape[1:])
    given = np.einsum("nqkql->nqkl", given)
    truth, losses = np.array([one.truth for one in left_out]), []
    for followed in follow_known(library, left_out, tasks):
        if followed.progress.n_samples not in numbers:
            continue
        _, predicted = predict_agents(library, left_out, followed)
        _, rows = expected_rows(library, left_out, followed, scored_phases())
        mean, covariance = followed.progress.weights.moments(followed.own[:, 0])
        response = np.einsum("nsk,nqkp->nsqp", rows, gain).reshape(n, -1, size)
        mapped = np.sum((response @ covariance) * response, axis=2).reshape(truth.shape)
        certain = mapped + library.control_noise_variance()
        left = np.einsum("nsk,nqkl,nsl->nsq", rows, given, rows, optimize=True)
        distance = expected_distance(precision, mean - usual, covariance)[:, None, None]
        variance = [certain + (1.0 + r * distance) * left for r in REGRESSION_VARIANCES]
        square = (truth - predicted[:, 0]) ** 2
        losses.append([np.mean(np.log(v) + square / v, axis=(1, 2)) for v in variance])
    return np.mean(losses, axis=0)
