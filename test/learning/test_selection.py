# SPDX-License-Identifier: Apache-2.0
"""The batched leave-one-out scores against a slow loop, and what they choose."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.gaussian.normal import Gaussian, condition
from intent_recognition.learning.selection import (
    FRACTIONS,
    NOISE_SCALES,
    STRENGTHS,
    TaskSamples,
    leave_one_out_scores,
    select,
)
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.prior import Scatter, structured_target, weight_floor

BASIS = NormalizedRBFBasis(5, 1.0)
PHASE = (np.arange(12) + 0.5) / 12
SCORED = BASIS.design_matrix(np.linspace(0, 1, 6))
P, Q = 2, 1


def scatter_of(weights: np.ndarray) -> Scatter:
    """Of one task, (n, D, N)."""
    flat = (weights - weights.mean(axis=0)).reshape(len(weights), -1)
    return Scatter(flat.T @ flat, len(weights) - 1)


def make_samples(rng: np.random.Generator, weights: np.ndarray, noise_std: float) -> TaskSamples:
    """Samples of demonstrations of given weights (n, P + Q, N)."""
    n = len(weights)
    design = BASIS.design_matrix(PHASE)
    observed = np.einsum("mk,npk->nmp", design, weights[:, :P])
    controlled = np.einsum("sk,nqk->nsq", SCORED, weights[:, P:])
    return TaskSamples(
        weights.mean(axis=0),
        scatter_of(weights),
        weights,
        observed + noise_std * rng.normal(size=observed.shape),
        np.repeat(design[None], n, axis=0),
        np.repeat(PHASE[None], n, axis=0),
        controlled + noise_std * rng.normal(size=controlled.shape),
    )


def slow_scores(samples, target, noise_variance, strength, scale) -> np.ndarray:
    """Each demonstration predicted by one `gaussian.condition`, (n,): mean over DOF and sample."""
    n, n_dofs, _ = samples.weights.shape
    result = np.zeros(n)
    for i in range(n):
        rest = np.delete(samples.weights, i, axis=0).reshape(n - 1, -1)
        mean = rest.mean(axis=0)
        scatter = sum(np.outer(w - mean, w - mean) for w in rest)
        covariance = (scatter + strength * target) / (n - 2 + strength) * (1 + 1 / (n - 1))
        errors = []
        for fraction in FRACTIONS:
            seen = np.flatnonzero(samples.phase[i] <= fraction + 1e-9)
            H = np.vstack([np.kron(np.eye(n_dofs)[:P], samples.design[i, m]) for m in seen])
            R = np.diag(np.tile(scale * noise_variance[:P], len(seen)))
            posterior, _ = condition(
                Gaussian(mean, covariance), H, samples.observed[i, seen].ravel(), R
            )
            for s, row in enumerate(SCORED):
                for q in range(Q):
                    h = np.kron(np.eye(n_dofs)[P + q], row)
                    along = np.var(samples.mean[P + q])
                    between = np.mean(np.var(samples.weights[:, P + q], axis=0, ddof=1))
                    spread = along + between + noise_variance[P + q]
                    truth = samples.controlled[i, s, q]
                    errors.append((h @ posterior.mean - truth) ** 2 / spread)
        result[i] = np.mean(errors)
    return result


@settings(max_examples=5)
@given(st.integers(0, 2**32 - 1), st.integers(2, 5), st.sampled_from(STRENGTHS))
def test_batched_scores_equal_a_slow_independent_loop(seed, n, strength):
    rng = np.random.default_rng(seed)
    weights = rng.normal(size=(n, P + Q, BASIS.n_basis))
    samples = make_samples(rng, weights, 0.1)
    root = rng.normal(size=(15, 15))
    target, noise = root @ root.T / 15 + 0.1 * np.eye(15), rng.uniform(0.01, 0.1, size=P + Q)
    scales = (1.0, 7.0)
    found = leave_one_out_scores(samples, target, noise, SCORED, strength, scales)
    expected = [slow_scores(samples, target, noise, strength, scale) for scale in scales]
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)


def targets_of(tasks: list[np.ndarray]) -> list[np.ndarray]:
    """Target covariance of each task from the weights of all."""
    floor = weight_floor(np.concatenate(tasks))
    own = [scatter_of(weights) for weights in tasks]
    pooled = Scatter(sum(s.matrix for s in own), sum(s.freedom for s in own))
    return [structured_target(scatter, pooled, floor).covariance() for scatter in own]


def choose(rng: np.random.Generator, tasks: list[np.ndarray], noise_std: float = 0.05):
    samples = [make_samples(rng, w, noise_std) for w in tasks]
    return select(samples, targets_of(tasks), np.full(P + Q, noise_std**2), SCORED)


def structured(rng: np.random.Generator, n: int) -> np.ndarray:
    """Displacements and smooth deformations, both shared by the DOFs."""
    mix = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.7, 0.5, 0.5]])
    grid = np.linspace(0, 1, BASIS.n_basis)
    root = np.linalg.cholesky(np.exp(-0.5 * ((grid[:, None] - grid) / 0.4) ** 2) + 1e-6 * np.eye(5))
    shape = np.einsum("de,nel,kl->ndk", mix, rng.normal(size=(n, 3, 5)), root)
    return shape + np.einsum("de,ne->nd", mix, rng.normal(size=(n, 3)))[:, :, None]


def unstructured(rng: np.random.Generator, n: int) -> np.ndarray:
    """A fixed arbitrary low-rank coupling that no product of two covariances can express."""
    loading = np.random.default_rng(123).normal(size=(15, 3))
    drawn = rng.normal(size=(n, 3)) @ loading.T + 0.02 * rng.normal(size=(n, 15))
    return drawn.reshape(n, 3, 5)


def test_few_structured_demonstrations_ask_for_strong_shrinkage(rng):
    chosen = [choose(rng, [structured(rng, 5) for _ in range(4)])[0].strength for _ in range(5)]
    assert np.median(chosen) >= 20.0


def test_many_unstructured_demonstrations_ask_for_weak_shrinkage(rng):
    chosen = [choose(rng, [unstructured(rng, 80)])[0].strength for _ in range(3)]
    assert np.max(chosen) <= 5.0


def test_the_choice_is_among_the_best_of_all_that_were_tried(rng):
    chosen, tried = choose(rng, [structured(rng, 8), structured(rng, 6)])
    assert chosen in tried
    assert {(c.strength, c.noise_scale) for c in tried} == {
        (s, n) for s in STRENGTHS for n in NOISE_SCALES
    }
    scores = np.array([c.score for c in tried])
    assert np.all(np.isfinite(scores))
    assert chosen.score <= np.quantile(scores, 0.5)


def test_excess_noise_is_noticed(rng):
    """Noise that was underestimated tenfold in standard deviation is scaled up."""
    tasks = [structured(rng, 12) for _ in range(3)]
    samples = [make_samples(rng, w, 0.5) for w in tasks]
    noise = np.array([0.05**2, 0.05**2, 0.5**2])
    chosen, _ = select(samples, targets_of(tasks), noise, SCORED)
    assert chosen.noise_scale >= 16.0


def test_a_task_may_come_in_parts(rng):
    """The demonstrations left out in parts, each predicted from all others."""
    weights = structured(rng, 7)
    whole, (target,) = make_samples(rng, weights, 0.1), targets_of([weights])
    targets, noise = np.repeat(target[None], 7, axis=0), np.full(3, 0.01)
    arrays = ("weights", "observed", "design", "phase", "controlled")
    parts = [
        whole._replace(**{name: getattr(whole, name)[part] for name in arrays})
        for part in (slice(0, 3), slice(3, 7))
    ]
    chosen, tried = select([whole], [targets], noise, SCORED)
    again, tried_again = select(iter(parts), iter([targets[:3], targets[3:]]), noise, SCORED)
    np.testing.assert_allclose(tried_again, tried, rtol=1e-12)
    assert again[:2] == chosen[:2]


def test_tasks_of_one_demonstration_do_not_vote(rng):
    many, one = structured(rng, 6), structured(rng, 1)
    noise, targets = np.full(3, 0.01), [np.eye(15), np.eye(15)]
    samples = [make_samples(rng, w, 0.1) for w in (many, one)]
    with_it = select(samples, targets, noise, SCORED)
    without = select(samples[:1], targets[:1], noise, SCORED)
    assert with_it == without
    nothing, tried = select(samples[1:], targets[1:], noise, SCORED)
    assert np.isnan(nothing.score)
    assert nothing.strength in STRENGTHS
    assert nothing.noise_scale in NOISE_SCALES
    assert len(tried) == 1


@pytest.mark.parametrize("n", [2, 3])
def test_two_or_three_identical_demonstrations_still_get_a_finite_choice(rng, n):
    weights = np.repeat(structured(rng, 1), n, axis=0)
    samples = make_samples(rng, weights, 0.0)
    chosen, _ = select([samples], targets_of([weights]), weight_floor(weights), SCORED)
    assert np.isfinite(chosen.score)
