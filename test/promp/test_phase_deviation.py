# SPDX-License-Identifier: Apache-2.0
"""The phase deviation on its grid: a stationary process, whatever the steps."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t

from intent_recognition.promp import STEADY, PhaseDeviation, deviation_prior, deviation_transition
from intent_recognition.promp import phase_deviation as module
from intent_recognition.promp.phase_deviation import reference_phase, steady_phase, steady_rate

passed = st.floats(0.0, 3.0)
correlations = st.floats(0.02, 2.0)


def a_progress(correlation: float = 0.4, std: float = 0.03) -> PhaseDeviation:
    phase = np.linspace(0.0, 1.0, 51)
    return PhaseDeviation(std * np.sqrt(4.0 * phase * (1.0 - phase)) + 0.004, correlation, 0.3)


@given(st.floats(-2.0, 2.0), st.floats(0.2, 5.0), st.floats(0.2, 5.0))
def test_relative_durations_multiply_as_what_they_do_to_the_phase(duration_exponent, first, second):
    bent, phase = replace(STEADY, duration_exponent=duration_exponent), np.linspace(0.0, 1.0, 21)
    both = steady_phase(bent, steady_phase(bent, phase, first), second)
    np.testing.assert_allclose(both, steady_phase(bent, phase, first * second), atol=1e-12)
    np.testing.assert_allclose(steady_phase(bent, phase, 1.0), phase, atol=1e-15)
    opposite = 1.0 - steady_phase(
        replace(bent, duration_exponent=-duration_exponent), 1.0 - phase, first
    )
    np.testing.assert_allclose(opposite, steady_phase(bent, phase, first), atol=1e-12)
    inner, step = phase[1:-1], 1e-6
    ahead, behind = (steady_phase(bent, inner + by, first) for by in (step, -step))
    slope = (ahead - behind) / (2.0 * step)
    np.testing.assert_allclose(steady_rate(bent, inner, first), slope, rtol=1e-4)


@pytest.mark.parametrize(("duration_exponent", "at"), [(1.0, 0.0), (-1.0, 1.0)])
def test_a_bend_of_one_keeps_the_pace_of_the_beginning_or_the_end(duration_exponent, at):
    bent = replace(STEADY, duration_exponent=duration_exponent)
    durations = np.array([0.5, 1.0, 3.0])
    pace = steady_rate(bent, np.full(3, at), durations) / durations
    np.testing.assert_allclose(pace, 1.0)
    assert np.array_equal(steady_rate(bent, np.array([-0.1, 1.1]), 2.0), [0.0, 0.0])


def test_steady_progress_has_one_deviation_and_the_prior_is_student_s_on_the_grid():
    assert np.array_equal(STEADY.grid, [0.0])
    assert np.array_equal(deviation_prior(STEADY), [1.0])
    assert np.array_equal(deviation_transition(STEADY, np.array([0.0, 0.3])), np.ones((2, 1, 1)))
    phase = np.array([-0.5, 0.0, 0.25, 1.0, 1.7])
    assert np.array_equal(reference_phase(STEADY, phase)[:, 0], np.clip(phase, 0.0, 1.0))
    density = t(module.STUDENT_FREEDOM).pdf(a_progress().grid)
    np.testing.assert_allclose(deviation_prior(a_progress()), density / density.sum(), rtol=1e-12)


@given(passed, correlations)
def test_a_transition_is_one_and_keeps_the_prior(step, correlation):
    phase_deviation = a_progress(correlation)
    moved, prior = (
        deviation_transition(phase_deviation, np.array(step)),
        deviation_prior(phase_deviation),
    )
    assert moved.min() > 0.0
    np.testing.assert_allclose(moved.sum(axis=-1), 1.0, atol=1e-12)
    np.testing.assert_allclose(prior @ moved, prior, atol=1e-12)
    flow = prior[:, None] * moved
    np.testing.assert_allclose(flow, flow.T, atol=1e-12)


@given(passed, passed, correlations)
def test_two_transitions_are_that_of_their_sum(first, second, correlation):
    phase_deviation = a_progress(correlation)
    both = deviation_transition(phase_deviation, np.array(first)) @ deviation_transition(
        phase_deviation, np.array(second)
    )
    np.testing.assert_allclose(
        both, deviation_transition(phase_deviation, np.array(first + second)), atol=1e-10
    )


@pytest.mark.parametrize("step", [0.0, -0.01])
def test_the_lead_stays_while_nothing_passes(step):
    np.testing.assert_allclose(
        deviation_transition(a_progress(), np.array(step)), np.eye(15), atol=1e-10
    )


@pytest.mark.parametrize("step", [1e-3, 0.033, 0.2, 0.8, 2.0])
def test_the_lead_is_forgotten_like_an_ornstein_uhlenbeck_process(step):
    """Means decay as exp(-u / correlation), nearly: the slowest mode is not straight."""
    phase_deviation = a_progress()
    grid, prior = phase_deviation.grid, deviation_prior(phase_deviation)
    variance = prior @ grid**2
    kept = (prior * grid) @ deviation_transition(phase_deviation, np.array(step)) @ grid / variance
    np.testing.assert_allclose(kept, np.exp(-step / 0.4), atol=0.006)


@given(st.lists(st.floats(-2.0, 3.0), min_size=1, max_size=6), st.floats(0.001, 0.3))
def test_phases_lie_in_the_movement_and_rise_with_the_deviation(recorded, std):
    phase_deviation = a_progress(std=std)
    phase = reference_phase(phase_deviation, np.array(recorded))
    assert phase.shape == (len(recorded), 15)
    assert phase.min() >= 0.0
    assert phase.max() <= 1.0
    assert np.all(np.diff(phase, axis=-1) >= 0.0)
    np.testing.assert_allclose(phase[:, 7], np.clip(recorded, 0.0, 1.0), atol=1e-15)


def test_the_lead_counts_in_its_standard_deviation_at_that_phase():
    phase_deviation = PhaseDeviation(np.array([0.0, 0.1, 0.0]), 0.4, 1.0)
    np.testing.assert_allclose(
        reference_phase(phase_deviation, np.array([0.0, 0.25, 0.5])),
        np.array([[0.0], [0.25], [0.5]]) + np.array([[0.0], [0.05], [0.1]]) * phase_deviation.grid,
    )
