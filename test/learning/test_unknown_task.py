# SPDX-License-Identifier: Apache-2.0
"""The hypothesis `none`: its movement, its calibration, and what both do to unknown movements."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulation import make_library, simulate

from intent_recognition.filtering import MovementFilter, make_prior_grid, task_posterior
from intent_recognition.learning import is_outdated, unknown_task
from intent_recognition.learning.examples import SAMPLES_PER_MOVEMENT, sample_phases
from intent_recognition.learning.fitting import library_from_statistics, statistics_of
from intent_recognition.learning.left_out import LeavingOut
from intent_recognition.learning.none_model import Departure, departure, none_primitive
from intent_recognition.learning.statistics import merge_statistics, summarize
from intent_recognition.learning.training import TrainingSettings, learn_with_report, with_margins
from intent_recognition.learning.unknown_task import (
    Comparison,
    calibrating_tasks,
    learn_none_margin,
    log_factors,
    margin_between,
)
from intent_recognition.signals.observation import Observation

WHOLE = TrainingSettings(n_basis=8, n_aligned_basis=8, segmentation="recording")
seeds = st.integers(0, 2**32 - 1)
factors = st.floats(-1e6, 1e6)


pytestmark = pytest.mark.usefixtures("usually_calibrated")


@pytest.fixture(scope="module")
def recordings():
    """Four tasks of three observed DOFs, eight demonstrations each."""
    rng = np.random.default_rng(3)
    truth = make_library(rng, n_tasks=4, groups=(3,), n_controlled=1, n_basis=8, spread=0.05)
    return [simulate(truth, i % 4, rng, name=f"{i:02d}", n_samples=60) for i in range(32)]


@pytest.fixture(scope="module")
def report(recordings):
    """What was learned from them."""
    return learn_with_report(recordings, WHOLE)


class Watched:
    """In place of `log_factors`: which movements it is asked for."""

    def __init__(self):
        self.movements, self.asked = [], []

    def __call__(self, comparisons, _first):
        for *asked, recorded in comparisons:
            self.asked.append(asked)
            self.movements.append(recorded)
        return np.arange(1.0, len(comparisons) + 1.0)[:, None]


def examples_of(report) -> list:
    return [e for task in report.trained.tasks.values() for e in task.examples]


@pytest.mark.slow
def test_departure_is_that_of_the_demonstrations_however_they_were_merged(report):
    weights = np.array([e.weights[:3] for e in examples_of(report)])
    start = weights[:, :, :1]
    expected = np.mean((weights - start) ** 2, axis=(0, 1)) + np.mean(np.var(start, axis=0))
    assert departure(list(report.trained.tasks.values()), np.arange(3)) == pytest.approx(
        expected, rel=1e-9
    )
    (first, *rest) = report.trained.tasks["task_0"].examples
    merged = merge_statistics(summarize([first]), summarize(rest))
    whole = departure([summarize([first, *rest])], np.arange(3))
    assert departure([merged], np.arange(3)) == pytest.approx(whole, rel=1e-9)


@given(seeds, st.integers(1, 6), st.floats(0.01, 10.0))
def test_none_is_positive_definite_and_wider_than_the_tasks(seed, n_tasks, spread):
    rng = np.random.default_rng(seed)
    means = rng.normal(size=(n_tasks, 2, 6)) * spread
    root = rng.normal(size=(n_tasks, 12, 12))
    covariances = root @ np.swapaxes(root, 1, 2)
    none = none_primitive(means, covariances, [Departure(np.arange(2), np.full(6, spread**2))])
    assert none.mean == pytest.approx(means.mean(axis=0).ravel())
    assert np.array_equal(none.covariance, none.covariance.T)
    rest = none.covariance - covariances.mean(axis=0)
    assert np.linalg.eigvalsh(rest).min() > -1e-9 * np.abs(rest).max()


NOTHING = np.zeros(0)


def test_unknown_movements_stay_below_their_conformal_quantile():
    """The highest of 19, the second of 39; fewer are extrapolated, of fewer than two nothing."""
    values = np.random.default_rng(1).permutation(np.arange(1.0, 60.0))
    for n in range(19, 60):
        rank = -(-19 * (n + 1) // 20)
        assert margin_between(values[:n], NOTHING) == np.sort(values[:n])[rank - 1]
    assert margin_between(np.arange(19.0), NOTHING) == 18.0
    assert margin_between(np.arange(39.0), NOTHING) == 37.0
    extrapolated = 2.0 + 1.6448536 * np.sqrt(2.0)
    assert margin_between(np.array([1.0, 3.0]), NOTHING) == pytest.approx(extrapolated)
    assert margin_between(np.array([5.0]), NOTHING) == margin_between(NOTHING, NOTHING) == 0.0


def test_a_gap_is_shared_in_halves_by_tasks_of_five_demonstrations():
    unknown = np.arange(19.0)  # below 18
    known = np.linspace(40.0, 60.0, 21)  # 5 % of them below 41
    assert margin_between(unknown, known) == pytest.approx(0.5 * (18.0 + 41.0))
    assert margin_between(unknown, known - 30.0) == 18.0  # no gap: unknown movements decide
    assert margin_between(unknown, known - 40.0) == 10.0  # half of the known ones are acted on
    assert margin_between(unknown - 100.0, known - 200.0) == 0.0
    assert margin_between(unknown, known[:1]) == 18.0
    assert calibrating_tasks([3, 13, 5, 20]).tolist() == [1, 2, 3]
    assert calibrating_tasks([3, 4, 20]).tolist() == [0, 1, 2]
    assert calibrating_tasks([2]).tolist() == [0]


@pytest.mark.parametrize(("exponent", "first"), [(0.0, 0), (0.7, 0), (0.7, 4)])
def test_factors_are_those_of_a_filter_with_as_many_durations(report, exponent, first):
    tasks = statistics_of(report.trained.tasks, report.chosen.aligned)
    library = replace(report.library, correlation_time_s=2.4 / SAMPLES_PER_MOVEMENT)
    usual = np.r_[library.log_duration_mean + [0.3, 0.1, 0.0, 0.0], library.none_log_duration[0]]
    bent = replace(library.phase_deviation, duration_exponent=exponent)
    library = replace(library, usual_log_duration=usual, phase_deviation=bent)
    recorded = examples_of(report)[3]._replace(duration_s=2.4)
    whole = LeavingOut(library, tasks).nothing()
    asked = Comparison(whole, np.arange(library.n_tasks), library.n_tasks, recorded)
    (found,) = log_factors([asked], first)
    hypotheses = make_prior_grid(library, n_scales=unknown_task.N_SCALES)
    run, expected = MovementFilter(library, hypotheses, 0), []
    seen = zip(sample_phases()[first:], recorded.observed[first:], strict=True)
    for k, (phase, values) in enumerate(seen):
        also = None if k else library.noise_covariance(np.arange(library.n_observed), np.inf)
        run.observe(Observation(round(phase * 2.4e9), 0, values, also))
        plain = hypotheses._replace(none_margin=0.0, duration_evidence=1.0)
        evidence = task_posterior(run.log_evidence, plain, phase * 2.4).log_evidence
        expected.append(np.logaddexp.reduce(evidence[:-1]) - np.log(4) - evidence[-1])
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("most_floats", [2**23, 15 * 24**2, 1])
def test_factors_do_not_depend_on_what_is_filtered_together(report, monkeypatch, most_floats):
    """Tasks, their number and the library differ; all fit, or two, or none."""
    watched = Watched()
    monkeypatch.setattr(unknown_task, "log_factors", watched)
    tasks = statistics_of(report.trained.tasks, report.chosen.aligned)
    learn_none_margin(LeavingOut(report.library, tasks), report.trained.tasks)
    monkeypatch.undo()
    asked = zip(watched.asked[:6], watched.movements[:6], strict=True)
    comparisons = [Comparison(*one, recorded) for one, recorded in asked]
    comparisons[1] = comparisons[1]._replace(compared=np.array([2]))
    alone = [log_factors([one])[0] for one in comparisons]
    monkeypatch.setattr(unknown_task, "MAX_FLOATS", most_floats)
    together = log_factors(comparisons)
    np.testing.assert_allclose(together, alone, rtol=1e-9, atol=1e-9)
    assert len({float(factors.max()) for factors in together}) == 6


def asked_for_each(report, monkeypatch, label):
    """What `log_factors` is asked for each movement of a task, two by two; the margin, too."""
    trained = report.trained
    monkeypatch.setattr(unknown_task, "log_factors", watched := Watched())
    tasks = statistics_of(trained.tasks, trained.chosen.aligned)
    margin = learn_none_margin(LeavingOut(trained.library, tasks), trained.tasks)
    turns = zip(watched.movements, watched.asked, strict=True)
    own = [(movement, *asked) for movement, asked in turns if movement.task == label]
    assert len(own) == 16
    return own[::2], own[1::2], margin


@pytest.mark.parametrize("label", ["task_0", "task_2"])
def test_a_movement_is_unknown_to_a_library_that_never_saw_its_task(report, monkeypatch, label):
    """None and covariance are those learned without the task; only other tasks are compared."""
    trained = report.trained
    unknown, _, _ = asked_for_each(report, monkeypatch, label)
    kept = {name: task for name, task in trained.tasks.items() if name != label}
    anew = library_from_statistics(kept, trained.preprocessing, trained.chosen)
    k = trained.library.labels.index(label)
    for _, without, compared, n_tasks in unknown:
        assert sorted(compared) == [j for j in range(4) if j != k] and n_tasks == 3
        np.testing.assert_allclose(without.none.mean, anew.none_mean, atol=1e-10)
        np.testing.assert_allclose(without.none.covariance, anew.none_covariance, atol=1e-10)
        shared = anew.observed_covariance[0] / (1.0 + 1.0 / 8.0)
        np.testing.assert_allclose(without.covariance, shared, atol=1e-10)
        others = [j for j in range(4) if j != k]
        np.testing.assert_allclose(without.mean[others], anew.observed_mean[:-1], atol=1e-12)


def test_a_known_movement_is_compared_with_its_task_as_the_others_give_it(report, monkeypatch):
    trained, label = report.trained, "task_1"
    _, known, _ = asked_for_each(report, monkeypatch, label)
    for movement, without, compared, n_tasks in known:
        assert sorted(compared) == [0, 1, 2, 3] and n_tasks == 4
        task = trained.tasks[label]
        rest = summarize([e for e in task.examples if e.name != movement.name])
        kept = {**trained.tasks, label: rest}
        anew = library_from_statistics(kept, trained.preprocessing, trained.chosen)
        np.testing.assert_allclose(without.mean, anew.observed_mean[:-1], atol=1e-10)
        assert without.n.tolist() == anew.n_demonstrations.tolist() == [8, 7, 8, 8]
        shared = anew.observed_covariance[1] / (1.0 + 1.0 / 7.0)
        np.testing.assert_allclose(without.covariance, shared, atol=1e-6)


def test_the_margin_lies_between_both_kinds(report, monkeypatch):
    _, _, margin = asked_for_each(report, monkeypatch, "task_0")
    unknown, known = np.arange(1.0, 65.0, 2), np.arange(2.0, 65.0, 2)  # as `Watched` counts
    assert margin == margin_between(unknown, known)


@pytest.mark.slow
def test_the_margins_of_a_library_are_those_of_its_statistics(report):
    trained = report.trained
    tasks = statistics_of(trained.tasks, trained.chosen.aligned)
    other = replace(trained.library, none_margin=1e3, none_mean=0.0 * trained.library.none_mean)
    assert learn_none_margin(LeavingOut(other, tasks), trained.tasks) == trained.library.none_margin
    anew = with_margins(replace(trained, library=other)).library
    assert anew.none_margin == trained.library.none_margin
    late = learn_none_margin(LeavingOut(other, tasks), trained.tasks, since=0.06)
    assert anew.stop_margin == trained.library.stop_margin == late != anew.none_margin


@pytest.fixture(scope="module")
def alone(recordings):
    """What was learned from the movements of one task."""
    return learn_with_report([r for r in recordings if r.task == "task_0"], WHOLE).trained


@pytest.mark.slow
def test_one_task_alone_has_a_none_from_which_movements_are_drawn(alone, monkeypatch):
    library = alone.library
    assert np.linalg.eigvalsh(library.none_covariance).min() > 0
    assert library.none_margin >= 0.0
    assert with_margins(alone).library.none_margin == library.none_margin
    monkeypatch.setattr(unknown_task, "log_factors", watched := Watched())
    tasks = statistics_of(alone.tasks, alone.chosen.aligned)
    learn_none_margin(LeavingOut(library, tasks), alone.tasks)
    drawn = [movement for movement in watched.movements if not movement.task]
    assert len(drawn) == unknown_task.N_SIMULATED
    assert len({movement.duration_s for movement in drawn}) == len(drawn)
    assert len(watched.movements) - len(drawn) == 8  # the known ones


@pytest.mark.parametrize(
    ("before", "now", "outdated"),
    [
        ({"a": 2}, {"a": 3}, True),
        ({"a": 3, "b": 3}, {"a": 3, "b": 3, "c": 1}, True),
        ({"a": 13, "b": 9}, {"a": 13, "b": 9, "c": 1}, False),
        ({"a": 13, "b": 9, "c": 3}, {"a": 13, "b": 9, "c": 4}, False),
        ({"a": 13, "b": 9, "c": 4}, {"a": 13, "b": 9, "c": 5}, True),
        ({"a": 13, "b": 9}, {"a": 13, "b": 10}, True),
        ({"a": 13, "b": 10}, {"a": 14, "b": 11}, False),
    ],
)
def test_calibrated_again_while_those_who_take_part_are_few(before, now, outdated):
    assert is_outdated(before, now) is outdated


def test_a_new_task_of_few_demonstrations_does_not_make_the_others_wait(report, monkeypatch):
    """Nothing is concluded from its movements, nor from how they compare with others."""
    trained = report.trained
    few = [e._replace(task="few") for e in trained.tasks["task_0"].examples[:3]]
    tasks = {"few": summarize(few), **trained.tasks}
    library = library_from_statistics(tasks, trained.preprocessing, trained.chosen)
    monkeypatch.setattr(unknown_task, "log_factors", watched := Watched())
    learn_none_margin(LeavingOut(library, statistics_of(tasks, trained.chosen.aligned)), tasks)
    assert {movement.task for movement in watched.movements} == {f"task_{k}" for k in range(4)}
    assert all(0 not in compared for _, compared, _ in watched.asked)  # "few" comes first
