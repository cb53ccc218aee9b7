# SPDX-License-Identifier: Apache-2.0
"""Classifiers of pouring and filling, learned with one container and tested on others."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from experiments.constraints.features import ConstraintSamples
from experiments.constraints.roc import on_grid, roc_curve
from experiments.constraints.spilling import RIDGE, FillingConstraint, landing
from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import TrainingError
from intent_recognition.warping import fit_logistic
from sim_bridge.containers import CONTAINER_NAMES

N_TRAINING = 50
"""Trials that a classifier learns from, as in the paper."""
FEW_FALSE_POSITIVES = 0.01
"""False positive rate at which true positive rates are compared: almost none, as in the paper."""
SAME, NOVEL = "same object", "novel objects"


class ConstraintScores(NamedTuple):
    """Scores of one method on one test set, over M training sets.

    Attributes:
        curves: true positive rates on the grid (M, G).
        areas: below the curves (M,).
        early: true positive rate at `FEW_FALSE_POSITIVES` (M,).
        trained_on: index of the training object (M,).
    """

    curves: Floats
    areas: Floats
    early: Floats
    trained_on: Floats

    @property
    def area(self) -> float:
        """Mean area."""
        return float(self.areas.mean())


CurveTable = Mapping[str, Mapping[str, ConstraintScores]]
"""Scores by method and test set (`SAME`, `NOVEL`)."""


def score(
    samples: ConstraintSamples, n_sets: int, rng: np.random.Generator
) -> dict[str, ConstraintScores]:
    """Learn from `n_sets` training sets per object; test on its other trials and on the others.

    Raises:
        TrainingError: the trials of one object all have the same label.
    """
    rows: dict[str, list[tuple[Floats, float, float, int]]] = {SAME: [], NOVEL: []}
    for index in np.unique(samples.objects):
        own = np.flatnonzero(samples.objects == index)
        others = np.flatnonzero(samples.objects != index)
        if len(np.unique(samples.labels[own])) < 2:
            raise TrainingError(f"{CONTAINER_NAMES[index]}: all of its trials have one label.")
        for _ in range(n_sets):
            shuffled = _both_labels_first(own, samples.labels, rng)
            train, rest = shuffled[:N_TRAINING], shuffled[N_TRAINING:]
            log_odds = _learned(samples, train)
            for name, test in ((SAME, rest), (NOVEL, others)):
                odds = log_odds(test)
                curve = roc_curve(odds, samples.labels[test])
                early = on_grid(curve, np.array([FEW_FALSE_POSITIVES]))[0]
                rows[name].append((on_grid(curve), curve.area, float(early), int(index)))
    return {
        name: ConstraintScores(*map(np.array, zip(*row, strict=True))) for name, row in rows.items()
    }


def _learned(samples: ConstraintSamples, train: Integers) -> Callable[[Integers], Floats]:
    """Log odds of rows (n,), learned from the rows `train`."""
    features, labels, unit = samples.features, samples.labels, samples.unit_throw
    if unit is None:
        model = fit_logistic(features[train], labels[train], ridge=RIDGE)
        return lambda rows: model.log_odds(features[rows])
    filling = FillingConstraint.learn_throw(features[train], unit[train], labels[train])
    return lambda rows: filling.model.log_odds(landing(features[rows], filling.throw * unit[rows]))


def _both_labels_first(rows: Integers, labels: Floats, rng: np.random.Generator) -> Integers:
    """Rows in random order, with both labels in the training part and in the rest."""
    while True:
        shuffled = rng.permutation(rows)
        seen, rest = labels[shuffled[:N_TRAINING]], labels[shuffled[N_TRAINING:]]
        if 0.0 < seen.mean() < 1.0 and 0.0 < rest.mean() < 1.0:
            return shuffled
