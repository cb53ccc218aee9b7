# SPDX-License-Identifier: Apache-2.0
"""What may have begun at a stop takes over, or is followed for as long as a movement takes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from online_stream import movement
from simulation import minimum_jerk

from intent_recognition.filtering import TaskPosterior
from intent_recognition.recognition import USUAL_THRESHOLD, IntentEstimator
from intent_recognition.recognition.movement import is_done

STEP_S = 0.02


def test_a_hand_that_never_rests_again_is_not_followed_for_ever(library):
    estimator, angle, n_used = IntentEstimator(library), 0.0, [0]
    for t in np.arange(0.0, 40.0, STEP_S):
        if t > 0.5 and not 8.0 <= t < 8.2:  # a circle, and one stop
            angle += STEP_S * 0.8 * np.pi
        estimator.observe(100.0 + t, 0.4 * np.array([np.cos(angle), np.sin(angle), 0.0]))
        after = estimator._movements._after_stop
        n_used.append(after.n_used if after else 0)
    assert n_used[-1] == n_used[len(n_used) // 2] > 50


def test_a_reach_from_a_stop_takes_over_once_its_filter_recognises_it(truth, library):
    """The hand reaches, comes back, and reaches for something else without a rest."""
    rng = np.random.default_rng(7)
    first, second = (
        movement(truth, task, rng, rest_before_s=before_s, rest_after_s=0.0).observed[0].values
        for task, before_s in enumerate((0.8, 0.0))
    )
    back = first[-1] + minimum_jerk(np.linspace(0.0, 1.0, 40))[:, None] * (second[0] - first[-1])
    library = replace(library, none_margin=2.0, stop_margin=1.0)
    estimator, stamps = IntentEstimator(library), 100.0 + STEP_S * np.arange(1000)
    movements, margins = estimator._movements, set()
    for stamp_s, values in zip(stamps, np.concatenate([first, back, second]), strict=False):
        after = movements._after_stop
        estimate = estimator.observe(stamp_s, values)
        if after is not None and movements.run is after:
            break
        margins.add(movements.run.grid.none_margin if movements.run else None)
    assert margins == {None, 2.0} and movements.run.grid.none_margin == 1.0
    assert after.posterior(estimate.stamp_ns).probabilities[-1] <= 1.0 - USUAL_THRESHOLD
    assert estimate.task == "task_1"
    began_s = stamps[len(first) + len(back)]
    assert 0.05 < began_s - estimate.onset_ns * 1e-9 < 0.2
    estimator.swap(replace(library, none_margin=3.0, stop_margin=1.5))
    assert movements.run.grid.none_margin == 1.5
    movements.begin(estimate.stamp_ns, ())
    assert movements.run.grid.none_margin == 3.0


@pytest.mark.parametrize(
    ("goes_on", "another", "taken"),
    [(7.0, 6.9, False), (7.0, 7.1, True), (-30.0, -20.0, True), (None, -50.0, True)],
)
def test_another_movement_explains_what_follows_the_stop_better(library, goes_on, another, taken):
    """Whatever the prior of unknown movements; `None`: the one under way is overdue."""
    movements, prior = IntentEstimator(library)._movements, library.none_prior
    sure, at_rest = np.array([0.0, 1.0 - 1e-9, 0.0, 1e-9]), np.zeros(4)
    posterior = TaskPosterior(sure, at_rest, np.ones(4), np.ones(4), at_rest[:, None])
    later = posterior._replace(log_odds=np.log((1.0 - prior) / prior) + another)
    movements._after_stop = SimpleNamespace(
        restart=lambda *_: None, posterior=lambda _: later, onset_ns=0
    )
    end = None if goes_on is None else 5.0 + goes_on
    samples = [(10, 1.0, None), (20, 5.0, None), (30, 6.0, None), (40, end, 30)]
    for stamp_ns, log_odds, stop_ns in samples:
        movements._detector = SimpleNamespace(
            stopped_ns=lambda stop=stop_ns: stop, since=lambda _: []
        )
        own = None if log_odds is None else posterior._replace(log_odds=log_odds)
        observation = SimpleNamespace(stamp_ns=stamp_ns)
        following = movements._following(observation, own)
    assert (following is not None) is taken


@pytest.mark.parametrize(
    ("probabilities", "phase", "done"),
    [((0.7, 0.2, 0.1), (0.9, 0.5), True), ((0.7, 0.2, 0.1), (0.5, 0.9), False)]
    + [((0.2, 0.1, 0.7), (0.5, 0.5), True)],
)
def test_a_movement_is_done_near_its_end_or_where_it_is_of_no_task(probabilities, phase, done):
    posterior = SimpleNamespace(probabilities=np.array(probabilities), phase=np.array(phase))
    assert is_done(posterior) is done and is_done(None)
