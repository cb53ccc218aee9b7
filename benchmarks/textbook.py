# SPDX-License-Identifier: Apache-2.0
"""The peer of the filter bank: a textbook Kalman update of the full state, task by task."""

import numpy as np


def full_state_update(
    mean: np.ndarray,
    covariance: np.ndarray,
    observation_matrix: np.ndarray,
    values: np.ndarray,
    noise_covariance: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Mean (d,), covariance (d, d) and log density after y = H w + noise; d is all weights."""
    innovation = values - observation_matrix @ mean
    spread = observation_matrix @ covariance @ observation_matrix.T + noise_covariance
    gain = covariance @ observation_matrix.T @ np.linalg.inv(spread)
    log_density = -0.5 * (
        innovation @ np.linalg.solve(spread, innovation)
        + np.linalg.slogdet(2.0 * np.pi * spread)[1]
    )
    identity = np.eye(len(mean))
    return (
        mean + gain @ innovation,
        (identity - gain @ observation_matrix) @ covariance,
        float(log_density),
    )
