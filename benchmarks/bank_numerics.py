# SPDX-License-Identifier: Apache-2.0
"""A million observations with hardly any noise, and a movement beside one joint Gaussian."""

from collections.abc import Iterator

import numpy as np
from scipy.stats import multivariate_normal

from benchmarks.measure import Result, at_least, at_most
from benchmarks.synthetic import DURATION_S, N_BASIS, N_OBSERVED, movement, synthetic_library
from intent_recognition.filtering import MovementFilter, fixed_prior_grid, task_posterior
from intent_recognition.gaussian import GaussianBatch, LinearMeasurement

N_UPDATES = 1_000_000
NOISE_VARIANCE = 1e-8
LOOK_EVERY = 10_000


def numerics(n_updates: int = N_UPDATES) -> Iterator[Result]:
    """The smallest eigenvalue ever, and the distance to the information form at the end.

    Two priors are conditioned: one on phases at random, one on a hand that rests at phase 0.37.
    """
    rng = np.random.default_rng(7)
    library = synthetic_library(rng, 1, n_controlled=0)
    prior = library.observed_covariance[[1, 1]]
    block = GaussianBatch.of(np.zeros(prior.shape[:2]), prior, N_BASIS)
    noise, dofs, values = NOISE_VARIANCE * np.eye(N_OBSERVED), np.arange(N_OBSERVED), np.zeros(3)
    gram = np.zeros((N_BASIS, N_BASIS))
    smallest, asymmetry = np.inf, 0.0
    for start in range(0, n_updates, LOOK_EVERY):
        phase = np.full((LOOK_EVERY, 2), 0.37)
        phase[:, 0] = rng.uniform(size=LOOK_EVERY)
        rows = library.basis.design_matrix(phase[: n_updates - start])
        gram += rows[:, 0].T @ rows[:, 0]
        for row in rows[:, :, None]:
            block.condition(LinearMeasurement(dofs, row, values, noise))
        covariance = block.moments()[1]
        asymmetry = max(asymmetry, np.abs(covariance - covariance.transpose(0, 2, 1)).max())
        smallest = min(smallest, np.linalg.eigvalsh(covariance).min())
    yield at_least(
        f"{n_updates:.0e} observations, smallest eigenvalue",
        smallest,
        np.finfo(float).tiny,
        "m2",
        f"noise variance {NOISE_VARIANCE:.0e}; asymmetry {asymmetry:g}",
    )
    information = np.linalg.inv(prior[0]) + np.kron(np.eye(N_OBSERVED), gram) / NOISE_VARIANCE
    error = np.abs(covariance[0] - np.linalg.inv(information)).max() / np.abs(prior[0]).max()
    yield at_most(
        "... covariance off the batch's, of the prior's", error, 1e-9, "x", "largest element"
    )


def one_movement(n_tasks: int = 30) -> Iterator[Result]:
    """Log evidence, mean and probabilities of every task beside its joint Gaussian's."""
    rng = np.random.default_rng(8)
    library = synthetic_library(rng, n_tasks, n_controlled=0, crowding_s=0.02)
    hypotheses = fixed_prior_grid(library, DURATION_S)
    observations = movement(library, 0, rng)[:100]
    start_ns = observations[0].stamp_ns
    run = MovementFilter(library, hypotheses, start_ns)
    sum_error = 0.0
    for observation in observations:
        run.observe(observation)
        total = task_posterior(run.log_evidence, hypotheses, 0.0).probabilities.sum()
        sum_error = max(sum_error, abs(total - 1.0))
    elapsed_s = np.array([o.stamp_ns - start_ns for o in observations]) * 1e-9
    dofs = np.arange(N_OBSERVED)
    rows = library.basis.design_matrix(elapsed_s / DURATION_S)
    matrix = np.kron(rows[:, None], np.eye(N_OBSERVED)[..., None]).reshape(-1, N_OBSERVED * N_BASIS)
    noise = np.kron(np.eye(len(rows)), library.noise_covariance(dofs, elapsed_s[1]))
    noise[:N_OBSERVED, :N_OBSERVED] = library.noise_covariance(dofs, np.inf)
    values = np.concatenate([o.values for o in observations])
    mean_error = evidence_error = 0.0
    for k, (mean, prior) in enumerate(
        zip(library.observed_mean, library.observed_covariance, strict=True)
    ):
        innovation = matrix @ prior @ matrix.T + noise
        density = multivariate_normal(matrix @ mean, innovation).logpdf(values)
        found = run.log_evidence[k]
        evidence_error = max(evidence_error, abs(found - density) / max(1.0, abs(density)))
        expected = mean + prior @ matrix.T @ np.linalg.solve(innovation, values - matrix @ mean)
        (found,) = run.table.courses(run.rows_of(k)).mean
        error = np.abs(found - expected).max() / np.abs(expected).max()
        mean_error = max(mean_error, error)
    of = f"{n_tasks} tasks and none, {len(rows)} observations, one by one and all at once"
    yield at_most("one movement, mean off the joint Gaussian's", mean_error, 1e-9, "x", of)
    yield at_most("... log evidence off its log density", evidence_error, 1e-8, "x", of)
    yield at_most("... sum of the probabilities off one", sum_error, 1e-12, "", "ever")
