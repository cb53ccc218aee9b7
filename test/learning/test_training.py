# SPDX-License-Identifier: Apache-2.0
"""From recordings to a library: what is recovered, what is refused, what is left out and why."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import START_NS, draw_weights, gathered, make_library, minimum_jerk, simulate

from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.learning import accumulate, make_example
from intent_recognition.learning.training import TrainingSettings, learn, learn_with_report
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.signals import Demonstration, Signal
from intent_recognition.signals.segmentation import END_MARGIN_S

WHOLE = TrainingSettings(n_basis=8, n_aligned_basis=8, segmentation="recording")
CUT = TrainingSettings(n_basis=8, n_aligned_basis=8)


def recordings(truth, rng, n_each: int, **options) -> list[Demonstration]:
    return [
        simulate(truth, task, rng, name=f"{task}_{i}", **options)
        for task in range(truth.n_tasks)
        for i in range(n_each)
    ]


@pytest.fixture(scope="module")
def truth():
    return make_library(np.random.default_rng(11), n_tasks=2, groups=(2, 1), n_basis=8)


def test_weights_of_an_example_are_those_it_was_simulated_with(truth, rng):
    w = draw_weights(truth, 0, rng)
    quiet = replace(truth, noise_variance=np.full(5, 1e-12))
    recording = simulate(quiet, 0, rng, weights=w, rate_hz=200.0, duration_s=1.7)
    recording = replace(recording, start_ns=START_NS, end_ns=START_NS + 1_700_000_000)
    example = make_example(recording, truth.basis, 1e-9)
    np.testing.assert_allclose(example.weights, w, atol=2e-3)
    assert example.duration_s == pytest.approx(1.7)
    phase = (np.arange(60) + 0.5) / 60
    expected = truth.basis.design_matrix(phase) @ w[:3].T
    np.testing.assert_allclose(example.observed, expected, atol=1e-3)
    expected = truth.basis.design_matrix(np.linspace(0, 1, 58)) @ w[3:].T
    np.testing.assert_allclose(example.controlled, expected, atol=2e-2)


@pytest.mark.slow
def test_what_was_simulated_is_learned_back(truth, rng):
    """200 demonstrations a task: means, covariance, noise, timing."""
    report = learn_with_report(recordings(truth, rng, 200, n_samples=60), WHOLE)
    library = report.library
    assert library.labels == truth.labels
    assert library.observed_names == truth.observed_names
    assert library.observed_groups == (2, 1)
    assert library.observed_units == ("m",) * 3
    assert library.controlled_units == ("rad",) * 2
    assert len(report.used) == 400
    assert report.rejected == ()
    design = truth.basis.design_matrix(np.linspace(0, 1, 15))
    for task in range(2):
        H = np.kron(np.eye(5), design)
        error = H @ (library.weight_mean[task] - truth.weight_mean[task])
        spread = H @ truth.weight_covariance[task] @ H.T
        assert np.abs(error).max() < 5 * np.sqrt(np.diag(spread).max() / 200)
        found = H @ library.weight_covariance[task] @ H.T
        assert np.linalg.norm(found - spread) < 0.3 * np.linalg.norm(spread)
        assert np.linalg.eigvalsh(library.weight_covariance[task]).min() > 0
    np.testing.assert_allclose(np.sqrt(library.noise_variance), 0.005, rtol=0.2)
    np.testing.assert_allclose(library.log_duration_mean, truth.log_duration_mean, atol=0.05)
    np.testing.assert_allclose(library.log_duration_std, truth.log_duration_std, rtol=0.15)
    assert library.n_demonstrations.tolist() == [200, 200]
    assert library.provenance["settings"]["n_basis"] == 8


@pytest.mark.slow
def test_identical_demonstrations_and_a_single_one_of_a_task_train(truth, rng):
    one, other = simulate(truth, 0, rng, duration_s=2.0), simulate(truth, 1, rng)
    library = learn([one, replace(one, name="again"), replace(one, name="third")], WHOLE)
    with_another = learn([one, replace(one, name="again"), other], WHOLE)
    for of_some in (library, with_another):
        for covariance in (*of_some.weight_covariance, *of_some.observed_covariance):  # and of none
            assert np.array_equal(covariance, covariance.T)
            assert np.linalg.eigvalsh(covariance).min() > 0
    assert np.all(np.isfinite(library.regressions[0].matrix))
    assert np.isfinite(library.provenance["chosen"]["score"])
    assert library.log_duration_std == pytest.approx([0.05])


def test_durations_vary_as_in_their_task_and_four_demonstrations_of_all_tasks(truth, rng):
    trained = gathered(recordings(truth, rng, 3), WHOLE)
    logs = np.log([[e.duration_s for e in task.examples] for task in trained.tasks.values()])
    squares = 3.0 * np.var(logs, axis=1)
    expected = (squares + 4.0 * squares.sum() / 4.0) / (2.0 + 4.0) * (1.0 + 1.0 / 3.0)
    np.testing.assert_allclose(trained.library.log_duration_std**2, expected)


@pytest.mark.slow
@pytest.mark.parametrize("level", [0.2, -3.0])
def test_a_signal_that_never_moves_is_learned_from(level):
    """However far from zero: regression leaves rounding about it, which is no variance."""
    rng, demonstrations = np.random.default_rng(3), []
    times_s = np.linspace(0.0, 2.0, 200)
    reach = minimum_jerk(times_s / 1.5)
    for k in range(4):
        side = rng.normal((-1.0) ** k, 0.05)
        human = np.stack([side * reach, np.full(200, level), np.full(200, 5 * level)], axis=1)
        made = Demonstration.from_arrays(
            times_s, human, side * reach[:, None], task=f"{k % 2}", name=f"{k}"
        )
        demonstrations.append(made)
    library = learn(demonstrations, WHOLE)
    assert np.all(library.noise_variance[1:3] == pytest.approx(1e-6))
    assert np.isfinite(library.provenance["chosen"]["score"])


def test_neither_order_rate_length_nor_rest_matters(truth, rng):
    examples = [
        simulate(truth, i % 2, rng, name=f"d{i}", rate_hz=rate, duration_s=duration)
        for i, (rate, duration) in enumerate([(30, 1.0), (60, 2.0), (120, 3.0), (50, 4.0)] * 2)
    ]
    one, other = (gathered(some, WHOLE).library for some in (examples, examples[::-1]))
    np.testing.assert_allclose(one.weight_mean, other.weight_mean, atol=1e-9)
    np.testing.assert_allclose(one.weight_covariance, other.weight_covariance, atol=1e-9)
    np.testing.assert_allclose(one.log_duration_std, other.log_duration_std)
    truth = make_library(rng, n_tasks=2, n_basis=8, spread=0.02, noise_std=0.0005)
    examples = recordings(truth, rng, 8, rest_before_s=1.0, rest_after_s=1.5, duration_s=2.0)
    cut, whole = (gathered(examples, settings).library for settings in (CUT, WHOLE))
    np.testing.assert_allclose(whole.durations_s, 4.5, rtol=0.02)
    np.testing.assert_allclose(cut.durations_s, 2.0 + END_MARGIN_S, rtol=0.15)


def test_unusable_recordings_are_left_out_by_name_and_reason(truth, rng):
    good = recordings(truth, rng, 3)
    short = simulate(truth, 0, rng, name="short", duration_s=0.1)
    sparse = simulate(truth, 0, rng, name="sparse", n_samples=3, duration_s=2.0)
    unlabelled = replace(simulate(truth, 0, rng, name="unlabelled"), task=None)
    reserved = replace(simulate(truth, 0, rng, name="reserved"), task="none")
    found = accumulate([short, *good, sparse, unlabelled, reserved], WHOLE)
    reasons = dict(found.rejected)
    assert set(reasons) == {"short", "sparse", "unlabelled", "reserved"}
    assert "at least 0.2 s" in reasons["short"]
    assert "at least 4 samples" in reasons["sparse"]
    assert "human_0, human_1" in reasons["sparse"]
    assert "no label" in reasons["unlabelled"]
    assert "reserved" in reasons["reserved"]
    assert len(found.used) == 6
    assert tuple(found.tasks) == truth.labels
    other = simulate(truth, 0, rng, name="other")
    stranger = Signal(("foot", "knee"), other.observed[0].stamps_ns, other.observed[0].values, "m")
    other = replace(other, observed=(stranger, other.observed[1]))
    ((name, reason),) = accumulate([*recordings(truth, rng, 3), other], WHOLE).rejected
    assert name == "other" and "foot" in reason
    one = simulate(truth, 0, rng, name="silent")
    empty = Signal(one.observed[1].names, [], np.zeros((0, 1)), "m")
    silent = replace(one, observed=(one.observed[0], empty))
    for settings in (WHOLE, CUT):
        assert [name for name, _ in accumulate([silent, *good], settings).rejected] == ["silent"]


def test_nothing_to_learn_from_is_an_error_that_says_why(truth, rng):
    with pytest.raises(TrainingError, match=r"demonstrations: .*none of 0.*Check where"):
        learn([], WHOLE)
    with pytest.raises(TrainingError, match=r"none of 1; demo: it has no label .*Check the DOFs"):
        learn([replace(simulate(truth, 0, rng), task=None)], WHOLE)
    with pytest.raises(TrainingError, match=r"no controlled degrees of freedom: add an entry"):
        learn([replace(simulate(truth, 0, rng), controlled=()) for _ in range(2)], WHOLE)
    with pytest.raises(TrainingError, match=r"one of task_0, task_1\. Record more"):
        learn(recordings(truth, rng, 1), WHOLE)
    one = simulate(truth, 0, rng)
    with pytest.raises(ArgumentError, match=r"a list of Demonstration, .* Put it into a list"):
        learn(one, WHOLE)
    with pytest.raises(ArgumentError, match=r"demonstrations\[1\].*ndarray"):
        learn([one, np.zeros((5, 3))], WHOLE)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"segmentation": "half"}, "segmentation: expected one of .*got half"),
        ({"none_prior": 0.0}, "none_prior: expected a probability"),
        ({"none_prior": 1.0}, "none_prior: expected a probability"),
        ({"duration_evidence": 0.0}, "duration_evidence: expected an exponent"),
        ({"duration_evidence": 1.1}, "duration_evidence: expected an exponent"),
    ],
)
def test_settings_out_of_range_are_named(options, words):
    with pytest.raises(ArgumentError, match=words):
        TrainingSettings(**options)


@pytest.mark.slow
def test_the_basis_and_the_exponent_of_the_settings_are_used(truth, rng):
    options = replace(WHOLE, n_basis=13, n_aligned_basis=17, width=1.4, duration_evidence=0.37)
    report = learn_with_report(recordings(truth, rng, 2), options)
    n_basis = 17 if report.chosen.aligned else 13
    assert report.library.basis == NormalizedRBFBasis(n_basis, 1.4)
    assert report.library.duration_evidence == 0.37
    preprocessing = report.trained.preprocessing
    assert [preprocessing.basis_of(aligned).n_basis for aligned in (False, True)] == [13, 17]
