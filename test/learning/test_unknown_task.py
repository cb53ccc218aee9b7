# SPDX-License-Identifier: Apache-2.0
"""The hypothesis `none`: its movement, its calibration, and what both do to unknown movements."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulation import make_library, simulate

from intent_recognition.filtering.bank import start_bank
from intent_recognition.filtering.hypotheses import make_hypotheses
from intent_recognition.filtering.movement import MovementFilter
from intent_recognition.gaussian.normal import Gaussian
from intent_recognition.learning import unknown_task
from intent_recognition.learning.movement_evidence import prefix_log_evidence
from intent_recognition.learning.statistics import merge_statistics, summarize
from intent_recognition.learning.training import TrainingSettings, learn, learn_with_report
from intent_recognition.learning.unknown_task import (
    calibrate,
    calibrate_none,
    calibrating_tasks,
    departure,
    is_outdated,
    none_primitive,
)
from intent_recognition.promp.library import IDENTITY_CALIBRATION
from intent_recognition.recognition.posterior import read_factor, task_posterior
from intent_recognition.signals.observation import merge

WHOLE = TrainingSettings(n_basis=8, segmentation="recording")
seeds = st.integers(0, 2**32 - 1)
factors = st.floats(-1e6, 1e6)


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


def examples_of(report) -> list:
    return [e for task in report.trained.tasks.values() for e in task.examples]


def test_departure_from_statistics_is_that_of_the_demonstrations(report):
    weights = np.array([e.weights[:3] for e in examples_of(report)])
    start = weights[:, :, :1]
    expected = np.mean((weights - start) ** 2, axis=(0, 1)) + np.mean(np.var(start, axis=0))
    assert departure(list(report.trained.tasks.values()), 3) == pytest.approx(expected, rel=1e-9)


def test_departure_does_not_depend_on_how_statistics_were_merged(report):
    (first, *rest) = report.trained.tasks["task_0"].examples
    merged = merge_statistics(summarize([first]), summarize(rest))
    whole = departure([summarize([first, *rest])], 3)
    assert departure([merged], 3) == pytest.approx(whole, rel=1e-9)


@given(seeds, st.integers(1, 6), st.floats(0.01, 10.0))
def test_none_is_positive_definite_and_wider_than_the_tasks(seed, n_tasks, spread):
    rng = np.random.default_rng(seed)
    means = rng.normal(size=(n_tasks, 2, 6)) * spread
    root = rng.normal(size=(n_tasks, 12, 12))
    covariances = root @ np.swapaxes(root, 1, 2)
    none = none_primitive(means, covariances, np.full(6, spread**2))
    assert none.mean == pytest.approx(means.mean(axis=0).ravel())
    assert np.array_equal(none.covariance, none.covariance.T)
    rest = none.covariance - covariances.mean(axis=0)
    assert np.linalg.eigvalsh(rest).min() > -1e-9 * np.abs(rest).max()


@given(st.lists(factors, min_size=2, max_size=20), st.lists(st.floats(0.01, 1.0), min_size=2))
def test_reading_a_factor_is_monotone_and_can_leave_it_alone(values, slopes):
    ordered = np.sort(values)
    calibration = (slopes[0], 3.0, slopes[1], -2.0)
    assert np.all(np.diff(read_factor(ordered, calibration)) >= -1e-9 * np.abs(ordered).max())
    assert read_factor(ordered, IDENTITY_CALIBRATION) == pytest.approx(
        ordered, rel=1e-12, abs=1e-12
    )


def test_a_factor_between_the_thresholds_counts_next_to_nothing():
    calibration = (1.0, 20.0, 0.5, -30.0)
    assert np.all(np.abs(read_factor(np.linspace(-15.0, 10.0, 20), calibration)) < 1e-3)
    assert read_factor(50.0, calibration) == pytest.approx(30.0)
    assert read_factor(-50.0, calibration) == pytest.approx(-10.0, rel=1e-3)


def test_calibration_by_hand():
    unknown = np.array([[0.0, 1.0, -5.0], [0.0, 3.0, -9.0], [0.0, 2.0, -1.0]])
    known = np.array([[0.0, -4.0, 9.0], [-2.0, 0.0, 8.0], [-6.0, 2.0, 4.0]])
    a, b, c, d = calibrate(known, unknown)
    assert (a, b) == pytest.approx((1.0, 2.0 + 2.0 * 1.0))
    assert (c, d) == pytest.approx((1.0, -4.0 - 2.0 * 2.0))
    assert calibrate(10.0 * known, unknown)[2] == pytest.approx(2.373 / 20.0)
    long_tail = np.r_[np.zeros(90), -np.arange(1.0, 11.0)][:, None]
    lower = calibrate(long_tail, unknown)[3]
    assert -5.5 * np.log(20.0) - 1.0 < lower < -10.0
    assert tuple(calibrate(np.zeros((0,)), np.zeros((0,)))) == IDENTITY_CALIBRATION


def test_prefix_evidence_equals_conditioning_sample_by_sample(recordings, report):
    library = report.library
    recorded, task = recordings[1], 1
    hypotheses = make_hypotheses(library)
    run = MovementFilter(
        library, hypotheses, recorded.start_ns, initial=start_bank(library, hypotheses)
    )
    stepwise, times, values = [], [], []
    for observation in list(merge(recorded.observed))[:25]:
        run.observe(observation)
        times.append((observation.stamp_ns - recorded.start_ns) * 1e-9)
        values.append(observation.values)
        plain = hypotheses._replace(none_calibration=IDENTITY_CALIBRATION)
        stepwise.append(task_posterior(run.bank.log_evidence, plain, times[-1]).log_evidence)
    stepwise = np.array(stepwise)
    for number, primitive, timing in (
        (
            task,
            Gaussian(library.observed_mean[task], library.observed_covariance[task]),
            np.array([library.log_duration_mean[task], library.log_duration_std[task]]),
        ),
        (-1, Gaussian(library.none_mean, library.none_covariance), library.none_log_duration),
    ):
        batch = prefix_log_evidence(library, primitive, timing, np.array(times), np.array(values))
        assert batch == pytest.approx(stepwise[:, number], rel=1e-8, abs=1e-8)


def test_the_calibration_leaves_the_tasks_among_themselves_alone(recordings, report):
    library = report.library
    recorded = recordings[2]
    posteriors = []
    for one in (library, replace(library, none_calibration=IDENTITY_CALIBRATION)):
        hypotheses = make_hypotheses(one)
        run = MovementFilter(
            one, hypotheses, recorded.start_ns, initial=start_bank(one, hypotheses)
        )
        for observation in list(merge(recorded.observed))[:6]:
            run.observe(observation)
        posteriors.append(task_posterior(run.bank.log_evidence, hypotheses, 0.5))
    ours, plain = posteriors
    assert np.array_equal(ours.log_evidence[:-1], plain.log_evidence[:-1])
    assert ours.log_evidence[-1] != plain.log_evidence[-1]
    prior = np.r_[library.task_prior * (1 - library.none_prior), library.none_prior]
    joint = np.log(prior) + ours.log_evidence
    expected = np.exp(joint - np.logaddexp.reduce(joint))
    assert ours.probabilities == pytest.approx(expected, abs=1e-12)
    assert abs(ours.probabilities.sum() - 1.0) < 1e-12


@pytest.mark.slow
def test_movements_of_a_task_left_out_reach_less_than_known_ones(recordings):
    """Every task in turn is left out; most of its movements stay below the threshold."""
    known, unknown = [], []
    for left_out in {r.task for r in recordings}:
        library = learn([r for r in recordings if r.task != left_out], WHOLE)
        hypotheses = make_hypotheses(library)
        for recorded in recordings:
            run = MovementFilter(
                library, hypotheses, recorded.start_ns, initial=start_bank(library, hypotheses)
            )
            highest = 0.0
            for observation in merge(recorded.observed):
                run.observe(observation)
                elapsed = (observation.stamp_ns - recorded.start_ns) * 1e-9
                posterior = task_posterior(run.bank.log_evidence, hypotheses, elapsed)
                highest = max(highest, posterior.probabilities[:-1].max())
            (unknown if recorded.task == left_out else known).append(highest)
    assert np.mean(np.array(known) >= 0.9) >= 0.95
    assert np.mean(np.array(unknown) < 0.9) >= 0.6
    assert np.mean(np.array(known)[:, None] > np.array(unknown)) >= 0.97


def test_one_task_alone_has_a_none_too(recordings):
    only = [r for r in recordings if r.task == "task_0"]
    library = learn(only, WHOLE)
    assert np.linalg.eigvalsh(library.none_covariance).min() > 0
    assert library.none_calibration[1] > 0.0
    assert np.array_equal(learn(only, WHOLE).none_calibration, library.none_calibration)


def test_tasks_take_part_in_the_calibration_from_five_demonstrations_on():
    assert calibrating_tasks([3, 13, 5, 20]).tolist() == [1, 2, 3]
    assert calibrating_tasks([3, 4, 20]).tolist() == [0, 1, 2]
    assert calibrating_tasks([2]).tolist() == [0]


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


@pytest.mark.slow
def test_a_vague_new_task_does_not_make_the_others_wait(recordings, monkeypatch):
    """Its few demonstrations go everywhere, so that every movement might be one of it."""
    rng = np.random.default_rng(8)
    wide = make_library(rng, n_tasks=1, groups=(3,), n_controlled=1, n_basis=8, spread=1.0)
    vague = [
        replace(simulate(wide, 0, rng, name=f"new_{i}", n_samples=60), task="vague")
        for i in range(3)
    ]
    report = learn_with_report([*recordings, *vague], WHOLE)
    trained = report.trained
    strength = trained.chosen.recognition_strength
    asked = (trained.library, trained.tasks, trained.preprocessing, strength)
    own = calibrate_none(*asked)
    assert np.array_equal(own, trained.library.none_calibration)
    monkeypatch.setattr(unknown_task, "MIN_DEMONSTRATIONS", 1)
    assert own[1] < calibrate_none(*asked)[1]
