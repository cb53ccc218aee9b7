# SPDX-License-Identifier: Apache-2.0
"""What must speak for a change of mind, and libraries without some of their demonstrations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import expit
from simulation import gathered, make_library, simulate

from intent_recognition.filtering import MovementFilter, make_prior_grid
from intent_recognition.learning import TrainingSettings, left_out, sample_phases, summarize
from intent_recognition.learning.fitting import library_from_statistics, statistics_of
from intent_recognition.learning.left_out import (
    LeavingOut,
    largest_odds,
    largest_odds_against,
    learn_switch_margin,
)
from intent_recognition.promp import conformal_bound
from intent_recognition.signals import observations_of

WHOLE = TrainingSettings(n_basis=8, n_aligned_basis=8, segmentation="recording")


@pytest.fixture(scope="module")
def trained():
    """Three tasks of three observed DOFs, four demonstrations each."""
    rng = np.random.default_rng(5)
    truth = make_library(rng, n_tasks=3, groups=(3,), n_controlled=1, n_basis=8, spread=0.05)
    recordings = [simulate(truth, i % 3, rng, name=f"{i:02d}", n_samples=60) for i in range(12)]
    return gathered(recordings, WHOLE)


@pytest.fixture(scope="module")
def tasks(trained):
    return statistics_of(trained.tasks, trained.chosen.aligned)


def test_without_a_demonstration_it_observes_as_if_it_had_been_learned_so(trained, tasks):
    label, (first, *rest) = "task_1", tasks["task_1"].examples
    found = LeavingOut(trained.library, tasks).demonstration(1, first).as_library()
    fewer = {**tasks, label: summarize(rest)}
    anew = library_from_statistics(fewer, trained.preprocessing, trained.chosen)
    np.testing.assert_allclose(found.observed_mean[:-1], anew.observed_mean[:-1], atol=1e-10)
    np.testing.assert_allclose(found.none_mean, anew.none_mean, atol=1e-10)
    np.testing.assert_allclose(
        found.observed_covariance[:-1], anew.observed_covariance[:-1], atol=1e-6
    )
    assert not np.allclose(found.observed_mean[1], trained.library.observed_mean[1], atol=1e-6)


@pytest.mark.slow
def test_a_movement_that_becomes_another_task_has_higher_odds(trained, tasks):
    library = trained.library
    one, other = (tasks[label].examples[0] for label in ("task_0", "task_2"))
    done = np.linspace(-1.0, 2.0, len(one.observed)).clip(0.0, 1.0)[:, None]
    changed = one._replace(observed=one.observed + done * (other.observed - one.observed))
    unchanged = [largest_odds(library, 0, example) for example in tasks["task_0"].examples]
    assert largest_odds(library, 0, changed) > max(0.0, *unchanged)


def shown_by(people, tasks):
    """Statistics of examples that these people have shown in turn; c moves half as in the next."""
    found, labels = {}, list(tasks)
    for n, (label, task) in enumerate(tasks.items()):
        other, shown = tasks[labels[n - 1]].examples[0], []
        for k, one in enumerate(task.examples):
            part = 0.5 if people[k % len(people)] == "c" else 0.0
            weights = one.weights + part * (other.weights - one.weights)
            observed = one.observed + part * (other.observed - one.observed)
            shown.append(
                one._replace(group=people[k % len(people)], weights=weights, observed=observed)
            )
        found[label] = summarize(shown)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("people", ["", "abc"])
def test_the_margin_is_what_left_out_movements_stay_below(trained, tasks, people, monkeypatch):
    monkeypatch.setattr(left_out, "MAX_FOLLOWED", 12)
    whose = people or [""]
    tasks, recorded = shown_by(whose, tasks), shown_by(whose, trained.tasks)
    leaving_out = LeavingOut(trained.library, tasks)
    odds = []
    for k, label in enumerate(tasks):
        examples = zip(tasks[label].examples, recorded[label].examples, strict=True)
        for example, as_recorded in examples:
            person = leaving_out.group(example.group)
            assert (person is not None) == bool(people)
            without = person or leaving_out.demonstration(k, example)
            odds.append(largest_odds(without.as_library(), k, as_recorded))
    margin = learn_switch_margin(LeavingOut(trained.library, tasks), recorded)
    assert margin == max(0.0, conformal_bound(np.array(odds), 0.05))
    wary = replace(trained.library, switch_margin=margin + 3.0)
    assert learn_switch_margin(LeavingOut(wary, tasks), recorded) == margin


def test_odds_against_a_task_are_those_at_which_the_robot_may_act(trained, tasks):
    """Beside the nodes' filter, which acts while none has a tenth at most."""
    example = tasks["task_1"].examples[0]
    stamps_ns = np.round(sample_phases() * example.duration_s * 1e9).astype(np.int64)
    for none_margin, early in ((0.0, True), (8.0, False)):
        library = replace(trained.library, none_margin=none_margin, switch_margin=1.0)
        run, largest = MovementFilter(library, make_prior_grid(library), 0, switching=True), 0.5
        for observation in observations_of(library.observed_groups, stamps_ns, example.observed):
            run.observe(observation)
            *known, none = run.posterior(observation.stamp_ns).probabilities
            if none <= 0.1:
                largest = max(largest, 1.0 - known[1] / sum(known))
        assert (largest > 0.5) == early
        assert expit(largest_odds_against(library, 1, example)) == pytest.approx(largest, abs=1e-9)


def test_without_a_rival_nothing_need_speak_for_a_change_of_mind(trained, tasks):
    only = {"task_0": tasks["task_0"]}
    library = library_from_statistics(only, trained.preprocessing, trained.chosen)
    assert (
        learn_switch_margin(LeavingOut(library, only), {"task_0": trained.tasks["task_0"]}) == 0.0
    )


def test_people_are_left_out_together(trained, tasks):
    people = {
        label: summarize([e._replace(group="ab"[k % 2]) for k, e in enumerate(task.examples)])
        for label, task in tasks.items()
    }
    found = LeavingOut(trained.library, people).group("a").as_library()
    rest = {k: summarize([e for e in t.examples if e.group != "a"]) for k, t in people.items()}
    anew = library_from_statistics(rest, trained.preprocessing, trained.chosen)
    np.testing.assert_allclose(found.observed_mean[:-1], anew.observed_mean[:-1], atol=1e-10)
    only = {k: summarize([e._replace(group="a") for e in t.examples]) for k, t in people.items()}
    assert LeavingOut(trained.library, only).group("a") is None
