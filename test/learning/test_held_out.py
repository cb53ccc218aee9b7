# SPDX-License-Identifier: Apache-2.0
"""The filter along demonstrations left out is the one that runs online."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from plain import bank_of
from simulation import make_library

from intent_recognition.filtering import MovementFilter, PriorGrid
from intent_recognition.gaussian import Gaussian, regression
from intent_recognition.learning.examples import SAMPLES_PER_MOVEMENT, sample_phases
from intent_recognition.learning.held_out import Followed, filter_samples, predict_agents
from intent_recognition.learning.held_out_examples import evenly
from intent_recognition.promp import StartPosture, controlled_weights
from intent_recognition.promp.phase_deviation import STEADY, PhaseDeviation
from intent_recognition.signals.observation import Observation

DURATION_S = 2.4
DEVIATING = PhaseDeviation(0.05 * np.sin(np.linspace(0.0, np.pi, 9)), 0.4, 0.15)


def a_library(deviation: PhaseDeviation, freedom: float):
    library = make_library(np.random.default_rng(4), n_tasks=2, groups=(2,), n_basis=6)
    return replace(
        library,
        phase_deviation=deviation,
        evidence_freedom=freedom,
        noise_scale=3.0,
        correlation_time_s=DURATION_S / SAMPLES_PER_MOVEMENT,
    )


BENT = replace(DEVIATING, duration_exponent=0.8)


@pytest.mark.parametrize(
    "deviation", [STEADY, DEVIATING, BENT], ids=["steady", "deviating", "bent"]
)
@pytest.mark.parametrize("freedom", [np.inf, 4.0])
def test_it_equals_the_filter_of_a_movement(rng, deviation, freedom):
    library = a_library(deviation, freedom)
    prior = Gaussian(library.observed_mean, library.observed_covariance)
    pace = np.array([1.0, 0.7, 1.6])
    values = rng.normal(size=(len(sample_phases()), library.n_observed)) * 0.1
    hypotheses = PriorGrid(1, DURATION_S / pace, np.zeros(3))
    run = MovementFilter(library, hypotheses, 0)
    expected = []
    for k, (phase, one) in enumerate(zip(sample_phases(), values, strict=True)):
        # online, the first sample has the noise to itself; here all samples share it alike
        also = None if k else library.noise_covariance(np.arange(2), np.inf)
        run.observe(Observation(round(phase * DURATION_S * 1e9), 0, one, also))
        expected.append(run.log_evidence.copy())
    usual_s = np.exp([*library.log_duration_mean, library.none_log_duration[0]])
    relative, values = DURATION_S / pace / usual_s, np.repeat(values[:, None], 3, axis=1)
    found = []
    for progress in filter_samples(library, prior, pace, relative, values):
        found.append(progress.log_evidence)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8)
    mean, covariance = progress.weights.moments()
    np.testing.assert_allclose(mean, bank_of(run).mean, atol=1e-8)
    np.testing.assert_allclose(covariance, bank_of(run).covariance, atol=1e-10)


def test_each_hypothesis_sees_its_own_values(rng):
    library, relative = a_library(BENT, 4.0), np.array([0.8, 1.1])
    values = rng.normal(size=(len(sample_phases()), 2, 2)) * 0.1
    prior = Gaussian(library.observed_mean[:2], library.observed_covariance[:2])
    *_, together = filter_samples(library, prior, np.array([1.0, 1.3]), relative, values)
    for k in range(2):
        one = Gaussian(prior.mean[k : k + 1], prior.covariance[k : k + 1])
        pace = np.array([1.0, 1.3])[k : k + 1]
        own = relative[k : k + 1]
        *_, alone = filter_samples(library, one, pace, own, values[:, k : k + 1])
        np.testing.assert_allclose(alone.log_evidence, together.log_evidence[[k]], rtol=1e-9)


def test_a_known_start_conditions_the_controlled_agent(rng):
    """Against one joint Gaussian of the start and the weights."""
    library = replace(a_library(STEADY, np.inf), phase_deviation=STEADY)
    size, q = library.n_observed_weights, library.n_controlled
    joint = Gaussian(library.weight_mean[1], library.weight_covariance[1])
    poses = rng.normal(size=(1, q))
    rule = regression(joint, size)
    one = SimpleNamespace(mean=joint.mean, rule=rule, poses=poses, duration_s=2.0)
    prior = Gaussian(library.observed_mean[1:2], library.observed_covariance[1:2])
    values = rng.normal(size=(len(sample_phases()), 1, 2)) * 0.1
    progress = [*filter_samples(library, prior, np.ones(1), np.ones(1), values)][20]
    followed = Followed(progress, np.zeros((1, 1), dtype=int), np.ones((1, 1)), np.ones((1, 1)))
    phases = np.array([0.4, 0.9])
    human, robot = predict_agents(library, [one], followed, phases, start_known=True)
    alone, _ = predict_agents(library, [one], followed, phases)
    np.testing.assert_array_equal(human, alone)
    mean, covariance = progress.weights.moments()
    start = StartPosture(poses[0], np.zeros(q))
    exact = replace(library, regression_variance=0.0)
    weights = controlled_weights(exact, 1, Gaussian(mean[0], covariance[0]), start)
    expected = library.basis.design_matrix(phases) @ weights.mean.reshape(q, -1).T
    np.testing.assert_allclose(robot[0, 0], expected, atol=1e-9)


def test_examples_are_evenly_taken():
    assert evenly(range(10), 4) == [0, 3, 6, 9]
    assert evenly("abc", 60) == ["a", "b", "c"]
    assert evenly([], 60) == []
