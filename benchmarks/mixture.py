# SPDX-License-Identifier: Apache-2.0
"""The number of components by leaving each demonstration out, beside scikit-learn's mixtures."""

import time
import warnings
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.mixture import GaussianMixture

from benchmarks.measure import Result, at_least, at_most, seconds
from intent_recognition.gaussian import (
    CovariancePrior,
    affine_span,
    fit_mixture,
    kmeans_starts,
    log_joint,
    one_hot,
)
from intent_recognition.learning import (
    BASIS,
    RIDGE,
    TrainingExample,
    TrainingSettings,
    choose_components,
    cut_to_movement,
    make_example,
    mixture_features,
    purity,
)
from intent_recognition.promp import NormalizedRBFBasis
from intent_recognition.signals import Demonstration

N_COMPONENTS = range(1, 11)
FLOOR = 1e-2
TOLERANCE = 1e-3
THEIR_STRIDE = 4
"""scikit-learn fits every fourth fold only, and its time is taken four times."""

Labels = dict[tuple[int, int], np.ndarray]


class StartedMixture(GaussianMixture):
    """scikit-learn's mixture from given labels."""

    def __init__(self, labels: np.ndarray, n_components: int):
        super().__init__(n_components, reg_covar=FLOOR, tol=TOLERANCE)
        self.labels = labels

    def _initialize_parameters(
        self, X: np.ndarray, random_state: object, xp: object = None
    ) -> None:
        self._initialize(X, one_hot(self.labels, self.n_components))


def mixture(demonstrations: Sequence[Demonstration]) -> Iterator[Result]:
    """Time and labels of the same loop, and the whole search for the number of tasks."""
    settings = TrainingSettings()
    basis = NormalizedRBFBasis(settings.n_basis, settings.width)
    examples = [make_example(d, basis, settings.ridge) for d in cut_to_movement(demonstrations)]
    vectors = _weight_vectors(examples)
    starts = _starts(vectors)
    ours_s = seconds(partial(_ours, vectors, starts), 3)
    before = time.perf_counter()
    theirs = _theirs(vectors, starts)
    theirs_s = THEIR_STRIDE * (time.perf_counter() - before)
    ours = _ours(vectors, starts)
    n, d = vectors.shape
    yield at_least(
        f"each of {n} left out, K = 1..10, scikit-learn takes",
        theirs_s / ours_s,
        15.0,
        "x",
        f"fits alone, {d} weights: {ours_s:.2f} s, and {theirs_s:.1f} s"
        f" ({THEIR_STRIDE} times every {THEIR_STRIDE}th fold, once)",
    )
    yield at_most(
        "... labels that differ, from the same start",
        float(sum(np.sum(ours[key] != labels) for key, labels in theirs.items())),
        0.0,
        "",
        f"of {n * len(theirs)}, the one left out included",
    )
    yield from _search([make_example(d, BASIS, RIDGE) for d in cut_to_movement(demonstrations)])


def _search(examples: Sequence[TrainingExample]) -> Iterator[Result]:
    n_observed = examples[0].observed.shape[1]
    weights = np.array([example.weights for example in examples])
    before = time.perf_counter()
    features = mixture_features(weights, n_observed, BASIS)
    choice = choose_components(features, np.random.default_rng(0))
    taken_s = time.perf_counter() - before
    found = purity([example.task for example in examples], choice.chosen.labels)
    yield at_least(
        f"purity of the components found in {len(examples)}",
        found,
        1.0,
        "",
        f"{taken_s:.1f} s with 30 starts and left-out prediction",
    )
    n_tasks = len({example.task for example in examples})
    yield at_most(
        "... their number, off that of the tasks",
        float(abs(choice.n_components - n_tasks)),
        0.0,
        "",
        f"{choice.n_components} components, {n_tasks} tasks",
    )


def _weight_vectors(examples: Sequence[TrainingExample]) -> np.ndarray:
    """Whole weight vectors of both agents, each DOF in its standard deviations, (n, D N)."""
    weights = np.array([example.weights for example in examples])
    weights = weights - weights.mean(axis=0)
    weights /= np.sqrt(np.mean(weights**2, axis=(0, 2)))[:, None]
    return weights.reshape(len(weights), -1)


def _starts(vectors: np.ndarray) -> dict[int, np.ndarray]:
    points = affine_span(vectors).coordinates
    rng = np.random.default_rng(0)
    return {k: kmeans_starts(points, k, 1, rng)[0] for k in N_COMPONENTS}


def _ours(vectors: np.ndarray, starts: dict[int, np.ndarray]) -> Labels:
    """Labels of all by the fit without number i, for each number of components."""
    points, n = affine_span(vectors).coordinates, len(vectors)
    labels: Labels = {}
    for k, start in starts.items():
        folds = one_hot(start, k) * (1.0 - np.eye(n))[..., None]
        fits = fit_mixture(points, folds, CovariancePrior(FLOOR), tolerance=TOLERANCE)
        found = np.argmax(log_joint(points, fits.components), axis=2)
        labels |= {(k, i): found[i] for i in range(n)}
    return labels


def _theirs(vectors: np.ndarray, starts: dict[int, np.ndarray]) -> Labels:
    labels = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        for k, start in starts.items():
            for i in range(0, len(vectors), THEIR_STRIDE):
                rest = np.arange(len(vectors)) != i
                fit = StartedMixture(start[rest], k).fit(vectors[rest])
                labels[k, i] = fit.predict(vectors)
    return labels
