# SPDX-License-Identifier: Apache-2.0
"""The fast ways to a prediction equal the plain ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import bank_of, observed_weights
from simulation import make_library, simulate

from intent_recognition.filtering.filter import MovementFilter
from intent_recognition.filtering.grid import make_prior_grid
from intent_recognition.filtering.posterior import task_posterior
from intent_recognition.promp.control_grid import ControlGrid
from intent_recognition.promp.prediction import StartPosture, controlled_weights
from intent_recognition.promp.trajectory import rollout
from intent_recognition.signals.observation import merge
from intent_recognition.signals.onset import OnsetSettings, at_rest, is_slow


@pytest.mark.parametrize("with_start", [False, True])
@pytest.mark.parametrize("prune", [False, True])
@pytest.mark.parametrize("n_points", [1, 2, 50])
def test_a_grid_predicts_what_the_weights_do(rng, with_start, prune, n_points):
    library = make_library(rng, n_tasks=3, groups=(2, 1), n_controlled=3, n_basis=7)
    recorded = simulate(library, 1, rng, n_samples=40)
    run = MovementFilter(library, make_prior_grid(library), recorded.start_ns, prune=prune)
    start = StartPosture(rng.normal(size=3), np.full(3, 1e-4)) if with_start else None
    phase = np.linspace(1.0, 0.0, n_points)[::-1]
    noise = library.control_noise_variance()
    for number, observation in enumerate(list(merge(recorded.observed))[:50]):
        run.observe(observation)
        if number % 7:
            continue
        posterior = task_posterior(run.log_evidence, run.grid, 0.4)
        for task in range(library.n_tasks):
            moments = run.prediction(task).observed_weights()
            plain = observed_weights(bank_of(run), posterior.scale_weights, task)
            np.testing.assert_allclose(moments.mean, plain.mean, rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(moments.covariance, plain.covariance, rtol=1e-8, atol=1e-12)
            weights = controlled_weights(library, task, plain, start)
            expected = rollout(library.basis, weights, phase, 1.7, noise)
            found = ControlGrid(library, task, n_points).predict(moments, 1.7, start)
            for ours, theirs in zip(found, expected, strict=True):
                np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-10)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.floats(0.0, 3.0))
def test_what_is_not_slow_is_not_at_rest(seed, n, speed):
    """So that the long look may be skipped."""
    rng = np.random.default_rng(seed)
    onset = OnsetSettings(reference_speed=1.0)
    times = np.cumsum(rng.uniform(0.002, 0.05, size=n))
    values = np.cumsum(rng.normal(size=(n, 2)), axis=0) * 0.01 * speed
    last = times >= times[-1] - onset.window_s - 1e-9
    if not is_slow(onset, times[last], values[last]):
        assert not at_rest(onset, times, values)
