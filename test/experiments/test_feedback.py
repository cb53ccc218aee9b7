# SPDX-License-Identifier: Apache-2.0
"""The stochastic feedback controller: the controlled system has the primitive's distribution."""

import json

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from experiments.feedback.controller import (
    FeedbackSettings,
    feedback_policy,
    propagate,
    second_derivative_matrix,
)
from experiments.feedback.experiment import run
from experiments.feedback.runs import Push, execute, mean_movement
from experiments.settings import Settings
from intent_recognition.gaussian.normal import Gaussian
from intent_recognition.promp.basis import NormalizedRBFBasis
from sim_bridge.arm.arm import SimulatedArm
from sim_bridge.arm.spread_control import resting_gains
from sim_bridge.scenarios.toolbox.scene import HOME

BASIS = NormalizedRBFBasis(10, 1.0)
DURATION_S = 2.5


def primitive(n_joints, rank=None, seed=0):
    """Weights of smooth movements that vary in `rank` ways (all of them by default)."""
    rng = np.random.default_rng(seed)
    size = n_joints * BASIS.n_basis
    smooth = np.exp(-0.5 * ((BASIS.centers[:, None] - BASIS.centers) / 0.3) ** 2)
    factor = np.kron(np.eye(n_joints), smooth) @ rng.standard_normal((size, rank or size))
    mean = np.kron(np.eye(n_joints), smooth) @ rng.standard_normal(size)
    return Gaussian(0.3 * mean, 0.002 * factor @ factor.T / (rank or size))


def errors(policy, n_steps):
    times, moments = propagate(policy, n_steps)
    stride = n_steps // (len(policy.times_s) - 1)
    np.testing.assert_allclose(times[::stride], policy.times_s, atol=1e-12)
    covariance = moments.covariance[::stride]
    scale = np.sqrt(np.einsum("tii,tjj->tij", policy.covariance, policy.covariance))
    return (
        np.abs(moments.mean[::stride] - policy.mean).max(),
        np.abs((covariance - policy.covariance) / scale).max(),
    )


def test_second_derivative_of_the_basis_is_that_of_the_first():
    phase, step = np.linspace(0.01, 0.99, 33), 1e-6
    numeric = (BASIS.derivative_matrix(phase + step) - BASIS.derivative_matrix(phase - step)) / (
        2 * step
    )
    exact = second_derivative_matrix(BASIS, phase)
    np.testing.assert_allclose(exact, numeric, atol=1e-5 * np.abs(exact).max())
    assert not second_derivative_matrix(BASIS, np.array([-0.1, 1.1])).any()


@pytest.mark.parametrize(("n_joints", "rank"), [(1, None), (3, None), (3, 2), (4, 0)])
def test_controlled_system_has_the_primitives_mean_and_covariance_at_all_times(n_joints, rank):
    weights = primitive(n_joints, rank)
    if rank == 0:
        weights = Gaussian(weights.mean, np.zeros_like(weights.covariance))
    policy = feedback_policy(BASIS, weights, DURATION_S, FeedbackSettings(n_times=801))
    mean_error, covariance_error = errors(policy, 1600)
    assert mean_error < 2e-4
    assert covariance_error < 2e-3


def test_state_is_the_primitives_own_but_for_the_floor():
    settings = FeedbackSettings(disturbance=(0.3, 0.1), bandwidth_rad_s=15.0, n_times=101)
    weights = primitive(2)
    policy = feedback_policy(BASIS, weights, DURATION_S, settings)
    design = np.kron(np.eye(2), BASIS.design_matrix(np.array([0.37]))[0])
    at = 37
    floor = np.diag([0.3, 0.1]) / (4 * 15.0**3)
    np.testing.assert_allclose(policy.mean[at, :2], design @ weights.mean, atol=1e-12)
    np.testing.assert_allclose(
        policy.covariance[at, :2, :2], design @ weights.covariance @ design.T + floor, atol=1e-12
    )
    slope = np.kron(np.eye(2), BASIS.derivative_matrix(np.array([0.37]))[0]) / DURATION_S
    np.testing.assert_allclose(policy.mean[at, 2:], slope @ weights.mean, atol=1e-12)
    np.testing.assert_allclose(
        policy.covariance[at, :2, 2:], design @ weights.covariance @ slope.T, atol=1e-12
    )


def test_at_rest_the_end_is_held_with_its_spread_critically_damped():
    policy = feedback_policy(BASIS, primitive(3), DURATION_S, FeedbackSettings(disturbance=0.2))
    gain, offset = policy.at(DURATION_S + 1.0)
    flow = np.block([[np.zeros((3, 3)), np.eye(3)], [gain]])
    np.testing.assert_allclose(gain @ np.r_[policy.mean[-1, :3], 0, 0, 0] + offset, 0, atol=1e-9)
    noise = np.zeros((6, 6))
    noise[3:, 3:] = 0.2 * np.eye(3)
    held = solve_continuous_lyapunov(flow, -noise)
    np.testing.assert_allclose(held[:3, :3], policy.covariance[-1, :3, :3], rtol=1e-6, atol=1e-12)
    roots = np.linalg.eigvals(flow)
    assert np.all(roots.real < 0)
    assert np.abs(roots.imag).max() < 1e-3 * np.abs(roots.real).max()


def test_softer_where_demonstrations_vary():
    stiffness, damping = resting_gains(np.array([0.0, 0.01, 0.05, 0.2]))
    assert np.all(np.diff(stiffness) < 0)
    np.testing.assert_allclose(damping, 2 * np.sqrt(stiffness))
    assert stiffness[0] == pytest.approx(20.0**2)
    spread = np.sqrt(0.3 / (2 * stiffness * damping))  # of a damped oscillator under white noise
    np.testing.assert_allclose(spread[1:], [0.01, 0.05, 0.2])


SMALL, SECOND_S = NormalizedRBFBasis(8, 1.0), 1.0


def policy(std=0.03):
    shift = np.array([0.2, 0.1, -0.1, 0.15, 0.2, -0.1, 0.2])
    share = np.clip((SMALL.centers - 0.2) / 0.6, 0.0, 1.0)
    mean = np.concatenate([h + s * share for h, s in zip(HOME, shift, strict=True)])
    smooth = np.exp(-0.5 * ((SMALL.centers[:, None] - SMALL.centers) / 0.4) ** 2)
    return feedback_policy(SMALL, Gaussian(mean, np.kron(np.eye(7), std**2 * smooth)), SECOND_S)


def test_undisturbed_both_follow_the_mean_and_the_same_generator_repeats():
    one = policy()
    start = one.mean[0]
    wanted = mean_movement(one)
    for low_gain in (False, True):
        run = execute(one, start, SECOND_S + 0.2, low_gain=low_gain)
        reference = np.array([wanted(t).position for t in run.times_s])
        assert np.abs(run.positions_rad - reference).max() < 0.01
        assert run.saturated_steps == 0
    one = policy()
    runs = [execute(one, one.mean[0], 0.5, rng=np.random.default_rng(3)) for _ in range(2)]
    np.testing.assert_array_equal(runs[0].positions_rad, runs[1].positions_rad)
    free = execute(one, one.mean[0], 0.5)
    assert np.abs(free.positions_rad - runs[0].positions_rad).max() > 1e-3
    pushed = execute(one, one.mean[0], 0.5, push=Push(0.2, 0.2, (0.0, 10.0, 0.0)))
    away = pushed.hand_m - free.hand_m
    assert np.abs(away[:20]).max() < 1e-9
    assert away[-1, 1] > 0.005


def test_a_deviating_start_goes_the_way_of_the_linear_system():
    """The arm's inverse dynamics leave the double integrator that the gains were derived for."""
    one = policy()
    start = one.mean[0] + np.concatenate((np.linspace(-0.05, 0.05, 7), np.zeros(7)))
    run = execute(one, start, SECOND_S)
    times, moments = propagate(one, 800, Gaussian(start, np.zeros((14, 14))))
    wanted = np.stack(
        [np.interp(run.times_s, times, column) for column in moments.mean[:, :7].T], axis=1
    )
    assert np.abs(run.positions_rad - wanted).max() < 3e-3


def test_the_law_gives_way_to_guiding_and_to_low_gains():
    with SimulatedArm(HOME) as arm:
        arm.acceleration_law = lambda t, q, qd: 400.0 * (HOME + 0.1 - q) - 40.0 * qd
        arm.step(1500)
        np.testing.assert_allclose(arm.state().q, HOME + 0.1, atol=2e-3)
        arm.acceleration_law = None
        arm.step(3000)
        np.testing.assert_allclose(arm.state().q, HOME, atol=2e-3)
        arm.acceleration_law = lambda t, q, qd: np.full(7, 5.0)
        arm.set_gravity_compensation(True)
        arm.step(200)
        np.testing.assert_allclose(arm.state().q, HOME, atol=2e-3)


@pytest.mark.slow
def test_the_arm_varies_as_the_primitive_and_is_softer_where_demonstrations_vary():
    outcome = run(Settings(quick=True))
    assert all(isinstance(f.holds, bool | None) for f in outcome.findings)
    numbers = json.loads(json.dumps(dict(outcome.numbers)))
    chance = 1.0 / np.sqrt(2.0 * (numbers["n_runs"] - 1))
    ratio = np.array(numbers["std_ratio_stochastic"])
    assert np.abs(ratio - 1.0).max() < 4.0 * chance
    assert np.mean(numbers["std_ratio_low_gain"]) < 0.5 * ratio.mean()
    assert max(numbers["mean_deviation_in_std_stochastic"]) < 5.0 / np.sqrt(numbers["n_runs"])
    assert numbers["linear_std_error"] < 5e-3
    assert numbers["saturated_steps"] == [0, 0]
    assert numbers["stiffness_std_rank_correlation"] < -0.5
    assert numbers["push_hand_std_m"][-1] > numbers["push_hand_std_m"][0]
    first, last = (pushed[0] for pushed in (numbers["push_deflection_m"][k] for k in (0, -1)))
    assert last > 2.0 * first
    assert np.median(numbers["stiffness_end_after_human_ratio"]) > 1.0
