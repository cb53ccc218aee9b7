# SPDX-License-Identifier: Apache-2.0
"""How much the evidence of the tasks against each other counts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm
from simulation import make_library, simulate

from intent_recognition.learning import (
    TrainingSettings,
    evidence_exponents,
    held_out,
    learn_with_report,
)
from intent_recognition.learning.evidence_exponents import POWERS, expected_power, log_losses
from intent_recognition.learning.fitting import statistics_of
from intent_recognition.learning.left_out import LeavingOut, largest_odds_against

LEVELS = np.array([0.0, 0.15, 0.3])
"""Of three tasks, in standard deviations of an innovation."""


def losses_of_movements(rng, correlation, n_movements=300, n_samples=200):
    """Log losses of the true of three tasks whose innovations are judged as independent ones."""
    white = rng.normal(size=(n_movements, n_samples + 100)) * np.sqrt(1.0 - correlation**2)
    noise = lfilter([1.0], [1.0, -correlation], white, axis=1)[:, 100:]
    truth = np.arange(n_movements) % len(LEVELS)
    values = LEVELS[truth][:, None] + noise
    order = (truth[:, None] + np.arange(3)) % 3  # the own task first
    density = norm.logpdf(values[:, None], LEVELS[order][..., None])
    evidence = np.cumsum(density, axis=2)
    own = np.arange(0, 3 * n_movements, 3)
    over_time = np.moveaxis(evidence, 2, 0).reshape(n_samples, -1)
    return np.mean([log_losses(after, own) for after in over_time], axis=0)


@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.5, 0.7])
def test_correlated_innovations_count_as_their_share_of_independent_ones(rng, correlation):
    """The mean of n has the variance of (1 - c) / (1 + c) n independent ones."""
    share = (1.0 - correlation) / (1.0 + correlation)
    assert expected_power(losses_of_movements(rng, correlation)) == pytest.approx(share, abs=0.12)


def test_the_last_power_is_all_of_the_evidence_and_without_any_it_is_the_mean():
    evidence = np.array([-1.0, -3.0, -2.0, 0.5, -np.inf])
    losses = log_losses(evidence, np.array([0, 3]))
    expected = [np.logaddexp.reduce(evidence[:3]) + 1.0, 0.0]
    np.testing.assert_allclose(losses[-1], expected, atol=1e-12)
    assert POWERS[-1] == 1.0
    assert expected_power(np.zeros((len(POWERS), 5))) == pytest.approx(POWERS.mean())


@pytest.fixture(scope="module")
def trained():
    rng = np.random.default_rng(5)
    truth = make_library(rng, n_tasks=2, groups=(2,), n_controlled=1, n_basis=6, spread=0.05)
    recordings = [simulate(truth, i % 2, rng, name=f"{i:02d}", n_samples=40) for i in range(8)]
    settings = TrainingSettings(n_basis=6, n_aligned_basis=6, segmentation="recording")
    return learn_with_report(recordings, settings).trained


def test_what_was_chosen_is_in_the_library_and_in_the_odds_that_the_risk_is_stated_from(trained):
    assert 0.1 < trained.chosen.task_evidence < 1.0
    assert trained.library.task_evidence == trained.chosen.task_evidence
    tasks = statistics_of(trained.tasks, trained.chosen.aligned)
    example = tasks["task_1"].examples[0]
    without = LeavingOut(trained.library, tasks).demonstration(1, example).as_library()
    recorded = trained.tasks["task_1"].examples[0]
    whole, half = (
        largest_odds_against(replace(without, task_evidence=power), 1, recorded)
        for power in (1.0, 0.5)
    )
    assert half == pytest.approx(0.5 * whole, abs=1e-9)


def test_who_is_followed_under_several_durations_took_the_same_time_under_each(rng, monkeypatch):
    """Pace times duration, the latter in usual ones of the task, as displacements grow with it."""
    library, asked = make_library(rng, duration_s=1.5), []
    library = replace(library, n_demonstrations=np.full(3, 4))
    size = library.n_observed_weights
    left_out = [
        SimpleNamespace(task=task, log_duration=0.3, duration_s=duration_s, mean=np.zeros(size))
        for task, duration_s in enumerate((1.2, 2.0, 1.7))
    ]
    for one in left_out:
        one.covariance, one.observed = np.eye(size), np.zeros((4, library.n_observed))
        one.rivals, one.rival_means = np.array([2 - one.task]), np.zeros((1, size))
    for room in (evidence_exponents, held_out):
        monkeypatch.setattr(room, "filter_samples", lambda *a: asked.append(a) or [])
    evidence_exponents.follow(library, left_out, [0.5])
    shown = dict.fromkeys(library.labels, SimpleNamespace(n=4))
    assert not [*held_out.follow_known(library, left_out, shown)]
    for _, _, pace, relative, _ in asked:
        took_s = 1.5 * (pace * relative).reshape(3, -1)
        np.testing.assert_allclose(took_s, np.array([[1.2], [2.0], [1.7]]) + 0.0 * took_s)
    assert np.all(np.diff(asked[0][2].reshape(3, -1)) < 0.0)
    for _, prior, *_ in asked:  # of the mean of the other three
        np.testing.assert_allclose(prior.covariance[0], (1.0 + 1.0 / 3.0) * np.eye(size))
