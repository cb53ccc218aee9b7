# SPDX-License-Identifier: Apache-2.0
"""The filter bank beside other libraries, and how its cost grows with tasks and hypotheses.

Times are of this thread on the processor, and the shortest of many where each does the same work,
on both sides of a ratio: other programs disturb them least so. What a peer is
given, the bank is given: filterpy and simdkalman take a ready observation matrix, so the bank
takes ready rows; movement_primitives evaluates its basis functions, so `MovementFilter.observe`
is timed: phase, basis functions, noise, and the update. Every update is of means, covariances and
evidence.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from statistics import mean

import numpy as np

from benchmarks.measure import Result, at_least, at_most
from benchmarks.synthetic import DURATION_S, N_BASIS, N_OBSERVED, movement, synthetic_library
from intent_recognition.filtering import (
    MovementFilter,
    PriorGrid,
    fixed_prior_grid,
    make_prior_grid,
)
from intent_recognition.gaussian import GaussianBatch, LinearMeasurement
from intent_recognition.promp import TaskLibrary

PHASE = 0.4
BATCH = 16
"""Observations timed at once: one alone is short beside what the clock tells apart."""
N_SCALES = 10
USE_ALL_S = 1e-6
"""Correlation time at which no observation follows too closely on the last one to be used [s]."""


class Stream:
    """A bank under way which takes `BATCH` observations a call, from a stream without end.

    Args:
        library: the tasks.
        hypotheses: the grid.
        prune: let negligible tasks lag.
        rows_given: only `GaussianBatch.condition` is timed.

    Attributes:
        run: the filter.
        given: what is conditioned on ready rows instead; None without `rows_given`.
    """

    def __init__(
        self,
        library: TaskLibrary,
        hypotheses: PriorGrid,
        *,
        prune: bool = False,
        rows_given: bool = False,
    ):
        self._rng = np.random.default_rng(3)
        library = replace(library, correlation_time_s=USE_ALL_S)
        self._library, self._hypotheses = library, hypotheses
        self.run = MovementFilter(library, hypotheses, 0, prune=prune)
        mean, covariance = library.observed_mean, library.observed_covariance
        self.given = GaussianBatch.of(mean, covariance, N_BASIS) if rows_given else None
        self._noise = library.noise_covariance(np.arange(N_OBSERVED), 0.01)
        self._restart()

    def _restart(self) -> None:
        self._rest = movement(self._library, 0, self._rng)
        self._start_ns = self._rest[0].stamp_ns
        self.run.restart(self._start_ns)

    def next(self) -> Callable[[], None]:
        """Work to be timed: the next few observations, of a new movement when they are used up."""
        if len(self._rest) < BATCH:
            self._restart()
        taken, self._rest = self._rest[:BATCH], self._rest[BATCH:]
        if self.given is None:
            return partial(_each, self.run.observe, [(observation,) for observation in taken])
        dofs = np.arange(N_OBSERVED)
        elapsed_s = np.array([[(one.stamp_ns - self._start_ns) * 1e-9] for one in taken])
        rows = self._library.basis.design_matrix(elapsed_s / self._hypotheses.duration_s)
        work = [
            (LinearMeasurement(dofs, row[:, None], observation.values, self._noise),)
            for row, observation in zip(rows, taken, strict=True)
        ]
        return partial(_each, self.given.condition, work)


def _each(work: Callable[..., object], arguments: list[tuple]) -> None:
    for some in arguments:
        work(*some)


def per_observation(
    stream: Stream,
    other: Callable[[], object] | Stream,
    repeats: int,
    average: Callable[[list[float]], float] = min,
) -> tuple[float, float]:
    """Times of one observation and of a call of the other, taken in turn, in seconds."""
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(repeats):
        ours, theirs = stream.next(), other.next() if isinstance(other, Stream) else other
        start = time.thread_time()
        ours()
        middle = time.thread_time()
        theirs()
        stop = time.thread_time()
        times[0].append((middle - start) / BATCH)
        times[1].append((stop - middle) / (BATCH if isinstance(other, Stream) else 1))
    return average(times[0]), average(times[1])


def bank() -> Iterator[Result]:
    """All of the filter bank's benchmarks that are timed."""
    rng = np.random.default_rng(30)
    yield from _beside_peers(synthetic_library(rng, 3), {"movement_primitives": 20, "filterpy": 40})
    yield from _beside_peers(
        synthetic_library(rng, 300), {"movement_primitives": 100, "filterpy": 200, "simdkalman": 2}
    )
    yield _phases(synthetic_library(rng, 30))
    yield from _many_tasks(rng)


def _beside_peers(library: TaskLibrary, required: dict[str, float]) -> Iterator[Result]:
    from benchmarks import bank_peers as peers

    hypotheses = fixed_prior_grid(library, DURATION_S)
    noise = library.noise_covariance(np.arange(N_OBSERVED), np.inf)
    weights = library.observed_mean[0].reshape(N_OBSERVED, N_BASIS)
    (values,) = library.basis.design_matrix(np.array([PHASE])) @ weights.T
    for name, ratio in required.items():
        theirs = getattr(peers, name)(library, noise, values, PHASE)
        stream = Stream(library, hypotheses, rows_given=name in peers.MATRIX_GIVEN)
        repeats = 200 if library.n_tasks < 10 else 120
        ours_s, theirs_s = per_observation(stream, theirs, repeats)
        together = name in peers.ALL_AT_ONCE
        total_s = theirs_s if together else theirs_s * library.n_tasks
        yield at_least(
            f"one observation, {library.n_tasks} tasks, {name} takes",
            total_s / ours_s,
            ratio,
            "x",
            f"{1e6 * ours_s:.0f} us, and {1e6 * theirs_s:.0f} us "
            + ("for all tasks" if together else "a task, one after the other")
            + f"; shortest of {repeats}",
        )


def _phases(library: TaskLibrary) -> Result:
    """As the estimator runs it, over whole movements: negligible tasks are pruned."""
    one = make_prior_grid(library, n_scales=1)
    ten = make_prior_grid(library, n_scales=N_SCALES)
    all_s, one_s = per_observation(Stream(library, ten), Stream(library, one), 36)
    many_s, one_s = per_observation(
        Stream(library, ten, prune=True), Stream(library, one, prune=True), 72, mean
    )
    return at_most(
        f"{library.n_tasks} tasks with {N_SCALES} phases / with one",
        many_s / one_s,
        6.0,
        "x",
        f"mean of whole movements: {1e6 * many_s:.0f} and {1e6 * one_s:.0f} us an observation,"
        f" tasks pruned as in the estimator; {1e6 * all_s:.0f} us if none were",
    )


def _many_tasks(rng: np.random.Generator) -> Iterator[Result]:
    n_tasks = 10_000
    library = synthetic_library(rng, n_tasks, n_controlled=0)
    hypotheses = fixed_prior_grid(library, DURATION_S)
    size = N_OBSERVED * N_BASIS
    numbers, copy = (np.ones((n_tasks, size + size**2)) for _ in range(2))
    stream = Stream(library, hypotheses)
    ours_s, copy_s = per_observation(stream, partial(np.copyto, copy, numbers), 6)
    yield at_most(
        "one observation, 10,000 tasks / numpy's copy",
        ours_s / copy_s,
        5.0,
        "x",
        f"{1e3 * ours_s:.0f} and {1e3 * copy_s:.0f} ms, shortest of 6; none pruned",
    )
    arrays = [held for held in vars(stream.run.table).values() if isinstance(held, np.ndarray)]
    n_bytes = sum(array.nbytes for array in arrays)
    yield at_most("... state", n_bytes / 1e9, 2.0, "GB", "working memory included")
    del stream, numbers, copy
    yield _pruned(library, hypotheses, ours_s)


def _pruned(library: TaskLibrary, hypotheses: PriorGrid, full_s: float) -> Result:
    """A movement whose negligible tasks are pruned, its second half against no pruning."""
    stream = movement(library, 0, np.random.default_rng(5))
    run = MovementFilter(library, hypotheses, stream[0].stamp_ns, prune=True)
    times = []
    for observation in stream:
        start = time.thread_time()
        run.observe(observation)
        times.append(time.thread_time() - start)
    late_s = mean(times[len(times) // 2 :])
    return at_most(
        "... mean of the second half, negligible ones pruned",
        late_s / full_s,
        0.2,
        "of it",
        f"{library.n_tasks + 1 - len(run.pruned_tasks)} tasks left at the end;"
        f" {1e3 * late_s:.1f} ms an observation, whole movement {1e3 * mean(times):.0f},"
        f" longest {1e3 * max(times):.0f}",
    )
