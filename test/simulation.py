# SPDX-License-Identifier: Apache-2.0
"""Libraries with known truth, and recordings drawn from them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from intent_recognition.learning import (
    Hyperparameters,
    Trained,
    TrainingSettings,
    accumulate,
    library_from_statistics,
)
from intent_recognition.promp import NormalizedRBFBasis, PhaseDeviation, TaskLibrary
from intent_recognition.signals import Demonstration, OnsetSettings, Signal

START_NS = 1_700_000_000_000_000_000


def minimum_jerk(phase: np.ndarray) -> np.ndarray:
    """Position from 0 to 1 over phase [0, 1], held outside."""
    z = np.clip(phase, 0.0, 1.0)
    return z**3 * (10.0 - 15.0 * z + 6.0 * z**2)


def weights_of(basis: NormalizedRBFBasis, values: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Plain least squares, (d, N)."""
    return np.linalg.lstsq(basis.design_matrix(phase), values, rcond=None)[0].T


def make_library(
    rng: np.random.Generator,
    *,
    n_tasks: int = 3,
    groups: tuple[int, ...] = (3,),
    n_controlled: int = 2,
    n_basis: int = 10,
    noise_std: float = 0.005,
    spread: float = 0.04,
    duration_s: float = 2.0,
    log_duration_std: float = 0.2,
    correlation_time_s: float = 1e-9,
    none_prior: float = 0.05,
) -> TaskLibrary:
    """Reaches from one rest posture to as many goals as tasks; both agents vary together.

    Deviations of a demonstration: every DOF is displaced, its goal varies and it wobbles smoothly,
    all driven by common factors, so that the observed agent tells about the controlled one.
    """
    basis = NormalizedRBFBasis(n_basis, 1.0)
    n_observed = sum(groups)
    n_dofs = n_observed + n_controlled
    phase = np.linspace(0.0, 1.0, 400)
    reach = weights_of(basis, minimum_jerk(phase)[:, None], phase)[0]
    goals = 0.3 * rng.normal(size=(n_tasks, n_dofs))
    mean = goals[:, :, None] * reach
    grid = np.linspace(0.0, 1.0, n_basis)
    wobble = np.exp(-0.5 * ((grid[:, None] - grid) / 0.3) ** 2)
    covariance = []
    for _ in range(n_tasks):
        factors = rng.normal(size=(3, n_dofs, n_dofs)) * spread / np.sqrt(n_dofs)
        shapes = (np.ones((n_basis, n_basis)) * 0.1, np.outer(reach, reach), 0.1 * wobble)
        total = sum(np.kron(f @ f.T, s) for f, s in zip(factors, shapes, strict=True))
        covariance.append(total + (0.02 * spread) ** 2 * np.eye(n_dofs * n_basis))
    anything = 0.3**2 * (np.ones_like(wobble) + wobble) + 1e-6 * np.eye(n_basis)
    return TaskLibrary(
        labels=tuple(f"task_{k}" for k in range(n_tasks)),
        basis=basis,
        observed_names=tuple(f"human_{i}" for i in range(n_observed)),
        controlled_names=tuple(f"robot_{i}" for i in range(n_controlled)),
        observed_units=("m",) * n_observed,
        controlled_units=("rad",) * n_controlled,
        weight_mean=mean.reshape(n_tasks, -1),
        weight_covariance=np.array(covariance),
        noise_variance=np.full(n_dofs, noise_std**2),
        noise_scale=1.0,
        correlation_time_s=correlation_time_s,
        log_duration_mean=np.full(n_tasks, np.log(duration_s)),
        log_duration_std=np.full(n_tasks, log_duration_std),
        task_prior=np.full(n_tasks, 1.0 / n_tasks),
        transition_prior=np.full((n_tasks + 1, n_tasks), 1.0 / n_tasks),
        none_mean=np.zeros(n_observed * n_basis),
        none_covariance=np.kron(np.eye(n_observed), anything),
        none_log_duration=np.array([np.log(duration_s), 0.3]),
        none_prior=none_prior,
        n_demonstrations=np.full(n_tasks, 10),
        observed_groups=groups,
        onset=tuple(OnsetSettings(reference_speed=0.4) for _ in groups),
    )


def nearly_known(
    shape: np.ndarray, noise_std: float, phase_deviation: PhaseDeviation
) -> TaskLibrary:
    """One task of two observed DOFs and a controlled one, nearly the same in every demonstration.

    Args:
        shape: positions at even phases, (T, 3).
        noise_std: of all DOFs.
        phase_deviation: of the observed agent.
    """
    like = make_library(
        np.random.default_rng(0), n_tasks=1, groups=(2,), n_controlled=1, n_basis=25
    )
    mean = weights_of(like.basis, shape, np.linspace(0.0, 1.0, len(shape)))
    covariance = 0.98 * np.kron(np.eye(3), np.ones((25, 25))) + 0.02 * np.eye(75)
    return replace(
        like,
        weight_mean=mean.reshape(1, -1),
        weight_covariance=0.02**2 * covariance[None],
        noise_variance=np.full(3, noise_std**2),
        phase_deviation=phase_deviation,
    )


def draw_weights(library: TaskLibrary, task: int, rng: np.random.Generator) -> np.ndarray:
    """One demonstration's weights, (D, N)."""
    flat = rng.multivariate_normal(
        library.weight_mean[task], library.weight_covariance[task], method="cholesky"
    )
    return flat.reshape(-1, library.basis.n_basis)


def signals(
    names: tuple[str, ...], groups: tuple[int, ...], stamps_ns: np.ndarray, values, unit: str
) -> tuple[Signal, ...]:
    """Split columns into one signal per group."""
    edges = np.cumsum((0, *groups))
    return tuple(Signal(names[a:b], stamps_ns, values[:, a:b], unit) for a, b in pairwise(edges))


def simulate(
    library: TaskLibrary,
    task: int,
    rng: np.random.Generator,
    *,
    name: str = "demo",
    n_samples: int | None = None,
    rate_hz: float = 50.0,
    duration_s: float | None = None,
    rest_before_s: float = 0.0,
    rest_after_s: float = 0.0,
    weights: np.ndarray | None = None,
) -> Demonstration:
    """A recording drawn from the library: weights, duration and noise at random unless given."""
    timing = library.log_duration_mean[task], library.log_duration_std[task]
    duration = float(np.exp(rng.normal(*timing))) if duration_s is None else duration_s
    w = draw_weights(library, task, rng) if weights is None else weights
    if n_samples is None:
        times = np.arange(-rest_before_s, duration + rest_after_s + 1e-9, 1.0 / rate_hz)
    else:
        times = np.linspace(0.0, duration, n_samples)
    values = library.basis.design_matrix(times / duration) @ w.T
    values = values + rng.normal(size=values.shape) * np.sqrt(library.noise_variance)
    stamps = START_NS + np.round((times - times[0]) * 1e9).astype(np.int64)
    p = library.n_observed
    return Demonstration(
        name,
        "",
        library.labels[task],
        signals(library.observed_names, library.observed_groups, stamps, values[:, :p], "m"),
        signals(library.controlled_names, (library.n_controlled,), stamps, values[:, p:], "rad"),
        START_NS,
        int(stamps[-1]),
    )


def demonstration_of(
    times_s, human, robot, name="", task="a", units=("m", "rad"), **more
) -> Demonstration:
    """One signal of each agent as it is, from START_NS on."""
    stamps_ns = START_NS + np.round(times_s * 1e9).astype(np.int64)
    sides = (
        (Signal(tuple(f"{who}_{k}" for k in range(values.shape[1])), stamps_ns, values, unit),)
        for who, values, unit in zip(("human", "robot"), (human, robot), units, strict=True)
    )
    return Demonstration(name, "", task, *sides, START_NS, int(stamps_ns[-1]), **more)


def gathered(demonstrations: list[Demonstration], settings: TrainingSettings) -> Trained:
    """Their statistics, with a library at the usual hyperparameters and without margins."""
    found, usual = accumulate(demonstrations, settings), Hyperparameters()
    library = library_from_statistics(found.tasks, found.preprocessing, usual)
    return Trained(library, found.preprocessing, found.tasks, usual)
