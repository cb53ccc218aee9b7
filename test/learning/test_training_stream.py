# SPDX-License-Identifier: Apache-2.0
"""One by one equals all at once: streams, parts, and demonstrations added to a library."""

import tracemalloc
from dataclasses import replace
from functools import reduce
from random import Random

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from same_library import assert_same
from simulation import make_library, simulate

from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.learning import (
    Hyperparameters,
    Trained,
    accumulation,
    add_statistics,
    example_of,
    statistics,
    summarize,
)
from intent_recognition.learning.accumulation import accumulate, merge_accumulated
from intent_recognition.learning.fitting import library_from_statistics
from intent_recognition.learning.training import (
    TrainingSettings,
    add_demonstration,
    choose_again,
    choose_hyperparameters,
    learn_accumulated,
    learn_with_report,
)
from intent_recognition.promp import PoseRegression, ResidualCoupling, TaskLibrary
from intent_recognition.signals.demonstration import Demonstration

CUT = TrainingSettings(n_basis=6, n_aligned_basis=6)
WHOLE = replace(CUT, segmentation="recording")
TRUTH = make_library(np.random.default_rng(4), n_tasks=3, groups=(2, 1), n_basis=6)


def recordings(seed: int, n: int, n_tasks: int = 3) -> list[Demonstration]:
    """Recordings with rest at both ends, their tasks in turn."""
    rng = np.random.default_rng(seed)
    rests = {"rest_before_s": 0.5, "rest_after_s": 0.5, "rate_hz": 30.0}
    return [simulate(TRUTH, i % n_tasks, rng, name=f"demo_{i:02d}", **rests) for i in range(n)]


def assert_equal(found: TaskLibrary, expected: TaskLibrary, tolerance: float = 1e-8) -> None:
    """All but where it came from."""
    assert_same(found, expected, rtol=tolerance, atol=tolerance)


def anew(demonstrations: list[Demonstration], like: Trained) -> Trained:
    """Trained from nothing at the preprocessing and hyperparameters of another."""
    accumulated = accumulate(demonstrations, CUT, like.preprocessing)
    library = library_from_statistics(accumulated.tasks, like.preprocessing, like.chosen)
    of_left_out = ("none_margin", "stop_margin", "switch_margin", "left_out_odds")
    kept = (*of_left_out, "coupling", "pose_regression")
    library = replace(library, **{name: getattr(like.library, name) for name in kept})
    return Trained(library, like.preprocessing, accumulated.tasks, like.chosen)


@pytest.fixture(scope="module")
def report():
    """Of nine recordings, which several tests go on from."""
    return learn_with_report(recordings(1, 9), CUT, {"bags": ["a"]})


@pytest.mark.slow
@settings(max_examples=3)
@given(st.integers(0, 2**32 - 1), st.randoms(use_true_random=False), st.integers(1, 6))
@example(seed=2, random=Random(2), n_added=2)  # strengths with equal scores
def test_adding_in_any_order_equals_training_anew(seed, random, n_added):
    """Also when what is added is a task that was not there, and the first one of it."""
    all_of_them = recordings(seed, 9)
    start = [r for r in all_of_them if r.task != "task_1"][:3]
    added = [r for r in all_of_them if r not in start][:n_added]
    random.shuffle(added)
    trained = learn_with_report(start, CUT).trained
    for recorded in added:
        trained = add_demonstration(trained, recorded)
    expected = anew([*start, *added], trained)
    assert_equal(trained.library, expected.library)
    again, tried = choose_again(trained)
    expected_again, expected_tried = choose_again(expected)
    assert [one.pace for one in tried] == [one.pace for one in expected_tried]
    numbers, expected_numbers = ([one[1:] for one in some] for some in (tried, expected_tried))
    np.testing.assert_allclose(numbers, expected_numbers, rtol=1e-6, atol=1e-6)
    assert_equal(again.library, expected_again.library, 1e-6)


@pytest.mark.slow
def test_training_all_at_once_is_training_anew_and_adding_changes_nothing_before(report):
    assert_equal(anew(recordings(1, 9), report.trained).library, report.library, 1e-12)
    assert_equal(report.trained.library, report.library, 0.0)
    before, last = report.trained, recordings(1, 10)[-1]
    mean = before.library.weight_mean.copy()
    after = add_demonstration(before, last)
    assert np.array_equal(before.library.weight_mean, mean)
    assert before.library.n_demonstrations.tolist() == [3, 3, 3]
    assert after.library.n_demonstrations.tolist() == [4, 3, 3]
    assert after.library.provenance["bags"] == ["a", last.name]
    assert before.library.provenance["bags"] == ["a"]
    assert after.chosen == before.chosen and after.preprocessing == before.preprocessing


@pytest.mark.slow
def test_priors_over_tasks_survive_and_a_new_task_takes_its_share():
    trained = learn_with_report(recordings(3, 6, n_tasks=2), CUT).trained
    transition = np.array([[0.1, 0.9], [0.7, 0.3], [0.6, 0.4]])
    library = replace(trained.library, transition_prior=transition, task_prior=np.array([0.2, 0.8]))
    coupling = ResidualCoupling(np.ones((2, 2, 3)), np.full((2, 2), 0.5), np.array([2.0, 3.0]))
    regression = PoseRegression(*(np.full((2, 1), 1.0 + part) for part in range(6)))
    library = replace(library, coupling=coupling, pose_regression=regression)
    trained = replace(trained, library=library)
    same = add_demonstration(trained, recordings(3, 7, n_tasks=2)[-1])
    assert np.array_equal(same.library.transition_prior, transition)
    new = replace(recordings(3, 1)[0], task="a new one", name="new")
    more = add_demonstration(trained, new).library
    assert more.labels == ("a new one", "task_0", "task_1")
    np.testing.assert_allclose(more.task_prior, [1 / 3, 0.2 * 2 / 3, 0.8 * 2 / 3])
    np.testing.assert_allclose(more.transition_prior.sum(axis=1), 1.0)
    np.testing.assert_allclose(more.transition_prior[1:, 1:], transition * 2 / 3)
    assert more.coupling.decay_s.tolist()[1:] == [2.0, 3.0] and not more.coupling.gain[0].any()
    assert np.all(more.coupling.gain[1:] == 1.0) and np.all(more.coupling.explained[1:] == 0.5)
    first = PoseRegression(0.0, 1.0, 0.0, 1.0, 0.0, 0.0)
    for before, part, new in zip(regression, more.pose_regression, first, strict=True):
        assert part.ravel().tolist() == [new, *before.ravel()]


@pytest.mark.slow
def test_what_cannot_be_added_is_refused_by_name_and_reason(report):
    trained = report.trained
    one = replace(recordings(6, 1)[0], name="odd")
    with pytest.raises(TrainingError, match="odd: it has no label"):
        add_demonstration(trained, replace(one, task=None))
    with pytest.raises(TrainingError, match="odd: the label 'none' is reserved"):
        add_demonstration(trained, replace(one, task="none"))
    with pytest.raises(TrainingError, match="odd: DOFs: expected those of demo_00"):
        add_demonstration(trained, replace(one, observed=one.observed[:1]))
    with pytest.raises(TrainingError, match=r"odd: movement: expected at least 0\.2 s"):
        add_demonstration(trained, replace(one, end_ns=one.start_ns + 1))


@pytest.mark.parametrize("task", ["task_0", "a new one"])
def test_examples_that_are_not_aligned_are_no_part_of_aligned_primitives(task):
    gathered = accumulate(recordings(1, 6), CUT)
    chosen, settled = Hyperparameters("aligned"), gathered.preprocessing
    library = library_from_statistics(gathered.tasks, settled, chosen)
    one = example_of(recordings(2, 1)[0], settled)._replace(task=task, aligned=None)
    with pytest.raises(ArgumentError, match=f"tasks: .*aligned.*others of {task}.*example_of"):
        add_statistics(Trained(library, settled, gathered.tasks, chosen), {task: summarize([one])})


@pytest.mark.slow
def test_parts_gathered_apart_with_one_preprocessing_are_the_whole():
    """As by processes that read a share of the bags each."""
    demonstrations = recordings(8, 25)
    whole = accumulate(demonstrations, CUT)
    parts = [
        accumulate(demonstrations[k : k + 7], CUT, whole.preprocessing) for k in range(0, 25, 7)
    ]
    merged = reduce(merge_accumulated, parts)
    assert_equal(learn_accumulated(merged).library, learn_accumulated(whole).library, 1e-9)
    assert merged.used == whole.used and merged.n_used == 25
    demonstrations = recordings(10, 12)
    parts = [accumulate(demonstrations[:6], CUT), accumulate(demonstrations[6:], CUT)]
    with pytest.raises(TrainingError, match="Accumulate all parts with one preprocessing"):
        merge_accumulated(*parts)


def test_recordings_of_other_dofs_than_most_are_left_out_even_if_they_come_first():
    demonstrations = recordings(14, 6)
    odd = replace(demonstrations[0], observed=demonstrations[0].observed[:1], name="odd")
    found = accumulate([odd, *demonstrations], CUT)
    assert found.used == tuple(f"demo_{i:02d}" for i in range(6))
    assert [name for name, _ in found.rejected] == ["odd"]
    with pytest.raises(TrainingError, match=r"got one of .*; demo_00: DOFs: expected those of odd"):
        learn_with_report([odd, demonstrations[0]], CUT)


def test_a_long_stream_settles_its_preprocessing_by_its_first_recordings_and_names_few(monkeypatch):
    monkeypatch.setattr(accumulation, "REFERENCE_RECORDINGS", 5)
    demonstrations = recordings(11, 20)
    unlabelled = replace(demonstrations[0], task=None, name="unlabelled")
    found = accumulate(iter([unlabelled, *demonstrations]), CUT)
    assert found.preprocessing == accumulate(demonstrations[:5], CUT).preprocessing
    assert found.preprocessing != accumulate(demonstrations, CUT).preprocessing  # of all in a list
    assert found.n_used == 20 and found.used == tuple(f"demo_{i:02d}" for i in range(20))
    assert [name for name, _ in found.rejected] == ["unlabelled"]
    monkeypatch.setattr(accumulation, "NAMES_KEPT", 4)
    bad = [replace(r, task=None) for r in recordings(12, 7)]
    found = accumulate([*recordings(12, 9), *bad], CUT)
    assert (len(found.used), found.n_used) == (4, 9)
    assert (len(found.rejected), found.n_rejected) == (4, 7)


@pytest.mark.slow
def test_hyperparameters_of_very_many_are_chosen_on_a_sample(monkeypatch):
    """Means and covariances are still those of all of them."""
    whole = accumulate(recordings(13, 30), CUT)
    monkeypatch.setattr(statistics, "MAX_EXAMPLES", 4)
    sampled = accumulate(recordings(13, 30), CUT)
    for label, task in sampled.tasks.items():
        assert len(task.examples) == 4 and task.n == 10
        assert np.array_equal(task.mean, whole.tasks[label].mean)
        assert np.array_equal(task.scatter, whole.tasks[label].scatter)
    few, all_ = (
        choose_hyperparameters(one.tasks, one.preprocessing)[0] for one in (sampled, whole)
    )
    assert few.score == pytest.approx(all_.score, abs=0.5)


def stream(n: int):
    """Recordings made when asked for."""
    rng = np.random.default_rng(0)
    return (simulate(TRUTH, k % 2, rng, name=f"demo_{k}", n_samples=60) for k in range(n))


def peak_memory(n: int) -> int:
    tracemalloc.start()
    try:
        accumulate(stream(n), WHOLE)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_number_of_demonstrations(monkeypatch):
    """Of what is gathered, from which then a bounded number is left out."""
    monkeypatch.setattr(statistics, "MAX_EXAMPLES", 5)
    for bound in ("REFERENCE_RECORDINGS", "NAMES_KEPT", "BATCH"):
        monkeypatch.setattr(accumulation, bound, 5)
    peak_memory(20)  # what is loaded and kept the first time
    few, many = peak_memory(20), peak_memory(120)
    (recorded,) = stream(1)
    values = sum(signal.values.nbytes for signal in (*recorded.observed, *recorded.controlled))
    assert many - few < 100 * values  # no recording is kept
