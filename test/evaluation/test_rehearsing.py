# SPDX-License-Identifier: Apache-2.0
"""What the nodes would do on recordings: scored online, and rehearsed before deployment."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from model_builder import learned_model, make_dofs, perform, true_library
from scipy.stats import binom

from intent_recognition.errors import ArgumentError
from intent_recognition.evaluation import Rehearsal, rehearse, run_online
from intent_recognition.evaluation.online import OnlineOutcome, summarise_online
from intent_recognition.evaluation.rehearsing import Suggestion, suggest
from intent_recognition.recognition import DecisionState, IntentEstimator, decide, decision_settings
from intent_recognition.recognition.decision import DecisionSettings
from intent_recognition.report import rehearsal_tables
from intent_recognition.signals import merge

DOFS = make_dofs()
TRUTH = true_library(DOFS, n_tasks=2)


@pytest.fixture(scope="module")
def library():
    return learned_model(DOFS, TRUTH).library


@pytest.mark.slow
def test_it_counts_what_the_nodes_would_do(library):
    recordings = [perform(TRUTH, seed % 2, seed) for seed in range(60, 64)]
    recordings.append(replace(recordings[0], task="task_1"))  # a wrong label
    found = rehearse(library, iter(recordings))
    for run, recorded in zip(found.runs, recordings, strict=True):
        outcome = run_online(library, recorded)
        assert run.activated == outcome.activated
        share = run.decided_s / recorded.duration_s
        np.testing.assert_allclose(share, outcome.decided_share, rtol=1e-9)
        assert len(run.times_s) == len(run.probabilities) == len(run.active)
        assert len(run.computed_s) == len(recorded.observed[0].stamps_ns)
        p = run.probabilities[:, run.labels.index(run.task)]
        told = np.minimum(p, 1 - p) > 1e-9  # beyond, rounding is told
        np.testing.assert_allclose(run.odds_against[told], np.log((1 - p) / p)[told], atol=1e-3)
    assert [run.wrong for run in found.runs] == [False] * 4 + [True]
    assert (found.n_wrong, found.n_missed) == (1, 1)
    assert found.worst(2)[0].recorded is recordings[4]
    assert len(found.worst(2)) == 2


def test_a_decision_that_is_never_sure_misses_everything(library):
    recorded = perform(TRUTH, 1, 60)
    never = DecisionSettings(max_end_std_rad=1e-9, max_end_std_m=1e-9)
    found = rehearse(library, [recorded], never)
    assert (found.n_missed, found.n_wrong) == (1, 0)
    assert np.isnan(found.runs[0].decided_s)
    twice = [Suggestion("task_1", 0, prevented) for prevented in (0.2, 0.1)]
    result, wanted, worst = rehearsal_tables(found, twice, found.worst(1)).values()
    assert ("decision", "never") in result
    assert [(row[0], *row[2:]) for row in wanted[1:]] == [("task_1", "2", "0.30")]
    assert re.fullmatch(r"\w+ \(\d+%\)", worst[1][-1])
    assert rehearse(library, [recorded], decision_settings(library)).n_missed == 0
    outcome = run_online(library, recorded)
    assert outcome.activated == (recorded.task,) and 0.0 < outcome.decided_share < 1.0
    strict = run_online(library, recorded, DecisionSettings(max_end_std_rad=1e-9))
    assert (strict.recognised, strict.activated) == (recorded.task, ())
    assert np.isnan(strict.decided_share)


@pytest.mark.parametrize(("n_wrong", "n"), [(0, 12), (3, 20), (5, 5)])
def test_the_interval_leaves_the_stated_tails(n_wrong, n):
    runs = [SimpleNamespace(wrong=k < n_wrong) for k in range(n)]
    low, high = Rehearsal(tuple(runs)).wrong_interval()
    if n_wrong:
        np.testing.assert_allclose(binom.sf(n_wrong - 1, n, low), 0.025, rtol=1e-6)
    if n_wrong < n:
        np.testing.assert_allclose(binom.cdf(n_wrong, n, high), 0.025, rtol=1e-6)
    assert low <= n_wrong / n <= high


@pytest.mark.parametrize("recordings", [[], [replace(perform(TRUTH, 0, 1), task="task_9")]])
def test_nothing_to_rehearse_or_of_an_unknown_task_is_refused(library, recordings):
    with pytest.raises(ArgumentError, match=r"Record some|Teach it|Teach the task"):
        rehearse(library, recordings)


def example(task, place, spread=0.0):
    """A movement that stays at a place, (m, P), with a deviation."""
    return SimpleNamespace(task=task, observed=np.full((60, 2), place + spread))


def shown(task, place, n):
    return [example(task, place, 0.1 * (-1) ** k) for k in range(n)]


def test_suggested_is_the_task_that_fails_where_nobody_showed_it():
    rehearsed = [example("a", 0.0), example("b", 5.0)]
    often = [*shown("a", 0.0, 4), *shown("b", 5.0, 4)]
    assert suggest(often, rehearsed, [True, False], 1)[0].task == "a"
    assert suggest(often, rehearsed, [False, True], 1)[0].task == "b"
    seldom = [*shown("a", 0.0, 8), *shown("b", 5.0, 2)]
    assert suggest(seldom, rehearsed, [True, True], 1)[0].task == "b"
    known = shown("a", 0.0, 6)
    rehearsed = [example("a", 0.0), example("a", 2.0)]
    found = suggest(known, rehearsed, [True, True], 2)
    assert found[0].like == 1
    # far from all that was shown, one demonstration halves the risk
    risk = 0.5 * (1.0 + 3.0 / 4.0)
    assert found[0].prevented == pytest.approx(risk / 2.0, rel=1e-6)
    rehearsed = [example("a", 0.0), example("b", 5.0)]
    known = [*shown("a", 0.0, 3), *shown("b", 5.0, 3)]
    tasks = [one.task for one in suggest(known, rehearsed, [True, True], 4)]
    assert sorted(tasks) == ["a", "a", "b", "b"]
    prevented = [one.prevented for one in suggest(known, rehearsed, [True, True], 4)]
    assert prevented == sorted(prevented, reverse=True)


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
        "n": 4,
        "recognised": 0.5,
        "acted_on": 0.5,
        "wrongly_acted_on": 0.25,
        "median_share_at_decision": pytest.approx(0.4),
    }
    assert summarise_online(outcomes[1:2])["median_share_at_decision"] is None
