# SPDX-License-Identifier: Apache-2.0
"""Learning from aligned demonstrations beside movement_primitives, and adding one more."""

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from statistics import median

import numpy as np
from movement_primitives.promp import ProMP

from benchmarks.measure import Result, at_least, at_most, seconds
from intent_recognition.learning import (
    TaskStatistics,
    Trained,
    TrainingSettings,
    accumulate,
    add_demonstration,
    learn_with_report,
    library_from_statistics,
    make_example,
    summarize,
)
from intent_recognition.promp import NormalizedRBFBasis, TaskLibrary, fit_weights
from intent_recognition.signals import Demonstration, Signal

N_DEMONSTRATIONS = 40
N_SAMPLES = 100
N_OBSERVED, N_CONTROLLED = 3, 7
N_DOFS = N_OBSERVED + N_CONTROLLED
DURATION_NS = 2_000_000_000
RIDGE = TrainingSettings().ridge


def training(demonstrations: Sequence[Demonstration]) -> Iterator[Result]:
    """Ridge regression and moments against the peer's expectation maximisation; one added.

    Args:
        demonstrations: labelled ones, to learn a library from that one is added to.
    """
    for n_basis in (10, 20):
        yield _beside_peer(n_basis)
    *some, last = demonstrations
    trained = learn_with_report(some).trained
    added_s = seconds(partial(add_demonstration, trained, last), 15)
    yield at_most(
        f"adding one demonstration to {len(some)}",
        1e3 * added_s,
        20.0,
        "ms",
        f"{trained.library.n_tasks} tasks, cut and fitted",
    )
    added = add_demonstration(trained, last)
    yield at_most(
        "... off the library trained anew",
        _difference(added.library, _anew(demonstrations, added)),
        1e-8,
        "",
        "largest element of means and covariances, of the largest there is; same preprocessing and"
        " hyperparameters",
    )


def _anew(demonstrations: Sequence[Demonstration], like: Trained) -> TaskLibrary:
    """From all at the preprocessing and hyperparameters of another."""
    tasks = accumulate(demonstrations, TrainingSettings(), like.preprocessing).tasks
    return library_from_statistics(tasks, like.preprocessing, like.chosen)


def _difference(found: TaskLibrary, expected: TaskLibrary) -> float:
    pairs = (
        (found.weight_mean, expected.weight_mean),
        (found.weight_covariance, expected.weight_covariance),
    )
    return max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in pairs)


def _beside_peer(n_basis: int) -> Result:
    """The same trajectories to means and covariances of the weights."""
    basis = NormalizedRBFBasis(n_basis, 1.0)
    phase = np.linspace(0.0, 1.0, N_SAMPLES)
    values = aligned_trajectories(basis, phase)
    recorded = [_demonstration(phase, each) for each in values]
    repeated = np.repeat(phase[None], N_DEMONSTRATIONS, axis=0)
    ours = partial(weight_moments, basis, phase, values)
    before_s = seconds(ours, 15)
    theirs_s = _once(partial(_imitate, n_basis, repeated, values))
    ours_s = median((before_s, seconds(ours, 15)))
    statistics_s = seconds(partial(_statistics, basis, recorded), 15)
    return at_least(
        f"training on {N_DEMONSTRATIONS}, N = {n_basis}, movement_primitives takes",
        theirs_s / ours_s,
        500.0,
        "x",
        f"{1e3 * ours_s:.2f} ms, and {1e3 * theirs_s:.0f} ms once; {1e3 * statistics_s:.1f} ms"
        " from recordings to all statistics",
    )


def _once(work: Callable[[], object]) -> float:
    """Time of one call: the peer's takes seconds, and needs no warming up."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def aligned_trajectories(basis: NormalizedRBFBasis, phase: np.ndarray) -> np.ndarray:
    """Smooth random trajectories with noise, (n, T, D)."""
    rng = np.random.default_rng(40)
    steps = rng.normal(size=(N_DEMONSTRATIONS, N_DOFS, basis.n_basis))
    weights = 0.1 * np.cumsum(steps, axis=2)
    clean = np.einsum("tk,ndk->ntd", basis.design_matrix(phase), weights)
    return clean + 0.005 * rng.normal(size=clean.shape)


def weight_moments(
    basis: NormalizedRBFBasis, phase: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean (D N,) and covariance (D N, D N) of the weights of trajectories (n, T, D)."""
    together = np.swapaxes(values, 0, 1).reshape(len(phase), -1)
    weights = fit_weights(basis, phase, together, RIDGE).weights.reshape(len(values), -1)
    mean = weights.mean(axis=0)
    deviations = weights - mean
    return mean, deviations.T @ deviations / (len(weights) - 1)


def _imitate(n_basis: int, times: np.ndarray, values: np.ndarray) -> ProMP:
    primitive = ProMP(n_dims=N_DOFS, n_weights_per_dim=n_basis)
    primitive.imitate(times, values)
    return primitive


def _statistics(basis: NormalizedRBFBasis, recorded: Sequence[Demonstration]) -> TaskStatistics:
    return summarize([make_example(one, basis, RIDGE) for one in recorded])


def _demonstration(phase: np.ndarray, values: np.ndarray) -> Demonstration:
    stamps = np.round(phase * DURATION_NS).astype(np.int64)
    human = tuple(f"human_{k}" for k in range(N_OBSERVED))
    robot = tuple(f"robot_{k}" for k in range(N_CONTROLLED))
    return Demonstration(
        name="aligned",
        source="",
        task="task",
        observed=(Signal(human, stamps, values[:, :N_OBSERVED], "m"),),
        controlled=(Signal(robot, stamps, values[:, N_OBSERVED:], "rad"),),
        start_ns=0,
        end_ns=DURATION_NS,
    )
