# SPDX-License-Identifier: Apache-2.0
"""The residuals' coupling: recovered from simulated residuals, and none where there is none."""

from types import SimpleNamespace

import numpy as np
import pytest

from intent_recognition.learning import evidence_exponents
from intent_recognition.learning.coupling import HeldOutResiduals, learn_coupling
from intent_recognition.learning.evidence_exponents import N_DURATIONS, choose_duration_evidence
from intent_recognition.learning.hyperparameters import EXPONENTS

PHASES = np.linspace(0.0, 1.0, 20)
SEEN = np.array([0.25, 0.5, 0.75, 1.0])
GAIN = np.array([[0.9, 0.0], [-0.4, 0.7], [0.0, 0.0]])


def simulated(rng, gain: np.ndarray, n: int, noise: float) -> HeldOutResiduals:
    """Residuals of an Ornstein-Uhlenbeck process, which last over a fifth of the movement."""
    covariance = np.exp(-np.abs(PHASES[:, None] - PHASES) / 0.2)
    root = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(PHASES)))
    observed = np.einsum("st,ntp->nsp", root, rng.normal(size=(n, len(PHASES), 2)))
    controlled = observed @ gain.T + noise * rng.normal(size=(n, len(PHASES), 3))
    both = (np.repeat(part[None], len(SEEN), axis=0) for part in (observed, controlled))
    return HeldOutResiduals(np.repeat([0, 2], [n - 3, 3]), PHASES, SEEN, *both)


def test_gain_and_share_of_a_coupling_are_recovered_where_demonstrations_suffice(rng):
    residuals = simulated(rng, GAIN, 43, 0.3)
    found, left = learn_coupling(residuals, np.ones(3), np.full(3, 2.0))
    np.testing.assert_allclose(found.gain[0], GAIN, atol=0.1)
    explained = 1.0 - 0.09 / (0.09 + np.sum(GAIN**2, axis=1))
    np.testing.assert_allclose(found.explained[0], explained, atol=0.1)
    assert found.explained[0, 2] < 0.05
    assert 0.2 <= found.decay_s[0] <= 1.0  # of 2 s the fifth is 0.4 s
    before = np.mean(residuals.controlled**2, axis=(0, 2))
    assert left[:, :-3].mean() < 0.7 * before[:-3].mean()
    np.testing.assert_allclose(left[:, -3:].mean(axis=0), before[-3:])
    found, _ = learn_coupling(simulated(rng, GAIN, 43, 0.3), np.ones(3), np.ones(3))
    assert not np.any(found.gain[1:]) and not np.any(found.explained[1:])
    found, _ = learn_coupling(simulated(rng, GAIN, 43, 0.0), np.ones(3), np.ones(3))
    assert 0.99 < found.explained[0].max() < 1.0


@pytest.mark.parametrize("n", [8, 40])
def test_agents_whose_residuals_are_independent_are_left_as_they_are(n):
    """In five simulations; chance may speak for a weak coupling, which changes next to nothing."""
    for seed in range(5):
        residuals = simulated(np.random.default_rng(seed), 0.0 * GAIN, n, 1.0)
        found, left = learn_coupling(residuals, np.ones(3), np.ones(3))
        before = np.mean(residuals.controlled**2, axis=(0, 2))
        assert left.mean() <= before.mean() + 1e-12
        assert np.all(found.explained < 0.1)


@pytest.mark.parametrize("best", range(len(EXPONENTS)))
def test_the_coupling_is_that_of_the_chosen_exponent(monkeypatch, best):
    learned = iter([(k, np.full((1, 4, 1), float(k != best))) for k in range(len(EXPONENTS))])
    paths = np.zeros((1, 4, N_DURATIONS, 1, 1))
    monkeypatch.setattr(evidence_exponents, "follow", lambda *_: (paths[..., 0, 0], paths, paths))
    monkeypatch.setattr(evidence_exponents, "batches_of", lambda _, all_, __: [all_])
    monkeypatch.setattr(evidence_exponents, "learn_coupling", lambda *_: next(learned))
    left_out = [SimpleNamespace(task=0, seen=np.zeros((1, 1)), truth=np.zeros((1, 1)))] * 4
    library = SimpleNamespace(durations_s=np.ones(1))
    found = choose_duration_evidence(library, left_out, [0.5], np.ones(1))
    assert found == (EXPONENTS[best], best)
