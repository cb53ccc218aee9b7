# SPDX-License-Identifier: Apache-2.0
"""Trajectories of a movement under way, against the bank, Monte Carlo and finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from plain import run_bank
from simulation import START_NS, make_library, simulate

from intent_recognition.filtering import MovementFilter, fixed_prior_grid, make_prior_grid
from intent_recognition.filtering.prediction import TaskPrediction
from intent_recognition.gaussian.normal import Gaussian
from intent_recognition.promp import (
    LEADS,
    ControlPoint,
    PoseRegression,
    ResidualCoupling,
    TaskLibrary,
    residual_weights,
    through,
)
from intent_recognition.promp.phase_deviation import STEADY, PhaseDeviation, reference_phase
from intent_recognition.promp.prediction import StartPosture, controlled_weights
from intent_recognition.promp.trajectory import dof_variance, rollout
from intent_recognition.signals.observation import merge

BRIDGE = np.sqrt(4.0 * np.linspace(0, 1, 51) * np.linspace(1, 0, 51))
LEADING = PhaseDeviation(0.06 * BRIDGE, 0.4, 0.5)


def library_with(
    rng: np.random.Generator, phase_deviation: PhaseDeviation, **settings
) -> TaskLibrary:
    library = make_library(rng, n_tasks=2, n_controlled=2, n_basis=8, **settings)
    return replace(library, phase_deviation=phase_deviation)


def seen(library: TaskLibrary, rng: np.random.Generator, n: int, task: int = 0) -> list:
    recording = simulate(library, task, rng, n_samples=20, duration_s=2.0)
    return list(merge(recording.observed))[:n]


def predicted(rng, phase_deviation, n_seen: int, n_scales: int = 5) -> TaskPrediction:
    """Task 0 of a library after some observations."""
    library = library_with(rng, phase_deviation)
    return run_on(
        library, 0, make_prior_grid(library, n_scales=n_scales), seen(library, rng, n_seen)
    )


def run_on(library, task, hypotheses, observations) -> TaskPrediction:
    run = MovementFilter(library, hypotheses, START_NS)
    for observation in observations:
        run.observe(observation)
    return run.prediction(task)


@pytest.mark.parametrize("variance", [0.0, 0.05])
def test_one_duration_at_steady_progress_is_the_rollout_of_the_bank(rng, variance):
    library = library_with(rng, STEADY, groups=(2, 1))
    library = replace(library, regression_variance=variance)
    hypotheses = fixed_prior_grid(library, 2.0)
    observations = seen(library, rng, 25)
    bank = run_bank(library, hypotheses, observations, START_NS)
    run = run_on(library, 1, hypotheses, observations)
    noise = library.control_noise_variance()
    for start in (None, StartPosture(np.array([0.01, 0.02]), np.full(2, 1e-5))):
        observed = Gaussian(bank.mean[1], bank.covariance[1])
        weights = controlled_weights(library, 1, observed, start)
        times = np.array([0.0, 0.5, 1.0, 2.0])
        expected = rollout(library.basis, weights, times / 2, 2.0, noise)
        mean, square = run.mixture_at(np.r_[times, 5.0], start)
        np.testing.assert_allclose(mean[:4], expected.positions, atol=1e-9)
        np.testing.assert_allclose(mean[4], mean[3], atol=1e-12)
        np.testing.assert_allclose(np.sqrt(square - mean**2)[:4], expected.std, atol=1e-8)
        found = run.controlled(5, start)
        expected = rollout(library.basis, weights, np.linspace(0, 1, 5), 2.0, noise)
        for ours, theirs in zip(found, expected, strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-7)


def test_with_the_duration_displacements_grow_by_its_power(rng):
    library = replace(library_with(rng, STEADY, groups=(2, 1)), displacement_exponent=1.5)
    observations, duration_s = seen(library, rng, 25), 1.6 * library.usual_s[1]
    run = run_on(library, 1, fixed_prior_grid(library, duration_s), observations)
    design = library.basis.design_matrix(np.linspace(0, 1, 5))
    rows = 1.6**1.5 * design + (1 - 1.6**1.5) * design[0]
    for start in (None, StartPosture(np.array([0.01, 0.02]), np.full(2, 1e-5))):
        weights = controlled_weights(library, 1, run.observed_weights(), start)
        mean, square = run.mixture_at(np.linspace(0, duration_s, 5), start)
        np.testing.assert_allclose(mean, rows @ weights.mean.reshape(2, -1).T, atol=1e-9)
        variance = dof_variance(rows, weights.covariance) + library.control_noise_variance()
        np.testing.assert_allclose(square - mean**2, variance, atol=1e-9)
        found = run.controlled(5, start)
        np.testing.assert_allclose(found.positions, mean, atol=1e-7)
        np.testing.assert_allclose(found.std**2, variance, atol=1e-7)


def test_a_delay_is_as_long_in_any_duration(rng):
    library = replace(library_with(rng, STEADY), delay_s=0.2)
    usual_s = library.usual_s[0]
    run = run_on(library, 0, fixed_prior_grid(library, 1.5 * usual_s), seen(library, rng, 25))
    times_s = np.linspace(0.3, 1.2, 5) * usual_s
    usual = library.basis.design_matrix(((times_s - 0.2) / 1.5 + 0.2) / usual_s)
    weights = controlled_weights(library, 0, run.observed_weights()).mean.reshape(2, -1)
    mean, _ = run.mixture_at(times_s)
    np.testing.assert_allclose(mean, usual @ weights.T, atol=0.02 * np.ptp(weights))


@pytest.mark.parametrize("how", [{"displacement_exponent": 2.0}, {"delay_s": 0.1}])
def test_the_end_is_that_of_the_mixture_where_the_robot_depends_on_the_duration(rng, how):
    library = replace(library_with(rng, STEADY, spread=0.3), **how)
    run = run_on(library, 0, make_prior_grid(library, n_scales=5), seen(library, rng, 3))
    mean, square = run.mixture_at(np.array([1e3]))
    end = run.controlled(1)
    np.testing.assert_allclose(end.positions, mean, atol=1e-9)
    np.testing.assert_allclose(end.std**2, square - mean**2, rtol=1e-6)


def test_a_via_point_is_passed_whatever_the_duration(rng):
    library = replace(library_with(rng, STEADY), displacement_exponent=1.0, delay_s=0.1)
    point = ControlPoint(0.5, np.eye(2), np.array([0.3, -0.1]), 1e-12 * np.eye(2))
    library = through(library, {0: [point]})
    hypotheses = fixed_prior_grid(library, 1.6 * library.usual_s[0])
    run = run_on(library, 0, hypotheses, seen(library, rng, 5))
    np.testing.assert_allclose(run.controlled(3).positions[1], point.values, atol=1e-6)


@pytest.mark.parametrize("exponent", [0.0, 2.0])
def test_mixture_equals_monte_carlo_over_durations_leads_weights_and_noise(rng, exponent):
    library = library_with(rng, LEADING, spread=0.3, noise_std=0.02)
    library = replace(library, displacement_exponent=exponent)
    hypotheses = make_prior_grid(library, n_scales=4)._replace(duration_evidence=0.3)
    run = run_on(library, 0, hypotheses, seen(library, rng, 5))
    times = np.array([0.1, 0.8, 1.6, 4.0])
    mean, square = run.mixture_at(times)
    std = np.sqrt(square - mean**2)
    n, phase_deviation = 60_000, run.deviations_at(times)
    drawn = []
    for s, count in enumerate(rng.multinomial(n, run.duration_weights)):
        observed = Gaussian(run.weights.mean[s], run.weights.moments()[1][s])
        w = rng.multivariate_normal(*controlled_weights(library, 0, observed), size=count)
        recorded = times / run.durations_s[s]
        values = np.empty((count, len(times), 2))
        for t, phases in enumerate(reference_phase(LEADING, recorded)):
            at = rng.choice(
                phases, size=count, p=phase_deviation[s, t] / phase_deviation[s, t].sum()
            )
            grown = (run.durations_s[s] / library.usual_s[0]) ** exponent
            row = library.basis.design_matrix(at) @ library.basis.scaling(grown)
            values[:, t] = np.einsum("nk,nqk->nq", row, w.reshape(count, 2, -1))
        drawn.append(values)
    drawn = np.concatenate(drawn)
    drawn += rng.normal(size=drawn.shape) * np.sqrt(library.control_noise_variance())
    np.testing.assert_allclose(mean, drawn.mean(axis=0), atol=4.5 * std.max() / np.sqrt(n))
    np.testing.assert_allclose(std, drawn.std(axis=0), rtol=0.02)


@pytest.mark.parametrize("phase_deviation", [STEADY, LEADING])
@pytest.mark.parametrize("n", [0, 1, 12])
def test_the_controlled_agent_begins_and_ends_where_its_weights_say(rng, phase_deviation, n):
    run = predicted(rng, phase_deviation, n)
    library, found = run.library, run.controlled(41)
    weights = controlled_weights(library, 0, run.observed_weights())
    noise = library.control_noise_variance()
    ends = rollout(library.basis, weights, np.array([0.0, 1.0]), 1.0, noise)
    np.testing.assert_allclose(found.positions[[0, -1]], ends.positions, atol=1e-9)
    assert found.times_s[0] == 0.0
    assert found.times_s[-1] == pytest.approx(run.duration_s)
    assert np.all(found.std > 0.0)
    assert np.all(found.std[[0, -1]] >= ends.std - 1e-9)
    end = run.controlled(1)
    for alone, whole in zip(end[:2], found[:2], strict=True):
        np.testing.assert_allclose(alone[0], whole[-1], atol=1e-9)


@pytest.mark.parametrize("phase_deviation", [STEADY, LEADING])
@pytest.mark.parametrize("agent", ["controlled", "observed"])
def test_velocities_are_the_slope_of_the_positions(rng, phase_deviation, agent):
    run = predicted(rng, phase_deviation, 8)
    found = getattr(run, agent)(801)
    numeric = np.gradient(found.positions, found.times_s, axis=0)
    worst = np.max(np.abs(found.velocities - numeric)[2:-2], axis=0)
    assert np.all(worst < 0.02 * np.abs(numeric).max())


def test_the_observed_agent_goes_on_from_now_to_the_end(rng):
    run = predicted(rng, LEADING, 10)
    library, found = run.library, run.observed(9)
    assert found.times_s[0] == pytest.approx(run.elapsed_s)
    assert found.times_s[-1] == pytest.approx(run.duration_s)
    weights = run.observed_weights().mean.reshape(3, -1)
    np.testing.assert_allclose(
        found.positions[-1], library.basis.design_matrix(np.ones(1))[0] @ weights.T
    )
    end = run.observed(1)
    np.testing.assert_allclose(end.positions[0], found.positions[-1])
    assert np.array_equal(end.velocities, np.zeros((1, 3)))


@pytest.mark.parametrize("phase_deviation", [STEADY, LEADING])
@pytest.mark.parametrize("n_points", [1, 2, 7])
def test_past_the_expected_end_all_is_finite_and_at_the_end(rng, phase_deviation, n_points):
    library = library_with(rng, phase_deviation)
    observations = seen(library, rng, 15)
    observations.append(observations[-1]._replace(stamp_ns=START_NS + 60_000_000_000))
    run = run_on(library, 0, make_prior_grid(library, n_scales=5), observations)
    found = run.observed(n_points)
    assert all(np.all(np.isfinite(part)) for part in found)
    assert found.times_s.shape == (n_points,)
    np.testing.assert_array_equal(found.velocities, 0.0)
    np.testing.assert_allclose(found.positions, found.positions[[-1]] * np.ones((n_points, 1)))
    assert all(np.all(np.isfinite(part)) for part in run.controlled(n_points))


def test_asking_late_equals_asking_all_the_time(rng):
    library = library_with(rng, LEADING)
    hypotheses = make_prior_grid(library, n_scales=3)
    late, always = (MovementFilter(library, hypotheses, START_NS) for _ in range(2))
    for observation in seen(library, rng, 20):
        late.observe(observation)
        always.observe(observation)
        assert np.all(np.isfinite(always.prediction(0).controlled(9).positions))
    start = StartPosture(np.zeros(2), np.full(2, 1e-4))
    ours, theirs = (run.prediction(0).controlled(9, start) for run in (late, always))
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
    assert late.prediction(0) is late.prediction(0)
    times, share = np.linspace(0.1, 0.9, 4), np.zeros(len(library.labels))
    share[:2] = 0.15, 0.35  # the rest is that of none
    of_first, of_second = (np.array(late.prediction(k).mixture_at(times)) for k in range(2))
    own_mean, own_square = 0.3 * of_first + 0.7 * of_second
    mean, std = late.mixture_at(times, share)
    np.testing.assert_allclose(mean, own_mean, rtol=1e-9)
    np.testing.assert_allclose(std**2, own_square - own_mean**2, rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(late.prediction(0).controlled(9, start).positions, ours.positions)
    std = late.prediction(0).controlled(9).std
    assert late.end_std(0) == {"rad": pytest.approx(std[-1].max())}


@pytest.mark.parametrize("follows", [True, False])
def test_the_controlled_agent_may_keep_steady_progress(rng, follows):
    """Its phases then are those of the durations alone, whatever the observed one does."""
    run = predicted(rng, replace(LEADING, controlled_follows=follows), 8, n_scales=3)
    library = run.library
    times = np.linspace(0.0, 3.0, 7)
    table = run.phases_at(times)
    found = table @ np.linspace(0.0, 1.0, table.shape[-1])
    if follows:
        phase = reference_phase(LEADING, times / run.durations_s[:, None])
        expected = np.sum(run.deviations_at(times) * phase, axis=2)
    else:
        expected = np.clip(times / run.durations_s[:, None], 0.0, 1.0)
        steady = np.linspace(0.0, 1.0, 41)
        weights = controlled_weights(library, 0, run.observed_weights())
        noise = library.control_noise_variance()
        wanted = rollout(library.basis, weights, steady, run.duration_s, noise)
        positions = run.controlled(41).positions
        np.testing.assert_allclose(positions, wanted.positions, atol=1e-5)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_the_expected_phase_rises_to_one_where_what_was_seen_would_let_it_fall():
    """Each time has its own distribution of deviations, so their mean may fall."""
    deviation = PhaseDeviation(0.2 * BRIDGE, 0.1, 0.5)
    run = predicted(np.random.default_rng(1), deviation, 16)
    times_s = np.linspace(0.0, run.duration_s, 201)
    table = run.phases_at(times_s)
    expected = run.duration_weights @ (table @ np.linspace(0.0, 1.0, table.shape[-1]))
    phase, _, rate = run._path(times_s, controlled=True)
    assert np.diff(expected).min() < 0.0 <= min(np.diff(phase).min(), rate.min())
    assert phase[-1] == pytest.approx(1.0)


def test_coupled_residuals_are_added_and_take_their_share_of_the_variance(rng):
    """At one duration and steady progress, against residuals worked out by hand.

    Where a DOF was not measured, its residual counts as zero.
    """
    library = library_with(rng, STEADY, groups=(2, 1))
    gain = 20.0 * rng.normal(size=(2, 2, 3))
    coupling = ResidualCoupling(gain, np.full((2, 2), 0.75), np.full(2, 0.2))
    observations = [one for k, one in enumerate(seen(library, rng, 24)) if k % 4 != 1]
    hypotheses, times = fixed_prior_grid(library, 2.0), np.array([0.3, 1.1, 1.9])
    run = run_on(replace(library, coupling=coupling), 0, hypotheses, observations)
    alone = run_on(library, 0, hypotheses, observations)
    at = np.unique([(o.stamp_ns - START_NS) * 1e-9 for o in observations])
    path = library.basis.design_matrix(at / 2.0) @ alone.weights.mean[0].reshape(3, -1).T
    residuals = np.zeros_like(path)
    for o in observations:
        row = np.searchsorted(at, (o.stamp_ns - START_NS) * 1e-9)
        dofs = library.observed_dofs(o.group)
        residuals[row, dofs] = o.values - path[row, dofs]
    weights, known = residual_weights(at, times, 0.2)
    shift = weights @ residuals @ gain[0].T
    assert np.abs(shift).max() > 0.01
    mean, square = run.mixture_at(times)
    mean_alone, square_alone = alone.mixture_at(times)
    np.testing.assert_allclose(mean, mean_alone + shift, atol=1e-4)
    left = (1.0 - 0.75 * known[:, None]) * (square_alone - mean_alone**2)
    np.testing.assert_allclose(square - mean**2, left, rtol=1e-3)
    whole, whole_alone = run.controlled(201), alone.controlled(201)
    moved = whole.positions - whole_alone.positions
    np.testing.assert_allclose(moved[[30, 110, 190]], shift, atol=2e-3)
    np.testing.assert_allclose(
        whole.velocities - whole_alone.velocities, np.gradient(moved, whole.times_s, axis=0)
    )


def test_with_a_known_start_what_is_ahead_follows_the_present_state(rng):
    """A state worked out by hand; nothing else changes, and nothing long ago or far ahead.

    The share has no step, of which velocities would be made.
    """
    library = library_with(rng, STEADY, groups=(2, 1))
    sizes = (2, 8), (2, 8), (2, 5, 8), (2,), (2, 5, len(LEADS), 2), (2, len(LEADS))
    regression = PoseRegression(*map(rng.random, sizes))
    observations = seen(library, rng, 24)
    hypotheses = fixed_prior_grid(library, 2.0)
    run = run_on(replace(library, pose_regression=regression), 0, hypotheses, observations)
    alone = run_on(library, 0, hypotheses, observations)
    now = run.elapsed_s
    times = np.array([0.3, now - 0.01, now, now + 0.07, now + 0.2, now + 0.4])
    start = StartPosture(np.array([0.01, 0.02]), np.full(2, 1e-5))
    mean, square = alone.mixture_at(times, start)
    at = {}
    for group, dofs in enumerate(([0, 1], [2])):
        own = [o for o in observations if o.group == group]
        stamps = [(o.stamp_ns - START_NS) * 1e-9 for o in own]
        for k, dof in enumerate(dofs):
            column = [o.values[k] for o in own]
            at[dof] = np.interp([now, now - 2.0 / 30.0], stamps, column)
    last, before = np.array([at[dof] for dof in range(3)]).T
    row = library.basis.design_matrix(np.array([now / 2.0]))[0]
    usual = library.weight_mean[0, library.n_observed_weights :].reshape(2, -1) @ row
    state = np.concatenate([last, last - before, usual])
    state = (state - regression.centre[0]) / regression.scale[0]
    poses = np.zeros((len(LEADS), 2))
    for known, coefficients in zip(regression.states[0], regression.coefficients[0], strict=True):
        near = np.exp(-np.sum((state - known) ** 2) / (16.0 * regression.length[0] ** 2))
        poses += (100.0 + state @ known / 8.0 + near) * coefficients
    between = 0.5 * (poses[1] + poses[2])
    towards = np.array([poses[0], poses[0], poses[0], between, poses[3]])
    first, second, third, last = regression.share[0]
    share = np.array([0.0, 0.75 * first, first, 0.5 * (second + third), last])[:, None]
    found, found_square = run.mixture_at(times, start)
    np.testing.assert_allclose(found[:5], mean[:5] + share * (towards - mean[:5]), atol=1e-4)
    np.testing.assert_allclose(found_square - found**2, square - mean**2, atol=1e-9)
    np.testing.assert_allclose(found[5], mean[5], atol=1e-9)
    np.testing.assert_array_equal(run.mixture_at(times), alone.mixture_at(times))
    alone, blind = (
        run_on(one, 0, hypotheses, [o for o in observations if o.group == 0])
        for one in (library, replace(library, pose_regression=regression))
    )
    np.testing.assert_array_equal(blind.mixture_at(times, start), alone.mixture_at(times, start))
