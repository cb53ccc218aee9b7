# SPDX-License-Identifier: Apache-2.0
"""Pruned tasks: the posterior stays what it is, and every task can be restored."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import bank_of
from simulation import START_NS, make_library, simulate

from intent_recognition.filtering import MovementFilter, births, filter, make_prior_grid
from intent_recognition.promp.phase_deviation import PhaseDeviation
from intent_recognition.recognition.transitions import weigh
from intent_recognition.signals.observation import merge

seeds = st.integers(0, 2**32 - 1)
N_SCALES = 4
BRIDGE = np.sqrt(4.0 * np.linspace(0, 1, 51) * np.linspace(1, 0, 51))
LEADING = {"phase_deviation": PhaseDeviation(0.06 * BRIDGE, 0.4, 0.5), "evidence_freedom": 8.0}
ROUNDING = {"rtol": 1e-10, "atol": 1e-10}
"""Log evidences are sums of hundreds of terms, in another order in a task that was restored."""
FILTERS = pytest.mark.parametrize("filtered", [{}, LEADING], ids=["steady", "leading"])


@pytest.fixture(autouse=True, scope="module")
def prune_early():
    """Tasks lag in small banks, too, and have to catch up more often."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(filter, "PRUNE_FROM", 128)
        patch.setattr(filter, "PRUNE_BELOW", 60.0)
        yield


def scene(seed: int, n_tasks: int = 40, *, filtered=(), **made):
    """A library of many tasks, its grid, and what is seen of one of them."""
    rng = np.random.default_rng(seed)
    library = make_library(rng, n_tasks=n_tasks, n_basis=8, **made)
    task = int(rng.integers(n_tasks))
    observations = list(merge(simulate(library, task, rng, rate_hz=40.0).observed))
    library = replace(library, **dict(filtered))
    return library, make_prior_grid(library, n_scales=N_SCALES), observations


def runs(library, hypotheses):
    """The same bank with and without pruning."""
    return (MovementFilter(library, hypotheses, START_NS, prune=prune) for prune in (True, False))


def observe(runs, observations, *, same: bool = False) -> None:
    """Take observations with some filters; `same`: their probabilities are, after each."""
    for observation in observations:
        for run in runs:
            run.observe(observation)
        if same:
            np.testing.assert_allclose(*(probabilities(run) for run in runs), atol=1e-12)


def probabilities(run: MovementFilter) -> np.ndarray:
    return run.posterior(START_NS).probabilities


def task_joint(log_evidence: np.ndarray, hypotheses) -> np.ndarray:
    joint = (log_evidence + hypotheses.log_prior).reshape(-1, hypotheses.n_scales)
    return np.logaddexp.reduce(joint, axis=1)


@pytest.mark.slow
@FILTERS
@settings(max_examples=3)
@given(seed=seeds, correlation_time_s=st.sampled_from([1e-9, 0.1]))
def test_probabilities_are_those_of_a_bank_never_pruned(seed, correlation_time_s, filtered):
    library, hypotheses, observations = scene(
        seed, filtered=filtered, correlation_time_s=correlation_time_s
    )
    pruned, whole = runs(library, hypotheses)
    most_pruned = 0
    for observation in observations:
        observe((pruned, whole), [observation], same=True)
        assert probabilities(pruned).sum() == pytest.approx(1.0, abs=1e-12)
        bound = task_joint(pruned.log_evidence, hypotheses)
        assert np.all(task_joint(whole.log_evidence, hypotheses) <= bound + 1e-8)
        most_pruned = max(most_pruned, len(pruned.pruned_tasks))
    assert most_pruned >= 3
    assert library.n_tasks not in pruned.pruned_tasks  # none


@pytest.mark.slow
@FILTERS
@settings(max_examples=2)
@given(seed=seeds)
def test_a_pruned_task_comes_back_as_if_it_had_never_been_pruned(seed, filtered):
    library, hypotheses, observations = scene(seed, filtered=filtered)
    pruned, whole = runs(library, hypotheses)
    observe((pruned, whole), observations[:70])
    expected = bank_of(whole)
    for task in pruned.pruned_tasks[:1]:  # one alone, then all others
        one = pruned.table.courses(pruned.rows_of(int(task)))
        block = slice(task * N_SCALES, (task + 1) * N_SCALES)
        np.testing.assert_allclose(one.mean, expected.mean[block], **ROUNDING)
        assert task not in pruned.pruned_tasks
    assert_same(pruned, whole)
    assert not len(pruned.pruned_tasks)
    observe((pruned, whole), observations[70:])  # and goes on
    assert_same(pruned, whole)


def assert_same(one: MovementFilter, other: MovementFilter) -> None:
    """All weights, and past, present and future deviations; restored tasks look back on all."""
    for ours, theirs in zip(bank_of(one), bank_of(other), strict=True):
        np.testing.assert_allclose(ours, theirs, **ROUNDING)
    times_s = np.linspace(0.0, 3.0, 13)
    for task in range(one.library.n_tasks + 1):
        ours, theirs = (run.prediction(task) for run in (one, other))
        np.testing.assert_allclose(ours.duration_weights, theirs.duration_weights, atol=1e-12)
        np.testing.assert_allclose(
            ours.deviations_at(times_s), theirs.deviations_at(times_s), atol=1e-12
        )


def test_hypotheses_are_born_of_the_tasks_that_are_most_probable_though_they_lag():
    library, hypotheses, observations = scene(3)
    pruned, whole = (
        MovementFilter(library, hypotheses, START_NS, prune=prune, switching=True)
        for prune in (True, False)
    )
    for observation in observations:
        observe((pruned, whole), [observation])
        ours, theirs = (np.unique(run.births.table.rows["task"]) for run in (pruned, whole))
        assert np.array_equal(ours, theirs)
    assert len(pruned.pruned_tasks) > library.n_tasks - 2 * births.MAX_TASKS


def test_few_hypotheses_are_all_filtered_and_an_outlier_prunes_none_for_good(rng):
    library = make_library(rng, n_basis=4)
    run = MovementFilter(library, make_prior_grid(library), START_NS, prune=True)
    observe([run], merge(simulate(library, 0, rng).observed))
    assert not len(run.pruned_tasks)
    library, hypotheses, observations = scene(7)
    pruned, whole = runs(library, hypotheses)
    observations[60] = observations[60]._replace(values=observations[60].values + 3.0)
    observe((pruned, whole), observations, same=True)


@pytest.mark.parametrize("unlikely", [1e-40, 0.0])
def test_a_posterior_that_is_weighed_anew_is_exact_too(unlikely):
    """The likeliest are made next to impossible: the others must not have been left behind."""
    library, hypotheses, observations = scene(7)
    whole = MovementFilter(library, hypotheses, START_NS)
    observe([whole], observations)
    joint = task_joint(whole.log_evidence, hypotheses)[:-1]
    ratio = np.where(joint > joint.max() - 100.0, unlikely, 1.0)
    whole = MovementFilter(library, hypotheses, START_NS)
    pruned = MovementFilter(library, hypotheses, START_NS, prune=True)
    pruned.restart(START_NS, ratio)
    for observation in observations:
        observe((pruned, whole), [observation])
        ours, theirs = (
            weigh(run.posterior(START_NS), ratio).probabilities for run in (pruned, whole)
        )
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    assert len(pruned.pruned_tasks)


def test_an_excluded_task_is_pruned_and_stays_impossible():
    library, _, observations = scene(8, n_tasks=40)
    prior = np.full(40, 1.0 / 39.0)
    prior[3] = 0.0
    with np.errstate(all="raise"):
        hypotheses = make_prior_grid(library, prior, N_SCALES)
    run = MovementFilter(library, hypotheses, START_NS, prune=True)
    for observation in observations:
        run.observe(observation)
        assert probabilities(run)[3] == 0.0
    assert 3 in run.pruned_tasks
    assert np.all(np.isfinite(bank_of(run).mean))


def test_memory_used_again_remembers_nothing():
    library, hypotheses, observations = scene(11)
    used = MovementFilter(library, hypotheses, START_NS, prune=True)
    observe([used], observations)
    assert len(used.pruned_tasks)
    fresh = MovementFilter(library, hypotheses, START_NS)
    used.restart(START_NS)
    observe((used, fresh), observations[:7])
    for ours, theirs in zip(bank_of(used), bank_of(fresh), strict=True):
        assert np.array_equal(ours, theirs)
