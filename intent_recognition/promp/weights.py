# SPDX-License-Identifier: Apache-2.0
"""Weights of one demonstration by ridge regression, and the variance of its residuals."""

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

    The penalty is on curvature (second differences of neighbouring weights): a straight line has
    none, and gaps are bridged smoothly. `ridge` is relative to the number of samples per basis
    function, so its effect does not depend on the sampling rate.

    Args:
        basis: the basis functions.
        phase: phases of the samples in [0, 1], (T,), in any order, gaps allowed.
        values: samples, (T, d).
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
    centre = values.mean(axis=0)  # the basis sums to one: constant weights give a constant
    apart = values - centre
    weights = cho_solve(cho_factor(normal), design.T @ apart).T
    residuals = apart - design @ weights.T
    return WeightFit(weights + centre[:, None], np.mean(residuals**2, axis=0))
