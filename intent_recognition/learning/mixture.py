# SPDX-License-Identifier: Apache-2.0
"""Mixture of interaction primitives from demonstrations without labels (Ewerton et al. 2015).

Each demonstration's weights describe a trajectory of every DOF. These trajectories, sampled at
evenly spaced phases, are scaled to common units and expressed in orthonormal coordinates of the
affine span of all demonstrations, separately for each agent. The mixture is fitted there.
"""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import TrainingError
from intent_recognition.gaussian import (
    Components,
    CovariancePrior,
    MixtureFit,
    affine_span,
    batches,
    fit_mixture,
    kmeans_starts,
    log_joint,
    one_hot,
)
from intent_recognition.promp import NormalizedRBFBasis

BASIS = NormalizedRBFBasis(30, 1.0)
"""Basis functions of the trajectories that are clustered. There are more than in `learn`: a waved
and a shaken hand differ in the fast part of the movement (docs/mixture.md)."""
RIDGE = 1e-3
"""Relative curvature penalty of these trajectories, weaker than in `learn` for the same reason."""
SAMPLED_PHASES = 40
"""Phases at which trajectories are compared (docs/mixture.md)."""
STRENGTH, SHARED = 24.0, 5.0
"""Equivalent sample sizes, in demonstrations, of the diagonal target of a component's covariance,
and of the components' pooled variance in this target (docs/mixture.md)."""
MIN_MEMBERS = 3
"""Fewest demonstrations of a component: with one left out, two remain to estimate a variance."""
MAX_FOLDS = 100
"""Up to this number, each demonstration is left out alone; beyond it, every hundredth together.
Bounds computing time."""
MAX_DEMONSTRATIONS = 2000
"""Most demonstrations that a mixture is fitted to; bounds memory and computing time."""
REASSIGNMENTS = 10
"""Most rounds of reassigning demonstrations by left-out mixtures; bounds computing time."""


class Features(NamedTuple):
    """n demonstrations in the coordinates in which the mixture is fitted."""

    coordinates: Floats  # the observed agent's come first, (n, r)
    n_observed: int  # number of the observed agent's coordinates
    controlled: Floats  # scaled trajectories of the controlled agent less their mean, (n, s)
    loadings: Floats  # `controlled = coordinates[:, n_observed:] @ loadings`, (r - n_observed, s)

    @property
    def prior(self) -> CovariancePrior:
        """The default prior of the components' covariances, with a floor of 1 % of their mean."""
        variance = float(np.mean(self.coordinates**2)) if self.coordinates.size else 1.0
        return CovariancePrior(1e-2 * (variance or 1.0), STRENGTH, SHARED)


def mixture_features(weights: Floats, n_observed: int, basis: NormalizedRBFBasis) -> Features:
    """Coordinates of demonstrations for a mixture, from weights (n, D, N), observed DOFs first.

    Scaling: every DOF is divided by its standard deviation over all demonstrations and phases (one
    that never varies is left alone), and every agent by the square root of its number of values, so
    that units and numbers of DOFs do not matter.

    Raises:
        TrainingError: no demonstrations, or too many.
    """
    if not 0 < len(weights) <= MAX_DEMONSTRATIONS:
        expected = f"1 to {MAX_DEMONSTRATIONS} to find components in"
        cure = "Use a part of them and label the rest with the resulting model."
        raise TrainingError.about("demonstrations", expected, len(weights), cure)
    trajectories = weights @ basis.design_matrix(np.linspace(0.0, 1.0, SAMPLED_PHASES)).T
    deviations = trajectories - trajectories.mean(axis=0)
    std = np.sqrt(np.mean(deviations**2, axis=(0, 2)))
    negligible = std <= 1e-9 * np.abs(trajectories).max(axis=(0, 2), initial=0.0)
    deviations /= np.where(negligible, 1.0, std)[:, None]
    deviations[:, negligible] = 0.0
    spans = []
    for part in (deviations[:, :n_observed], deviations[:, n_observed:]):
        flat = part.reshape(len(part), -1)
        spans.append(affine_span(flat / np.sqrt(max(flat.shape[1], 1))))
    observed, controlled = spans
    return Features(
        np.hstack([observed.coordinates, controlled.coordinates]),
        observed.coordinates.shape[1],
        controlled.coordinates @ controlled.axes,
        controlled.axes,
    )


class Clustering(NamedTuple):
    """The best of many fits with K components."""

    labels: Integers  # component of each demonstration, (n,)
    log_likelihood: float  # mean log likelihood of a demonstration
    left_out: Components  # for each demonstration, the mixture fitted without it, a batch of n


def cluster(features: Features, n_components: int, rng: np.random.Generator) -> Clustering:
    """Fit a mixture from many starts and keep the likeliest without small components.

    A fit with a component of fewer than `MIN_MEMBERS` is kept only if every start led to one: the
    likelihood favours components that hold a single outlier. In many dimensions, a demonstration
    also stays in a component because it shaped it. Each one is therefore reassigned by the mixture
    fitted without it, and EM is restarted from the new labels as long as the likelihood rises.
    """
    points, prior = features.coordinates, features.prior
    n_starts = 30 if n_components > 1 else 1
    starts = np.unique(kmeans_starts(points, n_components, n_starts, rng), axis=0)
    fits = fit_mixture(points, one_hot(starts, n_components), prior)
    ranks = [_rank(fits, b, n_components) for b in range(len(starts))]
    best = max(range(len(starts)), key=lambda b: ranks[b])
    labels, value = fits.labels[best], ranks[best]
    left_out = leave_each_out(points, labels, n_components, prior)
    for _ in range(REASSIGNMENTS):
        moved = left_out_labels(points, left_out)
        if np.array_equal(moved, labels):
            break
        fit = fit_mixture(points, one_hot(moved[None], n_components), prior)
        if _rank(fit, 0, n_components) <= value:
            break
        labels, value = fit.labels[0], _rank(fit, 0, n_components)
        left_out = leave_each_out(points, labels, n_components, prior)
    return Clustering(_ordered(labels), value[1], left_out)


def leave_each_out(
    points: Floats, labels: Integers, n_components: int, prior: CovariancePrior
) -> Components:
    """Fit the mixture without each of n points, starting from the labels of the other points.

    All are fitted in one batch. Beyond `MAX_FOLDS` points, those of a fold are left out together.
    """
    fold = np.arange(len(points)) % MAX_FOLDS
    included = fold != np.arange(min(len(points), MAX_FOLDS))[:, None]
    fits = fit_mixture(points, one_hot(labels, n_components) * included[..., None], prior)
    return fits.components.select(fold)


def left_out_labels(points: Floats, left_out: Components) -> Integers:
    """Most probable component of each point under the mixture that was fitted without it, (n,)."""
    labels = np.empty(len(points), dtype=np.int64)
    n_components = left_out.count.shape[1]
    for part in batches(len(points), n_components * len(points) * max(points.shape)):
        joint = log_joint(points, left_out.select(part))
        own = np.arange(len(points))[part]
        labels[part] = np.argmax(joint[np.arange(len(own)), own], axis=1)
    return labels


def _rank(fits: MixtureFit, index: int, n_components: int) -> tuple[bool, float]:
    """Rank of a fit: whether all components are large enough, then the likelihood."""
    sizes = np.bincount(fits.labels[index], minlength=n_components)
    return bool(sizes.min() >= MIN_MEMBERS), float(fits.log_likelihood[index])


def _ordered(labels: Integers) -> Integers:
    """Renumber labels by decreasing size of the components, then by their first member."""
    found, first, sizes = np.unique(labels, return_index=True, return_counts=True)
    order = sorted(range(len(found)), key=lambda k: (-sizes[k], first[k]))
    rank = {int(found[k]): number for number, k in enumerate(order)}
    return np.array([rank[int(label)] for label in labels], dtype=np.int64)
