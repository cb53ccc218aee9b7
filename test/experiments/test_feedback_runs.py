# SPDX-License-Identifier: Apache-2.0
"""A movement on the arm by either controller."""

import numpy as np

from experiments.feedback.controller import feedback_policy, propagate
from experiments.feedback.runs import Push, execute, mean_movement
from intent_recognition.gaussian.normal import Gaussian
from intent_recognition.promp.basis import NormalizedRBFBasis
from sim_bridge.arm.arm import SimulatedArm
from sim_bridge.scenarios.toolbox.scene import HOME

BASIS = NormalizedRBFBasis(8, 1.0)
DURATION_S = 1.0


def policy(std=0.03):
    shift = np.array([0.2, 0.1, -0.1, 0.15, 0.2, -0.1, 0.2])
    share = np.clip((BASIS.centers - 0.2) / 0.6, 0.0, 1.0)
    mean = np.concatenate([h + s * share for h, s in zip(HOME, shift, strict=True)])
    smooth = np.exp(-0.5 * ((BASIS.centers[:, None] - BASIS.centers) / 0.4) ** 2)
    return feedback_policy(BASIS, Gaussian(mean, np.kron(np.eye(7), std**2 * smooth)), DURATION_S)


def test_undisturbed_both_follow_the_mean_and_the_same_generator_repeats():
    one = policy()
    start = one.mean[0]
    wanted = mean_movement(one)
    for low_gain in (False, True):
        run = execute(one, start, DURATION_S + 0.2, low_gain=low_gain)
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
    run = execute(one, start, DURATION_S)
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
