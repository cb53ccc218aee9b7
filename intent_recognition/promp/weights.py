# SPDX-License-Identifier: Apache-2.0
"""Weights of one demonstration by ridge regression, and what they leave unexplained."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.signals import MIN_SAMPLES


class WeightFit(NamedTuple):
    """Weights of d DOFs and their residuals."""

    weights: Floats  # (d, N)
    residual_variance: Floats  # mean squared residual per DOF, (d,), squared units of the DOF


def fit_weights(
    basis: NormalizedRBFBasis, phase: Floats, values: Floats, ridge: float = 1e-4
) -> WeightFit:
    """Ridge regression of trajectories on the basis (Maeda et al. 2014, Eq. 1).

    The penalty is on curvature (second differences of neighbouring weights), so that a straight
    line is left alone and a gap is bridged smoothly; `ridge` is relative to the data's share of one
    basis function, so it means the same at any sampling rate.

    Args:
        basis: the basis functions.
        phase: (T,) phases in [0, 1] of the samples, any order, gaps allowed.
        values: (T, d) samples.
        ridge: relative weight of the penalty, positive.

    Raises:
        TrainingError: fewer than four samples.
        ArgumentError: `ridge` is not positive.
    """
    if not ridge > 0:
        raise ArgumentError.about("ridge", "a positive number", ridge, "Try 1e-4.")
    if len(phase) < MIN_SAMPLES:
        expected = f"at least {MIN_SAMPLES} samples of every DOF"
        cure = "Record it again, or leave it out."
        raise TrainingError.about("demonstration", expected, len(phase), cure)
    design = basis.design_matrix(phase)
    curvature = np.diff(np.eye(basis.n_basis), 2, axis=0)
    penalty = ridge * len(phase) / basis.n_basis
    normal = design.T @ design + penalty * (curvature.T @ curvature)
    normal += 1e-9 * len(phase) / basis.n_basis * np.eye(basis.n_basis)
    centre = values.mean(axis=0)  # the basis sums to one: a constant is a constant weight
    apart = values - centre
    weights = cho_solve(cho_factor(normal), design.T @ apart).T
    residuals = apart - design @ weights.T
    return WeightFit(weights + centre[:, None], np.mean(residuals**2, axis=0))


def fit_weights_together(
    basis: NormalizedRBFBasis,
    phases: Sequence[Floats],
    values: Sequence[Floats],
    ridge: float = 1e-4,
) -> list[WeightFit]:
    """`fit_weights` of many signals; those sampled at the same phases share one factorisation.

    Args:
        basis: the basis functions.
        phases: (T_i,) phases of the samples of each signal.
        values: (T_i, d_i) samples of each.
        ridge: as of `fit_weights`.

    Raises:
        TrainingError: a signal of fewer than four samples.
        ArgumentError: `ridge` is not positive.
    """
    groups: dict[bytes, list[int]] = {}
    for index, phase in enumerate(phases):
        groups.setdefault(np.ascontiguousarray(phase).tobytes(), []).append(index)
    fits: dict[int, WeightFit] = {}
    for members in groups.values():
        fit = fit_weights(
            basis, phases[members[0]], np.hstack([values[index] for index in members]), ridge
        )
        edges = np.cumsum([values[index].shape[1] for index in members])[:-1]
        parts = zip(
            np.split(fit.weights, edges), np.split(fit.residual_variance, edges), strict=True
        )
        for index, (weights, residual_variance) in zip(members, parts, strict=True):
            fits[index] = WeightFit(weights.copy(), residual_variance.copy())
    return [fits[index] for index in range(len(phases))]
