# SPDX-License-Identifier: Apache-2.0
"""People whom no recording names are told apart where they differ clearly, and only there."""

import numpy as np
import pytest
from simulation import draw_weights, make_library, simulate

from intent_recognition.learning import (
    TrainingExample,
    TrainingSettings,
    add_demonstration,
    learn_with_report,
    summarize,
)
from intent_recognition.learning.persons import covariance_of_strangers
from intent_recognition.learning.statistics import merge_tasks
from intent_recognition.learning.unnamed_people import tell_apart, told_apart, with_people
from intent_recognition.promp import Scatter
from intent_recognition.signals import Demonstration

N_OBSERVED, N_BASIS, N_PEOPLE = 2, 6, 4
SIZE = N_OBSERVED * N_BASIS
SCALES = np.geomspace(1.0, 0.05, SIZE)


def offsets(rng, apart: float, tasks: np.ndarray, who: np.ndarray) -> np.ndarray:
    """People whose offsets are `apart` standard deviations of their own variation."""
    own = rng.normal(size=(N_PEOPLE, SIZE))[who]
    found = SCALES * (apart * own + rng.normal(size=own.shape))
    for task in set(tasks):
        found[tasks == task] -= found[tasks == task].mean(axis=0)
    return found


def same(first, second) -> bool:
    """Whether two numberings are the same partition."""
    pairs = set(zip(first, second, strict=True))
    return len(pairs) == len(set(first)) == len(set(second))


def design(rng) -> tuple[np.ndarray, np.ndarray]:
    """Three tasks and four people, four times each, in any order."""
    tasks, who = np.indices((3, N_PEOPLE, 4))[:2].reshape(2, -1)[:, rng.permutation(48)]
    return tasks, who


@pytest.mark.parametrize("seed", range(3))
def test_people_who_differ_clearly_are_told_apart(seed):
    rng = np.random.default_rng(seed)
    tasks, who = design(rng)
    found = tell_apart(offsets(rng, 8.0, tasks, who), [*map(str, tasks)])
    assert same(found, who)


@pytest.mark.parametrize("draw", ["normal", "uniform", "standard_t"])
def test_one_person_is_nobody_else(draw):
    rng = np.random.default_rng(3)
    tasks, _ = design(rng)
    size = {"size": (48, SIZE)}
    arguments = {"normal": {}, "uniform": {"low": -1, "high": 1}, "standard_t": {"df": 4}}[draw]
    assert not tell_apart(
        SCALES * getattr(rng, draw)(**arguments, **size), [*map(str, tasks)]
    ).any()


def test_ways_to_do_a_task_are_no_people(rng):
    """Clusters of one task, and clusters of which each task has other ones."""
    tasks, who = design(rng)
    apart = offsets(rng, 8.0, tasks, who)
    assert not tell_apart(apart, ["the same"] * 48).any()
    assert not tell_apart(apart, [f"{way < 2}" for way in who]).any()


def statistics(weights: np.ndarray, tasks: np.ndarray, people: list[str], start: int = 0):
    nothing, robot = np.zeros(0), np.zeros((1, N_BASIS))
    found: dict[str, list[TrainingExample]] = {}
    for k, (task, group) in enumerate(zip(tasks, people, strict=True), start):
        whole = np.vstack([weights[k - start].reshape(N_OBSERVED, N_BASIS), robot])
        one = TrainingExample(f"{k}", f"{task}", whole, nothing, 1.0, nothing, nothing, group=group)
        found.setdefault(f"{task}", []).append(one)
    return {label: summarize(own) for label, own in sorted(found.items())}


def of_strangers(tasks) -> np.ndarray:
    examples = [task.examples for task in tasks.values()]
    nobody = Scatter(np.eye(SIZE), 1.0)
    return covariance_of_strangers(examples, nobody, np.full(N_OBSERVED, 1e-12), 4.0)


def test_a_stranger_varies_as_if_the_recordings_named_the_people(rng):
    tasks, who = design(rng)
    weights = offsets(rng, 8.0, tasks, who) + tasks[:, None]
    named = statistics(weights, tasks, [f"{k}" for k in who])
    unnamed = with_people(statistics(weights, tasks, [""] * 48), N_OBSERVED)
    np.testing.assert_allclose(of_strangers(unnamed), of_strangers(named))
    assert told_apart(unnamed) and not told_apart(named)
    assert groups(with_people(named, N_OBSERVED)) == groups(named)
    assert with_people({}, N_OBSERVED) == {}


def groups(tasks) -> dict[str, str]:
    return {one.name: one.group for task in tasks.values() for one in task.examples}


def test_a_demonstration_more_is_one_of_the_same_people_who_may_be_the_one_it_names(rng):
    tasks, who = design(rng)
    weights = offsets(rng, 8.0, tasks, who)
    first = with_people(statistics(weights[:-1], tasks[:-1], [""] * 47), N_OBSERVED)
    found = {}
    for name in ("", "anna"):
        last = statistics(weights[-1:], tasks[-1:], [name], 47)
        found[name] = groups(with_people(merge_tasks(first, last), N_OBSERVED))
    assert same([found[""][f"{k}"] for k in range(48)], who)
    assert told_apart(first) and sorted(found["anna"].values()) == [""] * 47 + ["anna"]


def test_training_leaves_out_people_whom_nobody_named(rng):
    """The risk of acting is one with somebody new; the next demonstration is of somebody known."""
    truth = make_library(rng, n_tasks=2, groups=(2,), n_controlled=1, n_basis=6, spread=0.05)
    places = np.array([[0.0, 0.0], [0.0, 2.0], [2.0, 0.0], [2.0, 2.0]])

    def recorded(task: int, who: int, number: int) -> Demonstration:
        weights = draw_weights(truth, task, rng) + np.append(places[who], 0.0)[:, None]
        name = f"{task}_{who}_{number}"
        return simulate(truth, task, rng, weights=weights, name=name, n_samples=40)

    settings = TrainingSettings(n_basis=6, n_aligned_basis=6, segmentation="recording")
    shown = [recorded(*one) for one in np.ndindex(2, N_PEOPLE, 2)]
    trained = learn_with_report(shown, settings).trained
    assert all(trained.library.left_out_odds.groups)
    for each in (trained, add_demonstration(trained, recorded(0, 1, 2))):
        examples = [one for task in each.tasks.values() for one in task.examples]
        assert same([one.group for one in examples], [one.name.split("_")[1] for one in examples])
        assert all(one.aligned.group == one.group for one in examples)
