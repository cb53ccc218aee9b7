# SPDX-License-Identifier: Apache-2.0
"""Bayes over tasks and durations against the rule written out, and in simulation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import t
from simulation import make_library

from intent_recognition.filtering import task_posterior
from intent_recognition.filtering.grid import STUDENT_FREEDOM, PriorGrid, make_prior_grid
from intent_recognition.filtering.posterior import answered, beyond_margin, counted_none

seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=40)
@given(seeds, st.integers(1, 4), st.integers(1, 5))
def test_equals_bayes_written_out(seed, n_tasks, n_scales):
    rng = np.random.default_rng(seed)
    shape = (n_tasks + 1, n_scales)
    prior = rng.dirichlet(np.ones(shape[0] * shape[1])).reshape(shape)
    evidence = rng.uniform(0.01, 1.0, size=shape)
    duration = rng.uniform(0.5, 5.0, size=shape)
    hypotheses = PriorGrid(n_scales, duration.ravel(), np.log(prior).ravel())
    posterior = task_posterior(np.log(evidence).ravel(), hypotheses, 1.0)
    joint = prior * evidence
    by_task = joint.sum(axis=1)
    np.testing.assert_allclose(posterior.probabilities, by_task / by_task.sum())
    np.testing.assert_allclose(np.exp(posterior.log_evidence), by_task / prior.sum(axis=1))
    given_task = joint / by_task[:, None]
    np.testing.assert_allclose(posterior.scale_weights, given_task)
    np.testing.assert_allclose(posterior.duration_s, (given_task * duration).sum(axis=1))
    phase = (given_task * np.minimum(1.0 / duration, 1.0)).sum(axis=1)
    np.testing.assert_allclose(posterior.phase, phase)


def test_an_impossible_task_stays_impossible_and_nothing_turns_into_nan():
    log_prior = np.log(np.array([0.5, 0.5, 1e-300, 1e-300]))
    log_prior[:2] = -np.inf
    hypotheses = PriorGrid(2, np.ones(4), log_prior)
    with np.errstate(invalid="raise"):
        posterior = task_posterior(np.array([5.0, 5.0, -1e5, -2e5]), hypotheses, 0.5)
    assert posterior.probabilities.tolist() == [0.0, 1.0]
    assert np.isneginf(posterior.log_evidence[0])
    assert np.all(np.isfinite(posterior.phase))
    weights = hypotheses.duration_weights(np.array([5.0, 6.0, -1e5, -2e5]))[0]
    assert weights[1] == pytest.approx(1.0 / (1.0 + np.exp(-1.0)))


def test_an_answer_is_right_in_99_of_100_cases(rng):
    hypotheses = PriorGrid(1, np.ones(4), np.log([0.4, 0.3, 0.2, 0.1]))
    before = task_posterior(rng.normal(size=4), hypotheses, 0.5)
    after = answered(before, 2)
    likelihood = np.array([0.01, 0.01, 2.97, 0.01]) / 3.0
    joint = before.probabilities * likelihood
    np.testing.assert_allclose(after.probabilities, joint / joint.sum())
    gained = after.log_evidence - before.log_evidence
    np.testing.assert_allclose(gained, np.log(likelihood))


def test_the_evidence_of_the_duration_can_be_taken_to_a_power(rng):
    """It moves the duration's posterior toward the prior, and nothing else."""
    library = make_library(rng, n_tasks=2, n_basis=6)
    hypotheses = make_prior_grid(library, n_scales=5)
    evidence = rng.normal(size=15) * 10.0
    exact = task_posterior(evidence, hypotheses, 0.5)
    for power in (1.0, 0.3, 0.0):
        found = task_posterior(evidence, hypotheses._replace(duration_evidence=power), 0.5)
        prior = hypotheses.log_prior.reshape(3, 5)
        expected = np.exp(prior + power * evidence.reshape(3, 5))
        expected /= expected.sum(axis=1, keepdims=True)
        np.testing.assert_allclose(found.scale_weights, expected, atol=1e-12)
        np.testing.assert_array_equal(found.probabilities, exact.probabilities)
        np.testing.assert_array_equal(found.log_evidence, exact.log_evidence)


def test_the_evidence_of_the_tasks_against_each_other_can_be_taken_to_a_power(rng):
    """Their log odds shrink; none, the durations and what is most probable stay."""
    library = make_library(rng, n_tasks=3, n_basis=6)
    hypotheses = make_prior_grid(library, np.array([0.5, 0.3, 0.2]), n_scales=5)
    hypotheses = hypotheses._replace(none_margin=2.0)
    evidence = rng.normal(size=20) * 4.0
    exact = task_posterior(evidence, hypotheses, 0.5)
    for power in (1.0, 0.6, 0.1):
        found = task_posterior(evidence, hypotheses._replace(task_evidence=power), 0.5)
        odds, whole = np.diff(found.log_evidence[:-1]), np.diff(exact.log_evidence[:-1])
        np.testing.assert_allclose(odds, power * whole, atol=1e-10)
        prior = np.diff(hypotheses.log_task_prior[:-1])
        np.testing.assert_allclose(
            np.diff(np.log(found.probabilities[:-1])), prior + power * whole, atol=1e-10
        )
        assert found.probabilities[-1] == pytest.approx(exact.probabilities[-1], rel=1e-9)
        assert found.log_evidence[-1] == exact.log_evidence[-1]
        np.testing.assert_array_equal(found.scale_weights, exact.scale_weights)


factors = st.floats(-300.0, 300.0)
margins = st.floats(0.0, 60.0)


@given(factors, factors, margins)
def test_beyond_the_margin_is_odd_monotone_and_never_more_than_there_is(one, other, margin):
    assert beyond_margin(one, 0.0) == pytest.approx(one, abs=1e-12)
    assert beyond_margin(-one, margin) == pytest.approx(-beyond_margin(one, margin), abs=1e-12)
    low, high = sorted((one, other))
    assert beyond_margin(low, margin) <= beyond_margin(high, margin)
    assert abs(beyond_margin(one, margin)) <= abs(one) + 1e-12


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.floats(0.0, 20.0))
def test_a_margin_moves_none_only_and_by_what_counts(seed, n_tasks, margin):
    rng = np.random.default_rng(seed)
    log_prior = np.log(rng.dirichlet(np.ones(2 * (n_tasks + 1))))
    plain = PriorGrid(2, rng.uniform(0.5, 5.0, size=len(log_prior)), log_prior)
    evidence = 10.0 * rng.normal(size=len(log_prior))
    before = task_posterior(evidence, plain, 1.0)
    after = task_posterior(evidence, plain._replace(none_margin=margin), 1.0)
    np.testing.assert_array_equal(after.log_evidence[:-1], before.log_evidence[:-1])
    np.testing.assert_array_equal(after.scale_weights, before.scale_weights)
    known, kept = (p.probabilities[:-1] / p.probabilities[:-1].sum() for p in (before, after))
    np.testing.assert_allclose(kept, known, rtol=1e-9)
    prior = np.exp(plain.log_task_prior)
    total = np.log(prior[:-1] @ np.exp(before.log_evidence[:-1]) / prior[:-1].sum())
    factor = beyond_margin(total - before.log_evidence[-1], margin)
    odds = prior[:-1].sum() / prior[-1] * np.exp(factor)
    assert after.probabilities[-1] == pytest.approx(1.0 / (1.0 + odds), rel=1e-9)


@pytest.mark.parametrize(
    ("evidence", "expected"), [([-np.inf, -np.inf, 2.0], 2.0), ([1.0, 0.0, -np.inf], -np.inf)]
)
def test_what_is_impossible_is_no_matter_of_a_margin(evidence, expected):
    assert counted_none(np.array(evidence), np.log([0.5, 0.4, 0.1]), 5.0) == expected


@given(seeds, st.integers(1, 20))
@settings(max_examples=10)
def test_grid_of_durations_covers_the_timing_prior(seed, n_scales):
    library = make_library(np.random.default_rng(seed), n_basis=4)
    hypotheses = make_prior_grid(library, n_scales=n_scales)
    logs = np.log(hypotheses.duration_s).reshape(-1, n_scales)
    weight = np.exp(hypotheses.log_prior).reshape(-1, n_scales)
    assert np.exp(hypotheses.log_prior).sum() == pytest.approx(1.0, abs=1e-12)
    prior = np.r_[library.task_prior * (1 - library.none_prior), library.none_prior]
    np.testing.assert_allclose(weight.sum(axis=1), prior, atol=1e-12)
    spread = library.log_duration_mean[0], library.log_duration_std[0]
    density = t(STUDENT_FREEDOM, *spread).pdf(logs[0])
    np.testing.assert_allclose(weight[0] / weight[0].sum(), density / density.sum(), atol=1e-12)
    mean = (weight * logs).sum(axis=1) / prior
    np.testing.assert_allclose(mean[:-1], library.log_duration_mean, atol=1e-12)
    np.testing.assert_allclose(np.exp(hypotheses.log_task_prior), prior, atol=1e-12)
