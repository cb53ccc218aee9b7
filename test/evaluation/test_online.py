# SPDX-License-Identifier: Apache-2.0
"""The online block is what the estimator and the decision do, one observation after the other."""

from dataclasses import replace

import numpy as np
import pytest
from model_builder import learned_model, make_dofs, perform, true_library

from intent_recognition.evaluation import run_online
from intent_recognition.evaluation.online import OnlineOutcome, summarise_online
from intent_recognition.recognition import DecisionSettings, DecisionState, IntentEstimator, decide
from intent_recognition.signals import merge

DOFS = make_dofs()
TRUTH = true_library(DOFS, n_tasks=2)


@pytest.fixture(scope="module")
def library():
    return learned_model(DOFS, TRUTH).library


@pytest.mark.slow
@pytest.mark.parametrize("limit", [DecisionSettings().max_end_std_rad, 0.02])
def test_it_equals_the_nodes_own_loop_that_predicts_the_end_every_time(library, limit):
    settings = DecisionSettings(max_end_std_rad=limit)
    for seed in (50, 51):
        recorded = perform(TRUTH, seed % 2, seed)
        estimator, state = IntentEstimator(library), DecisionState()
        active = [""]
        for observation in merge((*recorded.observed, *recorded.controlled)):
            if observation.stamp_ns > recorded.end_ns:
                break
            if observation.group:
                estimator.update_controlled(observation._replace(group=0))
                continue
            estimate = estimator.update(observation)
            end_std = estimator.predicted_end_std()
            state, now = decide(
                settings,
                state,
                estimate.labels,
                estimate.probabilities,
                end_std,
                estimate.log_evidence,
            )
            active += [now] if now != active[-1] else []
        outcome = run_online(library, recorded, settings)
        assert outcome.activated == tuple(task for task in active if task)
        assert outcome.recognised == recorded.task


def test_known_movements_are_acted_on_and_with_a_hopeless_limit_only_recognised(library):
    recorded = perform(TRUTH, 1, 60)
    outcome = run_online(library, recorded)
    assert outcome.activated == (recorded.task,) and 0.0 < outcome.decided_share < 1.0
    strict = run_online(library, recorded, DecisionSettings(max_end_std_rad=1e-9))
    assert (strict.recognised, strict.activated) == (recorded.task, ())
    assert np.isnan(strict.decided_share)


def test_told_the_start_and_the_duration_it_waits_for_no_onset(library):
    """Given the middle of a rest as the beginning, an estimator that must find the onset does."""
    slow = perform(TRUTH, 0, 61, rest_before_s=0.0, rest_after_s=0.0)
    told = run_online(library, slow, phase_known=True)
    assert told.recognised == slow.task and told.activated == (slow.task,)
    frozen = replace(
        slow, observed=tuple(replace(s, values=0 * s.values + s.values[:1]) for s in slow.observed)
    )
    assert run_online(library, frozen).recognised == ""


def test_the_table():
    nan = float("nan")
    outcomes = [
        OnlineOutcome("a", "a", ("a",), 0.2),
        OnlineOutcome("a", "a", (), nan),
        OnlineOutcome("b", "a", ("a", "b"), 0.6),
        OnlineOutcome("b", "", (), nan),
    ]
    assert summarise_online(outcomes) == {
        "recognised": 0.5,
        "acted_on": 0.5,
        "wrongly_acted_on": 0.25,
        "median_share_at_decision": pytest.approx(0.4),
    }
    assert summarise_online(outcomes[1:2])["median_share_at_decision"] is None
