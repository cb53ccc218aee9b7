# SPDX-License-Identifier: Apache-2.0
"""Why a task is more probable: the parts sum to what the estimator reports, and are densities."""

from math import inf

import numpy as np
import pytest
from online_stream import feed, movement
from scipy.stats import multivariate_normal
from simulation import START_NS, draw_weights, make_library

from intent_recognition.errors import ArgumentError
from intent_recognition.filtering import MovementFilter, fixed_prior_grid
from intent_recognition.recognition import IntentEstimator, without_dofs
from intent_recognition.recognition.explaining import explain_movement
from intent_recognition.signals import Observation, merge

DURATION_S = 2.0


def follow(library, truth, expected):
    """An estimator in the middle of a movement, and its estimates."""
    recorded = movement(truth, 1, np.random.default_rng(3))
    stop_ns = recorded.start_ns + 2 * (recorded.end_ns - recorded.start_ns) // 3
    estimator = IntentEstimator(library)
    estimator.expect(expected)
    stream = [o for o in merge(recorded.observed) if o.stamp_ns <= stop_ns]
    estimates = feed(estimator, stream)
    assert estimates[-1].moving
    return estimator, estimates


@pytest.fixture(scope="module")
def followed(library, truth):
    return follow(library, truth, "")


@pytest.mark.parametrize("pair", [(None, None), ("task_0", "task_2"), ("task_1", "none")])
def test_the_parts_sum_to_the_odds_that_the_estimator_reports(followed, pair):
    estimator, estimates = followed
    last = estimates[-1]
    found = estimator.explain(*pair)
    p = last.task_probabilities
    assert found.by_dof.shape == (len(found.times_s), 3)
    np.testing.assert_allclose(found.log_odds, np.log(p[found.task] / p[found.rival]), rtol=1e-9)
    task, rival = (last.labels.index(label) for label in (found.task, found.rival))
    over_time = {
        e.stamp_ns: e.log_evidence[task] - e.log_evidence[rival] for e in estimates if e.moving
    }
    summed = np.cumsum(found.by_dof.sum(axis=1))
    stamps_ns = last.onset_ns + np.round(found.times_s * 1e9).astype(np.int64)
    compared = 0
    for stamp_ns, total in zip(stamps_ns.tolist(), summed, strict=True):
        if stamp_ns in over_time:
            np.testing.assert_allclose(total, over_time[stamp_ns], rtol=1e-9, atol=1e-8)
            compared += 1
    assert compared > 20


def test_the_first_pair_are_the_most_probable_tasks_or_as_expected(followed, library, truth):
    estimator, estimates = followed
    found = estimator.explain()
    p = estimates[-1].task_probabilities
    assert p["none"] < p[found.task]
    ranked = sorted((label for label in p if label != "none"), key=p.__getitem__, reverse=True)
    assert [found.task, found.rival] == ranked[:2]
    np.testing.assert_allclose(found.expected, 0.0, atol=1e-8)
    assert estimator.explain("none").rival == found.task
    estimator, estimates = follow(library, truth, "task_2")
    found, p = estimator.explain(), estimates[-1].task_probabilities
    np.testing.assert_allclose(found.log_odds, np.log(p[found.task] / p[found.rival]), rtol=1e-9)


@pytest.mark.parametrize("pair", [("task_1", "task_1"), ("task_9", None), (None, "x")])
def test_labels_that_are_none_of_the_model_or_equal_are_refused(followed, pair):
    with pytest.raises(ArgumentError, match=r"Name a task|Leave it out"):
        followed[0].explain(*pair)


def test_at_rest_there_is_nothing_to_explain_and_a_missing_dof_has_no_row(library, gaussian):
    assert IntentEstimator(library).explain() is None
    library = gaussian[0]
    both = Observation(1, 0, np.array([1.0, 2.0]), np.diag([3.0, 4.0]))
    kept = without_dofs(both, library, frozenset({0, 2}))
    assert (kept.values.tolist(), kept.dofs, kept.covariance.tolist()) == ([2.0], (1,), [[4.0]])
    assert without_dofs(both, library, frozenset({2})) is both
    assert without_dofs(Observation(1, 1, np.array([5.0])), library, frozenset({2})) is None


@pytest.fixture(scope="module")
def gaussian():
    """A movement under known phase, whose density is one Gaussian for each task."""
    rng = np.random.default_rng(11)
    library = make_library(rng, n_tasks=2, groups=(2, 1))
    assert library.evidence_freedom == inf
    times_s = np.linspace(0.05, 1.5, 9)
    weights = draw_weights(library, 0, rng)[:3]
    clean = library.basis.design_matrix(times_s / DURATION_S) @ weights.T
    values = clean + np.sqrt(library.noise_variance[:3]) * rng.normal(size=clean.shape)
    run = MovementFilter(library, fixed_prior_grid(library, DURATION_S), START_NS)
    stream = [
        Observation(START_NS + round(t * 1e9), group, part)
        for t, row in zip(times_s, values, strict=True)
        for group, part in enumerate((row[:2], row[2:]))
    ]
    run.restart(START_NS, past=stream)
    return library, times_s, values, run


def log_density(library, task, times_s, values, dofs):
    """Of some samples of some DOFs, written as one dense Gaussian; (time, DOF) pairs."""
    rows, y = [], []
    phi = library.basis.design_matrix(times_s / DURATION_S)
    for k in range(len(times_s)):
        for dof in dofs[k]:
            row = np.zeros((library.n_observed, library.basis.n_basis))
            row[dof] = phi[k]
            rows.append(row.ravel())
            y.append(values[k, dof])
    if not y:
        return 0.0
    h = np.array(rows)
    covariance = h @ library.observed_covariance[task] @ h.T
    covariance += np.diag([library.noise_variance[d] for some in dofs for d in some])
    return multivariate_normal.logpdf(y, h @ library.observed_mean[task], covariance)


def test_each_part_is_a_ratio_of_predictive_densities_of_the_joint_gaussian(gaussian):
    library, times_s, values, run = gaussian
    n = len(times_s)
    last_ns = START_NS + round(times_s[-1] * 1e9)
    found = explain_movement(run, run.posterior(last_ns), "task_0", "task_1")
    assert found.by_dof.shape == (2 * n, 3)  # two signals

    def odds(dofs):
        one, other = (log_density(library, k, times_s, values, dofs) for k in (0, 1))
        return one - other

    by_time = found.by_dof.sum(axis=1)
    for k in range(n):
        for group, own in enumerate(([0, 1], [2])):
            before = [[0, 1, 2]] * k + [[0, 1] if group else []] + [[]] * (n - k - 1)
            after = [*before]
            after[k] = before[k] + own
            np.testing.assert_allclose(
                by_time[2 * k + group], odds(after) - odds(before), rtol=1e-6, atol=1e-7
            )
    for dof in range(3):
        before, after = [list(range(dof))] * n, [list(range(dof + 1))] * n
        expected = odds(after) - odds(before)
        np.testing.assert_allclose(found.by_dof[:, dof].sum(), expected, rtol=1e-6, atol=1e-7)
