# SPDX-License-Identifier: Apache-2.0
"""Whether a task once believed is kept while its movement goes where it was expected to go."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from simulation import make_library, minimum_jerk, simulate

from intent_recognition.filtering.hypotheses import make_hypotheses
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.promp.library import IDENTITY_CALIBRATION, NONE, TaskLibrary
from intent_recognition.promp.prediction import Trajectory
from intent_recognition.recognition import hysteresis as hysteresis
from intent_recognition.recognition.decision import DecisionSettings, DecisionState, decide
from intent_recognition.recognition.estimator import IntentEstimator
from intent_recognition.recognition.hysteresis import (
    N_RECOGNISED,
    RECOGNISED_AT,
    PosteriorHysteresis,
    RecognisedTask,
    is_near,
    next_recognised,
    total_known,
    without_evidence_for_none,
)
from intent_recognition.recognition.posterior import TaskPosterior
from intent_recognition.signals.demonstration import Demonstration
from intent_recognition.signals.observation import Observation, merge

SURE, OTHER, UNSURE = np.array([0.95, 0.03, 0.02]), np.array([0.03, 0.95, 0.02]), np.full(3, 1 / 3)
NONE_LEADS = np.array([0.01, 0.01, 0.98])
LOG_PRIOR = np.log([0.6, 0.29, 0.11])


def after(*probabilities: np.ndarray) -> RecognisedTask:
    recognised = RecognisedTask()
    for p in probabilities:
        recognised = next_recognised(recognised, p)
    return recognised


def posterior(log_evidence: np.ndarray) -> TaskPosterior:
    joint = LOG_PRIOR + log_evidence
    p = np.exp(joint - np.logaddexp.reduce(joint))
    zero = np.zeros(3)
    return TaskPosterior(p, np.asarray(log_evidence, dtype=float), zero, zero, zero[:, None])


def test_a_task_is_recognised_at_the_nth_consecutive_observation_and_stays_so():
    assert after(*[SURE] * (N_RECOGNISED - 1)).task == -1
    assert after(*[SURE] * N_RECOGNISED).task == 0
    assert after(*[SURE] * (N_RECOGNISED - 1), UNSURE, *[SURE] * (N_RECOGNISED - 1)).task == -1
    assert after(*[SURE] * N_RECOGNISED, *[NONE_LEADS] * 20).task == 0
    assert after(*[SURE] * N_RECOGNISED, *[OTHER] * N_RECOGNISED).task == 1


def test_none_is_never_believed():
    assert after(*[NONE_LEADS] * 20).task == -1
    assert after(*[np.array([RECOGNISED_AT - 1e-9, 0.0, 0.1 + 1e-9])] * 20).task == -1


def straight() -> Trajectory:
    """From 0 to 1 in two DOFs, the second known worse."""
    line = np.linspace(0.0, 1.0, 21)[:, None] * np.ones(2)
    return Trajectory(line[:, 0], line, np.ones_like(line), np.tile([0.01, 0.1], (21, 1)))


@pytest.mark.parametrize(
    ("place", "near"),
    [
        ((0.5, 0.5), True),
        ((0.52, 0.5), True),
        ((0.5, 0.79), True),
        ((0.5, 0.85), False),
        ((0.53, 0.8), True),
        ((1.02, 1.2), True),
        ((1.05, 1.0), False),
        ((-0.05, 0.0), False),
        ((np.nan, 0.5), True),
        ((0.5, np.nan), True),
        ((1.5, np.nan), False),
        ((np.nan, np.nan), False),
    ],
)
def test_near_is_within_the_spread_of_some_point_in_all_that_is_known(place, near):
    assert is_near(straight(), np.array(place), 3.0) is near


@given(arrays(np.float64, 3, elements=st.floats(-200.0, 200.0)))
def test_without_its_objection_none_is_as_probable_as_at_first(log_evidence):
    found = without_evidence_for_none(posterior(log_evidence), LOG_PRIOR)
    assert found.probabilities.sum() == pytest.approx(1.0, abs=1e-12)
    assert found.probabilities[-1] == pytest.approx(0.11)
    assert found.log_evidence[-1] == pytest.approx(total_known(log_evidence, LOG_PRIOR))
    np.testing.assert_array_equal(found.log_evidence[:-1], log_evidence[:-1])
    known = LOG_PRIOR[:-1] + log_evidence[:-1]
    share = np.exp(known - np.logaddexp.reduce(known))
    np.testing.assert_allclose(found.probabilities[:-1], 0.89 * share, rtol=1e-9)


def a_holding(place=(0.5, 0.5)) -> tuple[PosteriorHysteresis, list[int]]:
    """A movement whose task 0 is believed, and what was asked for."""
    asked: list[int] = []

    def course(task: int) -> Trajectory:
        asked.append(task)
        return straight()

    held = PosteriorHysteresis(LOG_PRIOR, 2, course)
    held.observe(np.array([0, 1]), np.array(place))
    for _ in range(N_RECOGNISED):
        held.update(SURE)
    return held, asked


def test_what_speaks_for_the_tasks_is_left_alone():
    held, asked = a_holding()
    speaks = posterior(np.array([1.0, 0.0, -1.0]))
    assert held.apply(speaks) is speaks
    assert not asked


def test_none_objecting_is_not_heard_on_the_course_and_heard_off_it():
    held, asked = a_holding()
    objects = posterior(np.array([0.0, -9.0, 6.0]))
    assert held.apply(objects).probabilities[-1] == pytest.approx(0.11)
    held.observe(np.array([0]), np.array([0.9]))
    assert held.apply(objects) is objects
    held.observe(np.array([1]), np.array([0.9]))
    assert held.apply(objects).probabilities[0] > 0.88
    assert asked == [0]


def test_the_course_is_predicted_anew_when_none_objects_again():
    held, asked = a_holding()
    held.apply(posterior(np.array([0.0, -9.0, 6.0])))
    held.apply(posterior(np.array([0.0, -9.0, -6.0])))
    held.apply(posterior(np.array([0.0, -9.0, 6.0])))
    assert asked == [0, 0]


def test_a_task_that_another_explains_better_is_not_held():
    held, asked = a_holding()
    other = posterior(np.array([-9.0, 0.0, 6.0]))
    assert held.apply(other) is other
    assert not asked


def test_nothing_is_held_before_a_task_was_believed():
    held = PosteriorHysteresis(LOG_PRIOR, 2, lambda task: straight())
    held.observe(np.array([0, 1]), np.array([0.5, 0.5]))
    objects = posterior(np.array([0.0, -9.0, 6.0]))
    assert held.apply(objects) is objects


@pytest.fixture(scope="module")
def truth() -> TaskLibrary:
    """What the simulated humans do."""
    rng = np.random.default_rng(5)
    return make_library(rng, n_tasks=3, n_basis=10, spread=0.03, noise_std=0.001)


@pytest.fixture(scope="module")
def library(truth) -> TaskLibrary:
    rng = np.random.default_rng(6)
    recordings = [movement(truth, i % 3, rng, name=f"demo_{i}") for i in range(36)]
    found = learn(recordings, TrainingSettings(n_basis=10))
    return replace(found, none_calibration=np.array(IDENTITY_CALIBRATION))


def movement(truth: TaskLibrary, task: int, rng: np.random.Generator, **options) -> Demonstration:
    return simulate(truth, task, rng, rest_before_s=0.8, rest_after_s=0.8, **options)


def interrupted(recording: Demonstration, after_s: float, going: np.ndarray) -> list[Observation]:
    """The hand goes elsewhere for a while, (m, P) from where it is, then on from where it was."""
    observations = list(merge(recording.observed))
    step = observations[1].stamp_ns - observations[0].stamp_ns
    k = next(
        i for i, o in enumerate(observations) if o.stamp_ns > recording.start_ns + after_s * 1e9
    )
    here = observations[k]
    extra = [
        here._replace(stamp_ns=here.stamp_ns + step * (i + 1), values=here.values + offset)
        for i, offset in enumerate(going)
    ]
    later = [o._replace(stamp_ns=o.stamp_ns + step * len(going)) for o in observations[k + 1 :]]
    return [*observations[: k + 1], *extra, *later]


def events(library: TaskLibrary, observations: list[Observation]) -> list[str]:
    estimator, state = IntentEstimator(library), DecisionState()
    settings = DecisionSettings(max_end_std_rad=np.inf, max_end_std_m=np.inf)
    found = []
    for observation in observations:
        e = estimator.update(observation)
        labels = (*library.labels, NONE)
        state, _ = decide(settings, state, labels, e.probabilities, None, e.log_evidence)
        found += [state.event] if state.event else []
    return found


@pytest.mark.slow
def test_a_hesitation_lets_nothing_go(library, truth, rng, monkeypatch):
    hesitating = interrupted(movement(truth, 0, rng, duration_s=2.0), 1.3, np.zeros((25, 3)))
    assert events(library, hesitating) == ["activated", "over"]
    monkeypatch.setattr(hysteresis, "NEAR", 0.0)
    assert "withdrawn" in events(library, hesitating)


@pytest.mark.parametrize("far_m", [0.2, 0.6])
def test_a_hand_that_goes_elsewhere_is_let_go(library, truth, rng, far_m):
    shares = minimum_jerk(np.linspace(0.0, 1.0, 40))
    away = far_m * shares[:, None] * np.array([1.0, -1.0, 1.0])
    elsewhere = interrupted(movement(truth, 0, rng, duration_s=2.0), 1.5, away)
    there = max(range(len(elsewhere)), key=lambda i: elsewhere[i].values[0])
    estimator = IntentEstimator(library)
    estimates = [estimator.update(observation) for observation in elsewhere[: there + 1]]
    assert max(e.probabilities[0] for e in estimates) > RECOGNISED_AT
    assert estimates[-1].probabilities[-1] > 0.99


def test_the_prior_of_tasks_sums_the_durations(library):
    hypotheses = make_hypotheses(library, np.array([0.5, 0.3, 0.2]))
    expected = [*(np.array([0.5, 0.3, 0.2]) * (1.0 - library.none_prior)), library.none_prior]
    np.testing.assert_allclose(np.exp(hypotheses.log_task_prior), expected, rtol=1e-12)
