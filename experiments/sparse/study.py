# SPDX-License-Identifier: Apache-2.0
"""Prediction errors of ProMPs and DMPs from a few irregular positions, on one set of sketches."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from experiments.sketches.curves import sketch_pairs
from experiments.sketches.differentiation import spline_operators
from experiments.sketches.models import learn_dmp, learn_promp
from experiments.sparse.conditioning import (
    N_SPLINE,
    SplineChoice,
    choose_shrinkage,
    choose_splines,
    observe,
    promp_curves,
    sparse_phases,
    spline_predictor,
    true_acceleration,
)
from intent_recognition.array_types import Floats

N_TRAIN, N_TEST = 40, 60
"""Pairs of sketches to learn from and to predict."""
PROMP, DMP_SPLINE, DMP_THROUGH, NOTHING = METHODS = (
    "ProMP",
    "DMP, best smoothing spline",
    "DMP, spline through the samples",
    "no observation",
)


class SparseScores(NamedTuple):
    """Scores on one data set for k numbers of observations.

    Attributes:
        rmse: of the controlled curve, per method, (k,).
        inside: share of the true curves within two standard deviations, observed and controlled
            agent, (k, 2).
        acceleration: error of the spline's acceleration in parts of the true one's root mean
            square, interpolating and best spline, (k, 2).
    """

    rmse: Mapping[str, Floats]
    inside: Floats
    acceleration: Floats


def one_data_set(
    rng: np.random.Generator, counts: Sequence[int], choices: Sequence[SplineChoice]
) -> SparseScores:
    """Learn from one set of sketches, and score others."""
    train, test = sketch_pairs(rng, N_TRAIN), sketch_pairs(rng, N_TEST)
    promp, dmp = learn_promp(train), learn_dmp(train)
    shrinkage = choose_shrinkage(rng, train, counts)
    mean = train[..., 1].mean(axis=0)
    rmse = {m: np.empty(len(counts)) for m in METHODS}
    inside, acceleration = np.empty((len(counts), 2)), np.empty((len(counts), 2))
    rmse[NOTHING][:] = _rms(test[..., 1] - mean)
    for k, count in enumerate(counts):
        through, best = choose_splines(rng, train, count, choices)
        errors: dict[str, list[Floats]] = {m: [] for m in METHODS[:3]}
        hits, differences = [], []
        for pair in test:
            at = sparse_phases(rng, count)
            seen = observe(rng, pair[:, 0], at)
            curves, std = promp_curves(promp, shrinkage, at, seen)
            hits.append(np.mean(np.abs(curves - pair.T) <= 2.0 * std, axis=1))
            errors[PROMP].append(curves[1] - pair[:, 1])
            for method, choice in ((DMP_SPLINE, best), (DMP_THROUGH, through)):
                matrix, offset = spline_predictor(dmp, choice, at)
                errors[method].append(matrix @ seen + offset - pair[:, 1])
            differences.append(
                [_acceleration_error(pair[:, 0], at, seen, c) for c in (through, best)]
            )
        for method, values in errors.items():
            rmse[method][k] = _rms(np.array(values))
        inside[k] = np.mean(hits, axis=0)
        acceleration[k] = np.median(differences, axis=0)
    return SparseScores(rmse, inside, acceleration)


def _acceleration_error(curve: Floats, at: Floats, seen: Floats, choice: SplineChoice) -> float:
    """Root mean square error of a spline's acceleration in parts of the true one's."""
    dense = np.linspace(at[0], at[-1], N_SPLINE)
    true = true_acceleration(curve, dense)
    found = spline_operators(at, dense, choice.roughness)[2] @ seen
    return _rms(found - true) / _rms(true)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
