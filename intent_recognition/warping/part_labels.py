# SPDX-License-Identifier: Apache-2.0
"""First guess of the rim from the local shape of the surface, learned from the annotated object.

It is a logistic regression, fitted by iteratively reweighted least squares (Brandl et al. III-A).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree
from scipy.special import expit

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrainingError
from intent_recognition.warping.object_model import AnnotatedObject, Part


@dataclass(frozen=True)
class LogisticModel:
    """Probability `1 / (1 + exp(-(bias + weights . (features - offset) / scale)))`."""

    bias: float  # log odds of the mean feature vector
    weights: Floats  # log odds (d,) per standard deviation of each feature
    offset: Floats  # mean (d,) of the features learned from
    scale: Floats  # standard deviation (d,) of these features, 1 where it was 0

    def log_odds(self, features: Floats) -> Floats:
        """Log odds (n,) at features (n, d)."""
        return self.bias + (features - self.offset) @ (self.weights / self.scale)

    def probability(self, features: Floats) -> Floats:
        """Probability (n,) of label 1 at features (n, d)."""
        return expit(self.log_odds(features))


def fit_logistic(features: Floats, labels: Floats, ridge: float = 1e-2) -> LogisticModel:
    """Fit by Newton steps on the ridge-penalised likelihood, each halved until this rises.

    Features are standardised first; the penalty is `ridge / 2 * |weights|^2` on the standardised
    weights and leaves the bias free. With a ridge above 0, weights are finite even for separable
    labels.

    Args:
        features: (n, d), finite.
        labels: (n,), 0 or 1, or booleans.
        ridge: strength of the penalty, above 0.

    Raises:
        TrainingError: only one label is present, or the weights do not converge.
    """
    labels = np.asarray(labels, dtype=float)
    if not 0.0 < labels.sum() < len(labels):
        got = f"{np.count_nonzero(labels)} of {len(labels)} with label 1"
        raise TrainingError.about("labels", "both 0 and 1", got, "Add samples of the other.")
    offset, scale = features.mean(axis=0), features.std(axis=0)
    scale = np.where(scale > 1e-12 * (1.0 + np.abs(offset)), scale, 1.0)
    design = np.column_stack([np.ones(len(features)), (features - offset) / scale])
    penalty = np.full(design.shape[1], ridge)
    penalty[0] = 0.0
    beta = np.zeros(design.shape[1])
    beta[0] = np.log(labels.sum() / (1.0 - labels).sum())

    def loss(candidate: Floats) -> float:
        odds = design @ candidate
        misfit = np.sum(np.logaddexp(0.0, odds) - labels * odds)
        return float(misfit + 0.5 * penalty @ candidate**2)

    current = loss(beta)
    most_steps = 100
    for _ in range(most_steps):
        probability = expit(design @ beta)
        gradient = design.T @ (probability - labels) + penalty * beta
        curvature = probability * (1.0 - probability)
        hessian = (design * curvature[:, None]).T @ design + np.diag(penalty)
        # Where every probability is 0 or 1, the bias has no curvature.
        hessian[0, 0] += 1e-12 * len(labels)
        step = cho_solve(cho_factor(hessian), gradient)
        length = 1.0
        while loss(beta - length * step) > current + 1e-12 * abs(current) and length > 1e-8:
            length *= 0.5
        beta = beta - length * step
        current = loss(beta)
        if np.abs(length * step).max() < 1e-9 * (1.0 + np.abs(beta).max()):
            return LogisticModel(float(beta[0]), beta[1:], offset, scale)
    got = f"a step of {np.abs(step).max():.3g} after {most_steps}"
    cure = "Raise ridge."
    raise TrainingError.about("labels", "converging weights", got, cure)


N_POINTS = 2000
"""Most points of each training cloud but the whole object's, as many as a scan has."""


def fit_rim_classifier(source: AnnotatedObject, up: Floats) -> LogisticModel:
    """Learn to recognise the rim from the local shape of the surface (Brandl et al. II-B).

    A camera above sees more of the rim than of the walls. The classifier is therefore trained on
    the whole object and on points as one to three cameras would see them.
    """
    n_rim = int((source.labels == Part.RIM).sum())
    if not 0 < n_rim < len(source.labels):
        cure = "Annotate the rim around the opening as RIM and the wall as CONTAINER."
        raise TrainingError.about("labels", "some points on the RIM", n_rim, cure)
    rng = np.random.default_rng(0)
    everything = np.arange(len(source.points))
    count = min(N_POINTS, len(everything))
    chosen = [everything, *(rng.choice(everything, count, replace=False) for _ in range(2))]
    chosen += [_seen(source, up, n_views, rng) for n_views in (1, 1, 1, 2, 2, 3, 3, 3)]
    features = np.concatenate([local_features(source.points[c], source.normals[c]) for c in chosen])
    on_rim = source.labels[np.concatenate(chosen)] == Part.RIM
    return fit_logistic(features, on_rim, ridge=1.0)  # classes overlap little


def local_features(
    points: Floats, normals: Floats, tree: cKDTree | None = None, rows: Floats | slice = slice(None)
) -> Floats:
    """Features of the neighbourhood of each point (Brandl et al. II-B).

    They are the eigenvalues of the neighbourhood's covariance and the distance to its mean, as in
    the paper, both relative to the neighbourhood's size; neighbours on the other side of a thin
    wall count less. The spread of the normals distinguishes a rim from the edge of a scan.

    Args:
        points: (n, 3) in metres.
        normals: outward unit normals (n, 3).
        tree: search tree of the points, built if None.
        rows: rows of the points whose features are returned.

    Returns:
        Features (m, 16): eight features and their squares.
    """
    tree = tree or cKDTree(points)
    count = min(20, len(points))
    _, near = tree.query(points[rows], k=count)
    offsets = points[near] - points[rows][:, None]
    around, own = normals[near], normals[rows]
    agreement = (around @ own[:, :, None])[:, :, 0]
    weights = np.maximum(agreement, 0.0) + 0.05
    weights /= weights.sum(1, keepdims=True)
    size = np.sqrt((offsets * offsets).sum((1, 2)) / count)
    offsets /= np.maximum(size, np.finfo(float).tiny)[:, None, None]  # 0: all in one place
    mean = (weights[:, None] @ offsets)[:, 0]
    covariance = (offsets * weights[:, :, None]).transpose(0, 2, 1) @ offsets
    covariance -= mean[:, :, None] * mean[:, None]
    spread = around.transpose(0, 2, 1) @ around / count
    facing = around.mean(1)
    features = np.column_stack(
        [
            np.linalg.eigvalsh(covariance),
            np.sqrt((mean * mean).sum(1)),
            (mean * own).sum(1),
            np.linalg.eigvalsh(spread)[:, :2],
            np.sqrt((facing * facing).sum(1)),
        ]
    )
    return np.column_stack([features, features * features])


def _seen(
    source: AnnotatedObject, up: Floats, n_views: int, rng: np.random.Generator
) -> NDArray[np.integer]:
    """Draw points that face cameras above; points hidden behind others are not excluded."""
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    weight = np.zeros(len(source.points))
    start = rng.uniform(0.0, 2.0 * np.pi)
    for view in range(n_views):
        azimuth, elevation = start + 2.0 * np.pi * view / n_views, rng.uniform(0.7, 1.2)
        level = np.cos(azimuth) * first + np.sin(azimuth) * second
        facing = source.normals @ (np.cos(elevation) * level + np.sin(elevation) * up)
        weight += np.where(facing > 0.17, facing, 0.0)  # a camera sees nothing beyond 80 degrees
    count = min(N_POINTS, int((weight > 0.0).sum()) * 2 // 3)
    if not count:
        cure = "Let normals point outward, also inside the opening."
        raise TrainingError.about("normals", "some that a camera above faces", "none", cure)
    return rng.choice(len(weight), count, replace=False, p=weight / weight.sum())
