# SPDX-License-Identifier: Apache-2.0
"""Mixtures of interaction primitives with each demonstration left out, for two experiments.

The mixture is that of `learning.mixture`, fitted in the coordinates of all demonstrations. The one
left out is predicted as the paper does it: the component that the observation makes most probable,
conditioned on the observation (Ewerton et al. 2015, Eq. 11-13, Algorithm 2).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from experiments.settings import Settings
from intent_recognition.array_types import Floats, Integers
from intent_recognition.evaluation import sample
from intent_recognition.gaussian import (
    Components,
    CovariancePrior,
    Gaussian,
    GaussianMixture,
    log_joint,
    maximisation,
)
from intent_recognition.learning import (
    BASIS,
    MIN_MEMBERS,
    RIDGE,
    SAMPLED_PHASES,
    Clustering,
    Features,
    cluster,
    cut_to_movement,
    make_example,
    mixture_features,
    predict_left_out,
    score,
    smallest_within_one_error,
)
from intent_recognition.signals import Demonstration

PHASES = np.linspace(0.0, 1.0, SAMPLED_PHASES)
"""Phases of all trajectories here, (S,)."""
FINAL = np.array([SAMPLED_PHASES - 1])
"""Index of the final phase."""
WHOLE = np.arange(SAMPLED_PHASES)
"""Indices of all phases."""
END_NOISE_STD_M = 0.003
"""Noise of the final position [m]: marker and sway."""
PATH_NOISE_STD_M = 0.01
"""Noise at each phase of a whole path [m], whose errors are not independent."""
PREDICTION_STRENGTH = 1.0
"""Equivalent sample size of the diagonal target of a covariance that predicts, in demonstrations.

Telling components apart needs a stronger prior (`learning.mixture.STRENGTH`), but that would remove
most of the correlation between the agents, which is what predicts.
"""


class Pairs(NamedTuple):
    """n demonstrations of both agents at the same phases.

    Attributes:
        names: of the recordings.
        observed: the human as measured, (n, S, P).
        controlled: the robot as measured, (n, S, Q).
        duration_s: (n,).
        features: what the mixture is fitted to.
        to_observed: coordinates to deviations of `observed`, flattened, (r, S P).
        to_controlled: the same of `controlled`, (r, S Q).
        mean: of both, flattened, (S P,) and (S Q,).
    """

    names: tuple[str, ...]
    observed: Floats
    controlled: Floats
    duration_s: Floats
    features: Features
    to_observed: Floats
    to_controlled: Floats
    mean: tuple[Floats, Floats]


class LeftOutMixture(NamedTuple):
    """Each demonstration predicted by the mixture that was fitted without it.

    Attributes:
        component: the one that predicts, (n,).
        probability: of each component given the observation, (n, K).
        mean: of the robot under that component, (n, S, Q).
        std: standard deviation of the same, (n, S, Q).
    """

    component: Integers
    probability: Floats
    mean: Floats
    std: Floats


class TriedNumber(NamedTuple):
    """One number of components, every demonstration left out in turn, its whole path observed.

    Attributes:
        number: of components.
        mixtures: without each demonstration, to predict with.
        labels: component of each demonstration (n,).
        nll: left-out score that the number is chosen by (n,).
        predicted: each robot.
        joint_rms_rad: error of each prediction over all joints and times (n,).
    """

    number: int
    mixtures: Components
    labels: Integers
    nll: Floats
    predicted: LeftOutMixture
    joint_rms_rad: Floats


def pairs_of(demonstrations: Sequence[Demonstration]) -> Pairs:
    """Both agents of each demonstration, cut to the interaction; labels are not used."""
    cut = cut_to_movement(demonstrations)
    weights = np.array([make_example(one, BASIS, RIDGE).weights for one in cut])
    n_observed = sum(len(signal.names) for signal in cut[0].observed)
    features = mixture_features(weights, n_observed, BASIS)
    smooth = np.swapaxes(weights @ BASIS.design_matrix(PHASES).T, 1, 2)  # (n, S, D)
    duration = np.array([(d.end_ns - d.start_ns) * 1e-9 for d in cut])
    observed, controlled = (
        np.array(
            [
                sample(getattr(d, agent), d.start_ns, PHASES * seconds)
                for d, seconds in zip(cut, duration, strict=True)
            ]
        )
        for agent in ("observed", "controlled")
    )
    parts = smooth[..., :n_observed], smooth[..., n_observed:]
    flat = [part.reshape(len(part), -1) for part in parts]
    return Pairs(
        tuple(d.name for d in cut),
        observed,
        controlled,
        duration,
        features,
        *_maps(features, flat),
        (flat[0].mean(axis=0), flat[1].mean(axis=0)),
    )


def _maps(features: Features, flat: Sequence[Floats]) -> tuple[Floats, Floats]:
    """From all coordinates to the deviations of each agent; each agent has its own coordinates."""
    points, split = features.coordinates, features.n_observed
    maps = []
    for part, columns in zip(flat, (slice(None, split), slice(split, None)), strict=True):
        own = points[:, columns]
        solved = np.linalg.lstsq(own, part - part.mean(axis=0), rcond=None)[0]
        whole = np.zeros((points.shape[1], part.shape[1]))
        whole[columns] = solved
        maps.append(whole)
    return maps[0], maps[1]


def try_numbers(
    pairs: Pairs, largest: int, settings: Settings
) -> tuple[tuple[TriedNumber, ...], int]:
    """Each number of components up to the largest, and the one `intent train --unlabelled` takes.

    That is the smallest within one error of the best; components of fewer than `MIN_MEMBERS` are
    not asked for.

    Args:
        pairs: the demonstrations.
        largest: number of components.
        settings: random generators by number; this is the first fifth of its progress.
    """
    tried = []
    for number in range(1, largest + 1):
        fit = cluster(pairs.features, number, settings.rng(number))
        prediction = predict_left_out(pairs.features, fit.left_out, pairs.features.prior)
        nll, _ = score(prediction, pairs.features.controlled)
        settings.progress(0.2 * number / largest, f"{number} components")
        mixtures = to_predict_with(pairs, fit)
        predicted = predict(pairs, mixtures, WHOLE)
        error = rms(predicted.mean - pairs.controlled)
        tried.append(TriedNumber(number, mixtures, fit.labels, nll, predicted, error))
    asked_for = tried[: max(1, len(pairs.names) // MIN_MEMBERS)]
    return tuple(tried), 1 + smallest_within_one_error(np.array([one.nll for one in asked_for]))


def to_predict_with(pairs: Pairs, clustering: Clustering) -> Components:
    """The mixtures without each demonstration, with covariances that keep the agents' correlation.

    Their components are in the order of the clustering's labels.
    """
    points, usual = pairs.features.coordinates, pairs.features.prior
    joint = log_joint(points, clustering.left_out)
    share = np.exp(joint - np.logaddexp.reduce(joint, axis=2)[..., None])
    share = share[..., _order(share, clustering.labels)]
    share[np.arange(len(points)), np.arange(len(points))] = 0.0
    return maximisation(
        points, share, CovariancePrior(usual.floor, PREDICTION_STRENGTH, usual.shared)
    )


def _order(share: Floats, labels: Integers) -> Integers:
    """Which component of the mixtures is label 0, 1 and so on, (K,), from shares (n, n, K)."""
    together = share.sum(axis=0).T @ (labels[:, None] == np.arange(share.shape[2]))
    components, found = linear_sum_assignment(together, maximize=True)
    return components[np.argsort(found)]


def predict(
    pairs: Pairs, left_out: Components, seen: Integers, given: Integers | None = None
) -> LeftOutMixture:
    """Predict each robot from what is seen of its human, by the mixture fitted without both.

    Args:
        pairs: the demonstrations.
        left_out: of `to_predict_with`.
        seen: `WHOLE`, or `FINAL` for the human's last position alone.
        given: component of each demonstration (n,) where it is known from elsewhere; else the
            most probable one given what is seen.
    """
    noise_std = END_NOISE_STD_M if len(seen) == 1 else PATH_NOISE_STD_M
    n, _, n_observed = pairs.observed.shape
    rows = (seen[:, None] * n_observed + np.arange(n_observed)).ravel()
    observation_matrix = pairs.to_observed[:, rows].T
    noise = noise_std**2 * np.eye(len(rows))
    covariance = left_out.covariance(pairs.features.coordinates)
    shape = pairs.controlled.shape
    probability = np.empty(left_out.log_weight.shape)
    component = np.empty(n, dtype=np.int64)
    mean, std = np.empty(shape), np.empty(shape)
    for i in range(n):
        seen_values = pairs.observed[i].ravel()[rows] - pairs.mean[0][rows]
        parts = [Gaussian(m, c) for m, c in zip(left_out.mean[i], covariance[i], strict=True)]
        mixture = GaussianMixture(np.exp(left_out.log_weight[i]), tuple(parts))
        posterior, _ = mixture.condition(observation_matrix, seen_values, noise)
        probability[i] = posterior.weights
        component[i] = posterior.weights.argmax() if given is None else given[i]
        best = posterior.components[component[i]]
        mean[i] = (pairs.mean[1] + best.mean @ pairs.to_controlled).reshape(shape[1:])
        variance = np.einsum(
            "rs,rt,ts->s", pairs.to_controlled, best.covariance, pairs.to_controlled, optimize=True
        )
        std[i] = np.sqrt(np.maximum(variance, 0.0)).reshape(shape[1:])
    return LeftOutMixture(component, probability, mean, std)


def rms(errors: Floats) -> Floats:
    """Root mean square (n,) of the errors (n, ...) of each demonstration."""
    return np.sqrt(np.mean(errors.reshape(len(errors), -1) ** 2, axis=1))


def majority_names(names: NDArray[np.str_], labels: Integers) -> dict[int, str]:
    """The name that most members (n,) of each component have."""
    found = {}
    for label in np.unique(labels):
        own, counts = np.unique(names[labels == label], return_counts=True)
        found[int(label)] = str(own[counts.argmax()])
    return found
