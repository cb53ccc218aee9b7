# SPDX-License-Identifier: Apache-2.0
"""Log evidence of a Gaussian over weights, after each sample of a movement of unknown duration."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from intent_recognition.filtering import N_SCALES, SCALE_SPAN
from intent_recognition.gaussian import LOG_2_PI, Gaussian, cholesky
from intent_recognition.promp import TaskLibrary

MIN_NOISE_SHARE = 1e-12
"""Smallest noise variance as a share of a movement's largest variance. Numerical safeguard."""


def prefix_log_evidence(
    library: TaskLibrary,
    primitive: Gaussian,
    log_duration: NDArray[np.float64],
    times_s: NDArray[np.float64],
    values: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Log density of the first 1, 2, ... m samples, durations summed out, (m,).

    The sums of squares of one Cholesky factor per duration; equals conditioning on one sample
    after the other.

    Args:
        library: whose basis, noise and correlation time are used.
        primitive: of the observed weights, (P N,).
        log_duration: mean and standard deviation of the log duration in seconds, (2,).
        times_s: of the samples, (m,).
        values: (m, P).
    """
    m, n_dofs = values.shape
    offsets = np.linspace(-SCALE_SPAN, SCALE_SPAN, N_SCALES)
    log_weight = -0.5 * offsets**2
    log_weight -= np.logaddexp.reduce(log_weight)
    durations = np.exp(log_duration[0] + log_duration[1] * offsets)
    design = library.basis.design_matrix(np.clip(times_s / durations[:, None], 0.0, 1.0))
    mean, covariance = _at_samples(primitive, design, n_dofs)
    index = np.arange(m * n_dofs)
    noise = _noise(library, times_s, n_dofs)
    covariance[:, index, index] += np.maximum(noise, MIN_NOISE_SHARE * covariance.max())
    factor = cholesky(covariance, name="covariance of a movement")
    innovation = (values.ravel() - mean)[..., None]
    whitened = np.array(
        [solve_triangular(f, i, lower=True)[:, 0] for f, i in zip(factor, innovation, strict=True)]
    )
    density = -0.5 * (whitened**2 + LOG_2_PI) - np.log(factor[:, index, index])
    per_sample = density.reshape(N_SCALES, m, n_dofs).sum(axis=2)
    return np.logaddexp.reduce(np.cumsum(per_sample, axis=1) + log_weight[:, None], axis=0)


def _at_samples(
    primitive: Gaussian, design: NDArray[np.float64], n_dofs: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean (S, m P) and covariance (S, m P, m P) of samples in order, from designs (S, m, N)."""
    n_scales, m, n_basis = design.shape
    mean = np.einsum("smn,pn->smp", design, primitive.mean.reshape(n_dofs, n_basis))
    blocks = primitive.covariance.reshape(n_dofs, n_basis, n_dofs * n_basis)
    half = np.einsum("smn,pnk->smpk", design, blocks, optimize=True)
    half = half.reshape(n_scales, m * n_dofs, n_dofs, n_basis)
    full = np.einsum("saqn,smn->samq", half, design, optimize=True)
    shape = (n_scales, m * n_dofs, m * n_dofs)
    return mean.reshape(n_scales, -1), full.reshape(shape)


def _noise(library: TaskLibrary, times_s: NDArray[np.float64], n_dofs: int) -> NDArray[np.float64]:
    """Noise variance of each value, in the order of the samples, (m P,)."""
    dofs = np.arange(n_dofs)
    intervals = np.r_[np.inf, np.diff(times_s)]
    return np.concatenate([np.diag(library.noise_covariance(dofs, dt)) for dt in intervals])
