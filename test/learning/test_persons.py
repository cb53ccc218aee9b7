# SPDX-License-Identifier: Apache-2.0
"""How people differ: a one-way model of random effects, and models without a person."""

import numpy as np
import pytest

from intent_recognition.learning import TrainingExample, summarize
from intent_recognition.learning.persons import (
    between_people,
    covariance_of_strangers,
    group_scatter,
    log_duration_variance_of_strangers,
    people,
    without_group,
)
from intent_recognition.promp import Scatter

N_OBSERVED, N_BASIS = 2, 4
SIZE = N_OBSERVED * N_BASIS
FLOOR = np.full(N_OBSERVED, 1e-12)
STRENGTH = 1e-9  # the data alone


def example(name: str, group: str, weights: np.ndarray) -> TrainingExample:
    nothing = np.zeros(0)
    whole = np.vstack([weights.reshape(N_OBSERVED, N_BASIS), np.zeros((1, N_BASIS))])
    return TrainingExample(name, "task", whole, nothing, 1.0, nothing, nothing, group=group)


def observed_weights(one: TrainingExample) -> np.ndarray:
    return one.weights[:N_OBSERVED].ravel()


def of_people(rng, offsets: np.ndarray, n: int, spread: float) -> list[TrainingExample]:
    """n demonstrations of each person, whose offsets (G, SIZE) are given."""
    return [
        example(f"{g}_{i}", f"person {g}", offset + spread * rng.normal(size=SIZE))
        for g, offset in enumerate(offsets)
        for i in range(n)
    ]


def pooled(tasks) -> Scatter:
    found = [summarize(task) for task in tasks]
    matrix = np.sum([one.scatter for one in found], axis=0)[:SIZE, :SIZE]
    return Scatter(matrix, sum(one.n - 1 for one in found))


def test_both_components_are_found_again(rng):
    root = 0.3 * rng.normal(size=(SIZE, SIZE)) / np.sqrt(SIZE)
    tasks = [of_people(rng, rng.normal(size=(400, SIZE)) @ root.T, 4, 0.05) for _ in range(2)]
    grouped = group_scatter(tasks, observed_weights)
    within, between = between_people(grouped, FLOOR, STRENGTH)
    assert (grouped.n_groups, grouped.share) == (400, 0.25)
    np.testing.assert_allclose(within, 0.05**2 * np.eye(SIZE), atol=2e-4)
    truth = root @ root.T
    assert np.linalg.norm(between - truth) < 0.1 * np.linalg.norm(truth)


def test_a_single_number_agrees_with_the_analysis_of_variance(rng):
    """Balanced: B = (mean square between - mean square within) / n, or zero."""
    tasks = [of_people(rng, rng.normal(size=(5, SIZE)), 3, 0.5)]
    grouped = group_scatter(tasks, observed_weights)
    weights = np.array([e.weights[:N_OBSERVED].ravel() for e in tasks[0]]).reshape(5, 3, SIZE)
    means = weights.mean(axis=1)
    within = ((weights - means[:, None]) ** 2).sum(axis=(0, 1)) / 10
    between = 3 * ((means - means.mean(axis=0)) ** 2).sum(axis=0) / 4
    np.testing.assert_allclose(np.diag(grouped.within.matrix) / 10, within)
    np.testing.assert_allclose(
        np.diag(grouped.between.matrix) / 4 - grouped.share * within, (between - within) / 3
    )


def test_a_stranger_varies_as_people_do_where_they_differ(rng):
    tasks = [of_people(rng, rng.normal(size=(4, SIZE)), 5, 0.2) for _ in range(3)]
    grouped = group_scatter(tasks, observed_weights)
    within, between = between_people(grouped, FLOOR, 4.0)
    found = covariance_of_strangers(tasks, pooled(tasks), FLOOR, 4.0)
    np.testing.assert_allclose(found, within + 1.25 * between)
    unknown = [[e._replace(group="") for e in task] for task in tasks]
    alike = covariance_of_strangers(unknown, pooled(tasks), FLOOR, 4.0)
    assert np.trace(found) > 1.2 * np.trace(alike)  # people count as few draws
    tasks = [of_people(rng, np.zeros((6, SIZE)), 5, 0.2) for _ in range(3)]
    found = covariance_of_strangers(tasks, pooled(tasks), FLOOR, 4.0)
    unknown = [[e._replace(group="") for e in task] for task in tasks]
    alike = covariance_of_strangers(unknown, pooled(tasks), FLOOR, 4.0)
    assert np.trace(found) == pytest.approx(np.trace(alike), rel=0.25)


def test_more_tasks_of_the_same_people_tell_no_more_of_how_people_differ(rng):
    task = of_people(rng, rng.normal(size=(8, SIZE)), 5, 0.2)
    once, often = (
        between_people(group_scatter(n * [task], observed_weights), FLOOR, 8.0)[1] for n in (1, 6)
    )
    assert np.linalg.norm(often - once) < 0.2 * np.linalg.norm(once)


def test_durations_of_a_stranger_vary_as_people_do(rng):
    """Of many people with many demonstrations: the variances within and between them."""
    paces = 0.5 * rng.normal(size=200)
    tasks = [
        [one._replace(duration_s=float(np.exp(pace + 0.1 * rng.normal()))) for one in person]
        for pace in paces
        for person in [of_people(rng, np.zeros((1, SIZE)), 5, 0.2)]
    ]
    named = [one._replace(group=str(k)) for k, person in enumerate(tasks) for one in person]
    found = log_duration_variance_of_strangers([named])
    assert found == pytest.approx(0.1**2 + np.var(paces), rel=0.05)
    assert log_duration_variance_of_strangers([[e._replace(group="") for e in named]]) is None


def test_people_are_left_out_where_groups_say_something_of_them(rng):
    two_people = [of_people(rng, np.zeros((2, SIZE)), 5, 0.2)] * 2
    one_person = [of_people(rng, np.zeros((1, SIZE)), 5, 0.2)]
    each_another = [of_people(rng, np.zeros((5, SIZE)), 1, 0.2)]
    somebody_s = [[*one_person[0], example("x", "", np.zeros(SIZE))]]
    for tasks in (two_people, one_person, each_another, somebody_s):
        assert group_scatter(tasks, observed_weights) is None
    assert people([summarize(one_person[0])]) == 1
    assert people([summarize(somebody_s[0])]) == 0
    tasks = [summarize(of_people(rng, np.zeros((3, SIZE)), 2, 0.2)) for _ in range(2)]
    rest = without_group(tasks, "person 1")
    assert [task.n for task in rest] == [4, 4] and people(rest) == 2
    assert without_group(tasks, "") is None
    alone = [*tasks, summarize(of_people(rng, np.zeros((1, SIZE)), 2, 0.2))]
    assert without_group(alone, "person 0") is None
