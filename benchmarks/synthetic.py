# SPDX-License-Identifier: Apache-2.0
"""Libraries of any size: reaches from one rest posture to as many goals as there are tasks."""

import numpy as np

from intent_recognition.promp import NormalizedRBFBasis, TaskLibrary, minimum_jerk
from intent_recognition.signals import Observation, OnsetSettings

N_OBSERVED = 3
N_BASIS = 20
DURATION_S = 2.0
NOISE_STD = 0.005
START_NS = 1_700_000_000_000_000_000


def synthetic_library(
    rng: np.random.Generator, n_tasks: int, n_controlled: int = 7, *, crowding_s: float = 0.05
) -> TaskLibrary:
    """Tasks whose goals lie apart; all share one covariance, held once per task in memory."""
    basis = NormalizedRBFBasis(N_BASIS)
    n_dofs = N_OBSERVED + n_controlled
    goals = rng.uniform(-0.6, 0.6, size=(n_tasks, n_dofs))
    mean = goals[:, :, None] * minimum_jerk(basis.centers)
    between = np.exp(-0.5 * ((basis.centers[:, None] - basis.centers) / 0.3) ** 2)
    root = rng.normal(size=(n_dofs, n_dofs)) / np.sqrt(n_dofs)
    covariance = 0.03**2 * np.kron(root @ root.T, between)
    covariance += 0.003**2 * np.eye(len(covariance))
    smooth = 1.0 + between + 1e-4 * np.eye(N_BASIS)
    wide = np.kron(0.3**2 * np.eye(N_OBSERVED), smooth).astype(np.float64)
    return TaskLibrary(
        labels=tuple(f"task_{k:05d}" for k in range(n_tasks)),
        basis=basis,
        observed_names=("x", "y", "z"),
        controlled_names=tuple(f"joint_{k}" for k in range(n_controlled)),
        observed_units=("m",) * N_OBSERVED,
        controlled_units=("rad",) * n_controlled,
        weight_mean=mean.reshape(n_tasks, -1),
        weight_covariance=np.repeat(covariance[None], n_tasks, axis=0),
        noise_variance=np.full(n_dofs, NOISE_STD**2),
        noise_scale=1.0,
        correlation_time_s=crowding_s,
        log_duration_mean=np.full(n_tasks, np.log(DURATION_S)),
        log_duration_std=np.full(n_tasks, 0.15),
        task_prior=np.full(n_tasks, 1.0 / n_tasks),
        transition_prior=np.full((n_tasks + 1, n_tasks), 1.0 / n_tasks),
        none_mean=np.zeros(N_OBSERVED * N_BASIS),
        none_covariance=wide,
        none_log_duration=np.array([np.log(DURATION_S), 0.3]),
        none_prior=0.05,
        n_demonstrations=np.full(n_tasks, 10),
        observed_groups=(N_OBSERVED,),
        onset=(OnsetSettings(reference_speed=0.4),),
    )


def movement(
    library: TaskLibrary,
    task: int,
    rng: np.random.Generator,
    *,
    start_ns: int = START_NS,
    rest_s: float = 0.0,
    rate_hz: float = 100.0,
    noise_std: float = NOISE_STD,
) -> list[Observation]:
    """What is seen of the human in one movement of a task, between two rests."""
    times = np.arange(0.0, DURATION_S + 2.0 * rest_s, 1.0 / rate_hz)
    mean = library.observed_mean[task].reshape(N_OBSERVED, -1)
    values = library.basis.design_matrix((times - rest_s) / DURATION_S) @ mean.T
    values = values + rng.normal(size=values.shape) * noise_std
    stamps = start_ns + np.round(times * 1e9).astype(np.int64)
    return [Observation(int(s), 0, v) for s, v in zip(stamps, values, strict=True)]
