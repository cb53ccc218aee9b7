# SPDX-License-Identifier: Apache-2.0
"""A Gaussian mixture: density, responsibilities, conditioning, moments; and how it is fitted.

Fits start from the clusters of k-means, run many times from k-means++ centres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, Integers, brief
from intent_recognition.errors import ArgumentError, ShapeError, check_whole
from intent_recognition.gaussian.linalg import symmetrize
from intent_recognition.gaussian.mixture import CovariancePrior, fit_mixture, one_hot
from intent_recognition.gaussian.normal import Gaussian, condition, log_density

RELATIVE_FLOOR = 1e-6
"""Default variance floor, relative to the mean variance of the points. It bounds the condition
number where a component has fewer points than dimensions, and is far below any measurement noise.
"""


@brief
@dataclass(frozen=True)
class GaussianMixture:
    """A mixture of K Gaussians over vectors (d,).

    Attributes:
        weights: mixture weights p(k), (K,), which sum to one.
        components: the K Gaussians p(w | k), each over vectors (d,).

    Raises:
        ShapeError: there are not as many weights as components.
        ArgumentError: the weights are not probabilities that sum to one.
    """

    weights: Floats
    components: tuple[Gaussian, ...]

    def __post_init__(self) -> None:
        weights = np.array(self.weights, dtype=np.float64)
        if weights.shape != (len(self.components),):
            cure = "Give one weight per component."
            expected = f"shape ({len(self.components)},)"
            raise ShapeError.about("weights", expected, weights.shape, cure)
        if not (np.all(weights >= 0) and abs(float(weights.sum()) - 1.0) < 1e-6):
            cure = "Divide the weights by their sum."
            raise ArgumentError.about("weights", "probabilities that sum to one", weights, cure)
        weights.setflags(write=False)
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "components", tuple(self.components))

    @property
    def n_components(self) -> int:
        """Number of components K."""
        return len(self.components)

    @property
    def most_probable(self) -> Gaussian:
        """Component with the largest weight (Ewerton et al. 2015, Eq. 12)."""
        return self.components[int(np.argmax(self.weights))]

    @property
    def moments(self) -> Gaussian:
        """Mean and covariance of the whole mixture (Ewerton et al. 2015, Eq. 14)."""
        means, covariances = (np.array(part) for part in zip(*self.components, strict=True))
        mean = self.weights @ means
        apart = (means - mean) * np.sqrt(self.weights)[:, None]
        within = np.tensordot(self.weights, covariances, axes=1)
        return Gaussian(mean, symmetrize(within + apart.T @ apart))

    def log_density(self, points: ArrayLike) -> Floats:
        """Log density (n,) of points (n, d)."""
        return np.asarray(np.logaddexp.reduce(self._log_joint(points), axis=1))

    def responsibilities(self, points: ArrayLike) -> Floats:
        """Responsibilities p(k | point), (n, K), for points (n, d) (Ewerton et al. 2015, Eq. 7)."""
        joint = self._log_joint(points)
        return np.asarray(np.exp(joint - np.logaddexp.reduce(joint, axis=1)[:, None]))

    def condition(
        self, observation_matrix: Floats, observation: Floats, noise_covariance: Floats
    ) -> tuple[GaussianMixture, float]:
        """Condition on y = H w + noise (Ewerton et al. 2015, Eq. 11-14).

        Every component is conditioned, and its weight multiplied by its evidence. Eq. 13 as printed
        integrates over p(w | k*); it should be the posterior, p(w | k*, D).

        Args:
            observation_matrix: H, (m, d).
            observation: y, (m,).
            noise_covariance: R, (m, m), positive definite.

        Returns:
            The posterior mixture and the log evidence log p(y).

        Raises:
            ShapeError: H, y and R do not fit the components.
            ArgumentError: an innovation covariance is not positive definite.
        """
        conditioned = [
            condition(component, observation_matrix, observation, noise_covariance)
            for component in self.components
        ]
        with np.errstate(divide="ignore"):
            log_joint = np.log(self.weights) + np.array([evidence for _, evidence in conditioned])
        log_evidence = np.logaddexp.reduce(log_joint)
        posterior = GaussianMixture(
            np.exp(log_joint - log_evidence), tuple(component for component, _ in conditioned)
        )
        return posterior, float(log_evidence)

    def _log_joint(self, points: ArrayLike) -> Floats:
        """log p(k) + log p(point | k), (n, K)."""
        points = _checked_points(points, len(self.components[0].mean))
        density = [[log_density(part, point) for part in self.components] for point in points]
        with np.errstate(divide="ignore"):
            return np.log(self.weights) + np.array(density).reshape(len(points), -1)


def fit_gaussian_mixture(
    points: ArrayLike,
    n_components: int,
    rng: np.random.Generator,
    *,
    n_starts: int = 10,
    variance_floor: float | None = None,
) -> GaussianMixture:
    """Fit a mixture by expectation maximisation.

    Ewerton et al. 2015, Eq. 7-10, Algorithm 1. EM runs from `n_starts` results of k-means in one
    batch; the fit of the highest likelihood is kept. To find the tasks in demonstrations, use
    `learn_mixture`: it regularises the components and chooses their number.

    Args:
        points: (n, d).
        n_components: K, at most n.
        rng: source of the k-means++ centres.
        n_starts: number of runs of k-means.
        variance_floor: added to every variance, in the squared unit of the points; by default
            `RELATIVE_FLOOR` times the mean variance of the points.

    Raises:
        ShapeError: the points are not an array (n, d).
        ArgumentError: a point is not finite, or there are fewer points than components.
    """
    points = _checked_points(points)
    check_whole("n_components", n_components, 1, "There are no more points.", len(points))
    if variance_floor is None:
        variance_floor = RELATIVE_FLOOR * (float(np.mean(np.var(points, axis=0))) or 1.0)
    if not (np.isfinite(variance_floor) and variance_floor > 0):
        cure = "Pass None to derive it from the points."
        raise ArgumentError.about("variance_floor", "a positive number", variance_floor, cure)
    centred = points - points.mean(axis=0)
    starts = np.unique(kmeans_starts(centred, n_components, n_starts, rng), axis=0)
    fits = fit_mixture(
        centred, one_hot(starts, n_components), CovariancePrior(floor=variance_floor)
    )
    best = int(np.argmax(fits.log_likelihood))
    found = fits.components
    mean = found.mean[best] + points.mean(axis=0)
    parts = zip(mean, found.covariance(centred)[best], strict=True)
    weights = np.exp(found.log_weight[best])
    return GaussianMixture(weights / weights.sum(), tuple(Gaussian(m, c) for m, c in parts))


def _checked_points(points: ArrayLike, n_dimensions: int | None = None) -> Floats:
    """Points as an array (n, d), checked to be finite."""
    checked = np.asarray(points, dtype=np.float64)
    if checked.ndim != 2 or n_dimensions not in (None, checked.shape[1]):
        expected = f"shape (n, {'d' if n_dimensions is None else n_dimensions})"
        raise ShapeError.about("points", expected, checked.shape, "Give one row per point.")
    if not np.all(np.isfinite(checked)):
        cure = "Leave such points out."
        raise ArgumentError.about("points", "finite numbers", "NaN or infinity", cure)
    return checked


def kmeans_starts(
    points: Floats, n_components: int, n_starts: int, rng: np.random.Generator
) -> Integers:
    """Labels of n points (n, r) from `n_starts` independent runs of k-means, (n_starts, n).

    Centres are drawn by k-means++ (Arthur and Vassilvitskii 2007): the probability of a point is
    proportional to its squared distance from the nearest centre so far. A cluster that loses all
    its points takes the point farthest from its own centre, if there are enough different points.
    """
    n = len(points)
    squares = np.sum(points**2, axis=1)
    distance = np.maximum(squares[:, None] + squares - 2.0 * points @ points.T, 0.0)
    labels = np.empty((n_starts, n), dtype=np.int64)
    for start in range(n_starts):
        centers = _plus_plus(distance, n_components, rng)
        labels[start] = np.argmin(distance[centers], axis=0)
        for _ in range(10):  # enough: EM refines the result
            moved = _lloyd(distance, labels[start], n_components)
            if np.array_equal(moved, labels[start]):
                break
            labels[start] = moved
    return labels


def _plus_plus(distance: Floats, n_components: int, rng: np.random.Generator) -> list[int]:
    """Indices of the points that k-means++ draws as centres, given squared distances (n, n)."""
    centers = [int(rng.integers(len(distance)))]
    nearest = distance[centers[0]].copy()
    for _ in range(n_components - 1):
        total = nearest.sum()
        if not total > 0:  # fewer different points than components
            break
        centers.append(int(rng.choice(len(distance), p=nearest / total)))
        nearest = np.minimum(nearest, distance[centers[-1]])
    return centers


def _lloyd(distance: Floats, labels: Integers, n_components: int) -> Integers:
    """Labels after one step of k-means, computed from the squared distances of the points alone."""
    share = (labels == np.arange(n_components)[:, None]).astype(float)
    count = share.sum(axis=1)
    share /= np.maximum(count, 1.0)[:, None]
    mixed = share @ distance
    inner = 0.5 * np.sum(mixed * share, axis=1)
    to_center = np.where((count > 0)[:, None], mixed - inner[:, None], np.inf)
    moved = np.argmin(to_center, axis=0)
    own = to_center[moved, np.arange(len(moved))]
    for empty in np.setdiff1d(np.arange(n_components), moved):
        farthest = int(np.argmax(own))
        if own[farthest] <= 0 or np.sum(moved == moved[farthest]) == 1:
            break
        moved[farthest], own[farthest] = empty, 0.0
    return moved
