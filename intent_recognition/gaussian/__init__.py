# SPDX-License-Identifier: Apache-2.0
"""Gaussian distributions and mixtures, conditioned one at a time or in batches."""

from intent_recognition.gaussian.batch import KERNEL, GaussianBatch, LinearMeasurement, state_width
from intent_recognition.gaussian.gaussian_mixture import (
    GaussianMixture,
    fit_gaussian_mixture,
    kmeans_starts,
)
from intent_recognition.gaussian.linalg import (
    affine_span,
    cholesky,
    covariance_root,
    half_log_det,
    log_sum,
    solve_lower,
    student_log_density,
    symmetrize,
)
from intent_recognition.gaussian.mixture import (
    EMPTY,
    Components,
    CovariancePrior,
    MixtureFit,
    batches,
    fit_mixture,
    log_joint,
    maximisation,
    one_hot,
)
from intent_recognition.gaussian.normal import (
    Gaussian,
    Regression,
    condition,
    expected_distance,
    log_density,
    marginal,
    product,
    regression,
    whiten_innovation,
)
from intent_recognition.gaussian.tube import tube_faces, tube_rings
