# SPDX-License-Identifier: Apache-2.0
"""The regression on the present state: recovered, and learned from the filter's own state."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from simulation import make_library

from intent_recognition.filtering import MovementFilter, fixed_prior_grid
from intent_recognition.gaussian import Gaussian, regression
from intent_recognition.learning import state_gain
from intent_recognition.learning.examples import SAMPLES_PER_MOVEMENT, pose_phases, sample_phases
from intent_recognition.learning.held_out import Followed, filter_samples
from intent_recognition.learning.state_gain import learn_state_gain
from intent_recognition.promp import LEADS, ResidualCoupling, StartPosture
from intent_recognition.promp.phase_deviation import STEADY
from intent_recognition.signals.observation import Observation


def state_gain_of(monkeypatch, states) -> np.ndarray | None:
    """The regression learned from states of tasks 0 and 2."""
    left_out = [
        SimpleNamespace(task=2 * (k >= len(states.state) - 3)) for k in range(len(states.state))
    ]
    monkeypatch.setattr(state_gain, "batches_of", lambda _, all_, __: [all_])
    monkeypatch.setattr(state_gain, "_states", lambda *_: states)
    library = SimpleNamespace(n_tasks=3, n_controlled=2)
    return learn_state_gain(library, left_out, 1.0, None, np.ones(2))


@pytest.mark.parametrize("noise", [0.01, 1.0])
def test_a_regression_on_the_present_state_is_recovered_where_there_is_one(rng, monkeypatch, noise):
    """Of waves whose phase is free; three demonstrations of another task do not suffice."""
    n, m, n_leads = 23, 19, len(LEADS)
    phase = rng.uniform(0.0, 2.0 * np.pi, (n, 1)) + np.linspace(0.0, 9.0, m)
    state = np.stack([np.sin(phase), np.cos(phase), 2.0 + 0.0 * phase, 1.0 + 0.0 * phase], axis=2)
    truth = rng.normal(size=(n_leads, 2, 4)) * [1.0, 1.0, 0.0, 0.3]
    residual = np.einsum("lqf,nmf->nlmq", truth, state) + noise * rng.normal(
        size=(n, n_leads, m, 2)
    )
    residual[:, 1:, -1], residual[:, 3, -4:] = np.nan, np.nan  # after the end
    found = state_gain_of(monkeypatch, state_gain._States(state, residual))
    np.testing.assert_allclose(found[0, ..., :2], truth[..., :2], atol=0.05 + 0.2 * noise)
    assert not found[1:].any()
    unrelated = state_gain._States(state, rng.normal(size=residual.shape))
    assert state_gain_of(monkeypatch, unrelated) is None


def test_state_and_residual_are_those_of_the_filter(monkeypatch, rng):
    """One movement of known duration, followed in training and online."""
    duration_s, phases = 2.4, sample_phases()
    library = replace(
        make_library(rng, n_tasks=2, groups=(2,), n_controlled=2, n_basis=6),
        phase_deviation=STEADY,
        evidence_freedom=np.inf,
        correlation_time_s=duration_s / SAMPLES_PER_MOVEMENT,
        displacement_exponent=0.5,
        delay_s=0.1,
    )
    joint = Gaussian(library.weight_mean[1], library.weight_covariance[1])
    values, poses = 0.1 * rng.normal(size=(len(phases), 2)), rng.normal(size=(58, 2))
    rule = regression(joint, library.n_observed_weights)
    one = SimpleNamespace(
        task=1, mean=joint.mean, rule=rule, poses=poses, observed=values, duration_s=duration_s
    )
    prior = Gaussian(library.observed_mean[1:2], library.observed_covariance[1:2])
    pace, relative = np.ones((1, 1)), np.full((1, 1), duration_s / library.usual_s[1])
    followed = (
        Followed(progress, np.zeros((1, 1), dtype=int), pace, relative)
        for progress in filter_samples(library, prior, pace[0], relative[0], values[:, None])
    )
    monkeypatch.setattr(state_gain, "follow_durations", lambda *_: followed)
    monkeypatch.setattr(state_gain, "duration_weights", lambda *_: pace)
    found = state_gain._states(library, [one], 1.0, ResidualCoupling.none(2, 2, 2))
    gains = np.zeros((4, 2, len(LEADS), 2, 7))  # each shows two numbers of the state
    for k in range(7):
        gains[k // 2, 1, 0, k % 2, k] = 1.0
    shown = [replace(library, state_gain=gain) for gain in gains]
    hypotheses, start = fixed_prior_grid(library, duration_s), StartPosture(poses[0], np.zeros(2))
    runs = [MovementFilter(each, hypotheses, 0) for each in (library, *shown)]
    for k, (phase, value) in enumerate(zip(phases, values, strict=True)):
        also = None if k else library.noise_covariance(np.arange(2), np.inf)
        for run in runs:
            run.observe(Observation(round(phase * duration_s * 1e9), 0, value, also))
        if k % 3 != 2:
            continue
        ahead = phase + LEADS
        alone, *shifted = (
            run.prediction(1).mixture_at(ahead * duration_s, start)[0] for run in runs
        )
        state = np.concatenate([one[0] - alone[0] for one in shifted])[:7]
        np.testing.assert_allclose(found.state[0, k // 3], state, atol=1e-3)
        truth = np.stack([np.interp(ahead, pose_phases(), column) for column in poses.T], axis=1)
        expected = np.where((ahead <= 1.0)[:, None], truth - alone, np.nan)
        np.testing.assert_allclose(found.residual[0, :, k // 3], expected, atol=1e-3)
