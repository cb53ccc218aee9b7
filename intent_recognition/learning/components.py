# SPDX-License-Identifier: Apache-2.0
"""Choose the number of mixture components by left-out prediction of the controlled agent.

Every demonstration is left out in turn, the mixture is fitted to the rest, and the controlled
agent's trajectory is predicted from the observed agent's. The score is the mean negative log
density of the true trajectory. The smallest number of components within one paired standard error
of the best is chosen (Ewerton et al. 2015 choose it from a curve of errors).
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import check_whole
from intent_recognition.gaussian import (
    EMPTY,
    Components,
    CovariancePrior,
    batches,
    cholesky,
    half_log_det,
    solve_lower,
    student_log_density,
)
from intent_recognition.learning.mixture import MIN_MEMBERS, Features, cluster

MAX_COMPONENTS = 10
"""Largest number of components tried (docs/mixture.md)."""


class ComponentTrial(NamedTuple):
    """Labels and left-out score of one number of components."""

    n_components: int  # K
    labels: Integers  # component of each demonstration, (n,)
    nll: Floats  # left-out negative log density of the controlled agent, nats per sample, (n,)
    rmse: Floats  # left-out RMS error of the mean, in standard deviations of the DOFs, (n,)


class ComponentChoice(NamedTuple):
    """The trial with the chosen number of components, and all trials."""

    chosen: ComponentTrial
    tried: tuple[ComponentTrial, ...]

    @property
    def n_components(self) -> int:
        """Number of components with members; fewer than requested if some are empty."""
        return int(self.chosen.labels.max()) + 1


class LeftOutPrediction(NamedTuple):
    """Left-out predictions of n demonstrations, component by component."""

    log_posterior: Floats  # log p(k | observed trajectory), (n, K)
    mean: Floats  # of the controlled trajectory given component and observed trajectory, (n, K, s)
    variance: Floats  # squared scale of the Student t distribution of a value, (n, K, s)
    freedom: Floats  # degrees of freedom of that distribution, (n, K)


def choose_components(
    features: Features,
    rng: np.random.Generator,
    *,
    max_components: int = MAX_COMPONENTS,
    progress: Callable[[int], None] = lambda done: None,
) -> ComponentChoice:
    """Choose the smallest number of components within one standard error of the best prediction.

    Args:
        features: the demonstrations.
        rng: draws the starts of EM.
        max_components: largest number to try; fewer if components would lack `MIN_MEMBERS`.
        progress: called with each number tried.
    """
    largest = max(1, min(max_components, len(features.coordinates) // MIN_MEMBERS))
    tried = []
    for n_components in range(1, largest + 1):
        tried.append(try_components(features, n_components, rng))
        progress(n_components)
    taken = smallest_within_one_error(np.array([t.nll for t in tried]))
    return ComponentChoice(tried[taken], tuple(tried))


def try_components(
    features: Features, n_components: int, rng: np.random.Generator
) -> ComponentTrial:
    """Fit K components and score their left-out predictions."""
    n = len(features.coordinates)
    check_whole("n_components", n_components, 1, "There are no more demonstrations.", n)
    found = cluster(features, n_components, rng)
    if n < 2 or not features.loadings.size:  # nothing to leave out, or nothing to predict
        return ComponentTrial(n_components, found.labels, np.zeros(n), np.zeros(n))
    nll, rmse = np.empty(n), np.empty(n)
    each = found.left_out.rows[0].size * features.controlled.shape[1]
    for part in batches(n, each):
        prediction = predict_left_out(features, found.left_out, features.prior, part)
        nll[part], rmse[part] = score(prediction, features.controlled[part])
    return ComponentTrial(n_components, found.labels, nll, rmse)


def predict_left_out(
    features: Features, left_out: Components, prior: CovariancePrior, part: slice = slice(None)
) -> LeftOutPrediction:
    """Predict each demonstration's controlled trajectory from its observed one.

    The covariance of a component with few members is uncertain. Its prior is taken as inverse
    Wishart, so a left-out demonstration has a Student t distribution. Mixture i was fitted without
    demonstration i. Only the demonstrations in `part` are predicted.
    """
    split, points = features.n_observed, features.coordinates
    components = left_out.select(part)
    count = np.maximum(components.count, EMPTY)
    root = np.sqrt(components.row_weight)[..., None]
    diagonal = components.diagonal[..., :split]
    members = points[components.rows, :split] - components.mean[:, :, None, :split]
    members *= root / np.sqrt(diagonal)[:, :, None]
    error = (points[part, None, :split] - components.mean[..., :split]) / np.sqrt(diagonal)
    gram = members @ np.swapaxes(members, 2, 3)
    gram[..., np.arange(gram.shape[-1]), np.arange(gram.shape[-1])] += 1.0
    factor = cholesky(gram, name="observed covariance of a component")
    means = (components.mean[..., split:] @ features.loadings)[:, :, None]
    deviations = (features.controlled[components.rows] - means) * root
    right = np.concatenate([(members @ error[..., None]), deviations], axis=3)
    white = solve_lower(factor, right)
    squared = np.sum(error**2, axis=2) - np.sum(white[..., 0] ** 2, axis=2)
    mean = means[:, :, 0] + np.einsum("nkm,nkms->nks", white[..., 0], white[..., 1:])
    variance = np.sum(white[..., 1:] ** 2, axis=2)
    variance += components.diagonal[..., split:] @ features.loadings**2
    freedom = prior.strength + count + 1.0
    scale = (count + prior.strength) * (1.0 + 1.0 / count) / freedom
    log_scale = half_log_det(factor) + 0.5 * np.log(diagonal * scale[..., None]).sum(axis=2)
    density = student_log_density(squared / scale, log_scale, split, freedom)
    evidence = components.log_weight + density
    inflation = scale * (freedom + squared / scale) / (freedom + split)
    return LeftOutPrediction(
        evidence - np.logaddexp.reduce(evidence, axis=1)[:, None],
        mean,
        variance * inflation[..., None],
        freedom + split,
    )


def score(prediction: LeftOutPrediction, truth: Floats) -> tuple[Floats, Floats]:
    """Negative log density per sample and RMS error of the mixture's mean, (n,) each.

    `truth` holds the true controlled trajectories, (n, s).
    """
    squared = (truth[:, None] - prediction.mean) ** 2 / prediction.variance
    log_scale, freedom = 0.5 * np.log(prediction.variance), prediction.freedom[..., None]
    density = student_log_density(squared, log_scale, 1, freedom)
    nll = -np.logaddexp.reduce(prediction.log_posterior + density.mean(axis=2), axis=1)
    mean = np.einsum("nk,nks->ns", np.exp(prediction.log_posterior), prediction.mean)
    n_samples = truth.shape[1]
    # Trajectories were divided by the root of their number of samples.
    rmse = np.sqrt(np.sum((mean - truth) ** 2, axis=1))
    return nll + 0.5 * np.log(n_samples), rmse


def smallest_within_one_error(scores: Floats) -> int:
    """Index of the first candidate within one paired standard error of the best; scores (c, n)."""
    best = int(np.argmin(scores.mean(axis=1)))
    if scores.shape[1] < 2:
        return 0
    excess = scores - scores[best]
    error = excess.std(axis=1, ddof=1) / np.sqrt(scores.shape[1])
    return int(np.flatnonzero(excess.mean(axis=1) <= error)[0])


def purity(labels: Sequence[object], components: NDArray[np.integer[Any]]) -> float:
    """Share of demonstrations whose label is the most frequent one of their component."""
    _, number = np.unique(np.array([str(label) for label in labels]), return_inverse=True)
    most = [np.bincount(number[components == k]).max() for k in np.unique(components)]
    return float(np.sum(most) / len(components))
