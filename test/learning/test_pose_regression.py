# SPDX-License-Identifier: Apache-2.0
"""The regression on the present state: recovered, and learned from the filter's own state."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from simulation import make_library

from intent_recognition.filtering import MovementFilter, fixed_prior_grid
from intent_recognition.gaussian import Gaussian, regression
from intent_recognition.learning import pose_regression
from intent_recognition.learning.examples import SAMPLES_PER_MOVEMENT, pose_phases, sample_phases
from intent_recognition.learning.held_out import Followed, filter_samples
from intent_recognition.learning.pose_regression import learn_pose_regression
from intent_recognition.promp import LEADS, PoseRegression, ResidualCoupling, StartPosture
from intent_recognition.promp.phase_deviation import STEADY
from intent_recognition.signals.observation import Observation

N_LEADS = len(LEADS)


@pytest.fixture
def waves(rng):
    """Make 19 demonstrations: of a phase that is free, and a pose that follows it."""

    def make(noise: float) -> pose_regression._Moments:
        phase = rng.uniform(0.0, 2.0 * np.pi, (19, 1)) + np.linspace(0.0, 9.0, 60)
        state = np.stack([np.sin(phase), np.cos(phase), 2.0 + 0 * phase, 0 * phase], axis=2)
        pose = np.stack([_poses(state, lead) for lead in range(N_LEADS)], axis=1)
        pose += noise * rng.normal(size=pose.shape)
        predicted = rng.normal(size=pose.shape)
        predicted[:, 3, -4:] = np.nan  # after the end
        return pose_regression._Moments(state, pose, predicted)

    return make


def _poses(state: np.ndarray, lead: int) -> np.ndarray:
    """Two joints that follow a state (..., 4), not linearly."""
    sine, cosine = state[..., 0], state[..., 1]
    return np.stack([sine * cosine + lead, sine**2 - 0.5 * lead * cosine], axis=-1)


def learned(monkeypatch, moments, groups) -> PoseRegression | None:
    """The regression learned from moments of tasks 0 and 2, of which the latter is shown thrice."""
    n = len(moments.state)
    left_out = [SimpleNamespace(task=2 * (k >= n - 3), group=groups[k]) for k in range(n)]
    places = {id(one): k for k, one in enumerate(left_out)}

    def own(_, some, *__, dense):
        assert not dense
        at = [places[id(one)] for one in some]
        return pose_regression._Moments(*(part[at] for part in moments))

    monkeypatch.setattr(pose_regression, "batches_of", lambda _, all_, __: [all_])
    monkeypatch.setattr(pose_regression, "_moments", own)
    library = SimpleNamespace(
        n_tasks=3, n_controlled=2, n_observed=1, noise_variance=np.full(3, 1e-8)
    )
    return learn_pose_regression(library, left_out, 1.0, None, np.ones(2))


@pytest.mark.parametrize("noise", [0.01, 0.3])
def test_a_regression_on_the_present_state_is_recovered(rng, monkeypatch, waves, noise):
    """Of waves whose phase is free; three demonstrations of another task do not suffice."""
    found = learned(monkeypatch, waves(noise), [f"person {k % 6}" for k in range(19)])
    angle = rng.uniform(0.0, 2.0 * np.pi, 50)
    state = np.stack([np.sin(angle), np.cos(angle), np.full(50, 2.0), np.zeros(50)], axis=1)
    for lead in range(N_LEADS):
        for one in state:
            pose, share = found.at(0, one, LEADS[[lead]])
            np.testing.assert_allclose(pose[0], _poses(one, lead), atol=0.05 + 0.3 * noise)
            assert share > 0.9
    assert not found.share[1:].any()


def test_a_regression_that_predicts_worse_has_no_share(rng, monkeypatch, waves):
    """Poses that have nothing to do with the state; the primitive's prediction is nearly right."""
    moments = waves(0.0)
    pose = rng.normal(size=moments.pose.shape)
    right = pose + 0.1 * rng.normal(size=pose.shape)
    found = learned(monkeypatch, moments._replace(pose=pose, predicted=right), [""] * 19)
    assert found is None or np.all(found.share < 0.02)


def test_the_share_is_judged_by_people_left_out_together(monkeypatch, rng, waves):
    """Against regressions learned without them, one by one."""
    moments, people = waves(0.1), np.arange(19) % 6
    near = moments.pose + 0.2 * rng.normal(size=moments.pose.shape)
    moments = moments._replace(predicted=np.where(np.isnan(moments.predicted), np.nan, near))
    fit = pose_regression._fit(moments, people, 1.0, 0.06, np.ones(2))
    towards = np.empty_like(moments.pose)
    for person in range(6):
        own, others = people == person, people != person
        rest = pose_regression._Moments(*(part[others] for part in moments))
        other = pose_regression._fit(rest, people[others], 1.0, 0.06, np.ones(2))
        one = np.ones((1, 4))
        states = rest.state.reshape(1, -1, 4)
        alone = PoseRegression(
            0.0 * one, one, states, np.ones(1), other.coefficients[None], np.ones((1, N_LEADS))
        )
        for k in np.flatnonzero(own):
            for moment, state in enumerate(moments.state[k]):
                towards[k, :, moment] = alone.at(0, state, LEADS)[0]
    towards -= moments.predicted
    error = moments.pose - moments.predicted
    for lead in range(N_LEADS):
        moved, whole = (
            np.array([np.nansum((towards * other)[people == person, lead]) for person in range(6)])
            for other in (error, towards)
        )
        share = moved.sum() / whole.sum()
        of_mean = np.var(moved - share * whole, ddof=1) * 6.0 / whole.sum() ** 2
        expected = share - of_mean * 5.0 / 3.0 / share  # of Student's t of five degrees of freedom
        assert 0.1 < expected < 0.9
        np.testing.assert_allclose(fit.share[lead], expected, rtol=1e-5)


@pytest.mark.parametrize("dense", [True, False])
def test_state_and_prediction_are_those_of_the_filter(monkeypatch, rng, dense):
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
    monkeypatch.setattr(pose_regression, "follow_durations", lambda *_: followed)
    monkeypatch.setattr(pose_regression, "duration_weights", lambda *_: pace)
    nothing = ResidualCoupling.none(2, 2, 2)
    found = pose_regression._moments(library, [one], 1.0, nothing, dense=dense)
    states = []

    class Recorded(PoseRegression):
        def at(self, task, state, leads):
            states.append(state)
            return super().at(task, state, leads)

    sizes = (2, 6), (2, 6), (2, 1, 6), (2,), (2, 1, N_LEADS, 2), (2, N_LEADS)
    regressed = replace(library, pose_regression=Recorded(*map(np.ones, sizes)))
    hypotheses, start = fixed_prior_grid(library, duration_s), StartPosture(poses[0], np.zeros(2))
    runs = [MovementFilter(each, hypotheses, 0) for each in (library, regressed)]
    at = -1
    for k, (phase, value) in enumerate(zip(phases, values, strict=True)):
        also = None if k else library.noise_covariance(np.arange(2), np.inf)
        for run in runs:
            run.observe(Observation(round(phase * duration_s * 1e9), 0, value, also))
        judged, ahead = k % 3 == 2, phase + LEADS
        if not (judged or dense):
            continue
        at += 1
        alone, _ = (run.prediction(1).mixture_at(ahead * duration_s, start)[0] for run in runs)
        np.testing.assert_allclose(found.state[0, at], states.pop(), atol=1e-3)
        truth = np.stack([np.interp(ahead, pose_phases(), column) for column in poses.T], axis=1)
        np.testing.assert_allclose(found.pose[0, :, at], truth, atol=1e-9)
        expected = np.where((ahead <= 1.0)[:, None] & judged, alone, np.nan)
        np.testing.assert_allclose(found.predicted[0, :, at], expected, atol=1e-3)
