# SPDX-License-Identifier: Apache-2.0
"""Evaluation on data whose scores are known, and its JSON as the contract has it."""

import json
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from simulation import START_NS, demonstration_of, gathered, make_library, minimum_jerk, simulate

from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.evaluation import evaluate, make_folds, remarks_on
from intent_recognition.evaluation.reactive import NearestWindows
from intent_recognition.evaluation.scores import ScoreTable, per_unit
from intent_recognition.evaluation.scoring import (
    PREDICTION_FRACTIONS,
    RECOGNITION_FRACTIONS,
    EvaluationRecords,
    score_demonstration,
)
from intent_recognition.learning import Hyperparameters, accumulate, library_from_statistics
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.promp import STEADY, TaskLibrary
from intent_recognition.signals import Demonstration, Signal, numbered

SETTINGS = TrainingSettings(n_basis=8, n_aligned_basis=8, segmentation="recording")
PREDICTION_KEYS = {
    "rmse", "rmse_inferred_task", "rmse_future", "rmse_mean_of_task", "rmse_nearest_neighbour",
    "end_rmse", "coverage_2_sigma", "nll",
}  # fmt: skip


def exact(
    name: str, task: str, goal: float, duration_s: float = 2.0, shift: float = 0.0
) -> Demonstration:
    """The same movement every time: human to `goal`, robot to minus twice the goal."""
    times = np.linspace(0.0, duration_s, 101)
    share = minimum_jerk(times / duration_s)[:, None]
    return demonstration_of(times, goal * share + shift, -2.0 * goal * share + shift, name, task)


IDENTICAL = [
    exact(f"{task}{i}", task, goal) for i in range(3) for task, goal in (("a", 0.3), ("b", -0.3))
]


def some(n: int) -> list[Demonstration]:
    """So many recordings, whatever they show."""
    return [replace(IDENTICAL[i % 6], name=f"{i:02d}") for i in range(n)]


@pytest.fixture(scope="module")
def identical() -> dict:
    return evaluate(IDENTICAL, make_folds(some(6), "loo"), SETTINGS)


def numbers(tree) -> list:
    return [x for v in tree.values() for x in (numbers(v) if isinstance(v, dict) else [v])]


def test_the_json_is_the_contracts_with_a_number_everywhere_but_after_the_end(identical):
    again = json.loads(json.dumps(identical, allow_nan=False))
    assert again == identical
    told = "n_demonstrations tasks unit segment recognition prediction reactive left_out doubtful"
    more = "reliability coverage confusion mistaken none"
    assert set(identical) == {*told.split(), *more.split()}
    assert identical["n_demonstrations"] == 6
    assert identical["tasks"] == ["a", "b"]
    assert identical["unit"] == "rad"
    assert identical["segment"] == "recording"
    assert identical["mistaken"] == []
    for room, fractions, keys in (
        ("recognition", RECOGNITION_FRACTIONS, {"accuracy", "log_loss"}),
        ("prediction", PREDICTION_FRACTIONS, PREDICTION_KEYS),
    ):
        assert set(identical[room]) == {"known_phase", "unknown_phase"}
        for table in identical[room].values():
            assert list(table) == [str(fraction) for fraction in fractions]
            assert all(set(row) == keys for row in table.values())
    assert set(identical["reactive"]) == {"a", "b"}
    for table in identical["reactive"].values():
        assert list(table) == ["0.0", "0.25", "0.5", "1.0"]
        for row in table.values():
            assert set(row) == {"mse", "mse_nearest_windows", "mse_last_pose"}
            assert 0.0 <= row["mse"] < row["mse_last_pose"]
    for phase in ("known_phase", "unknown_phase"):
        table = again["prediction"][phase]
        assert table["1.0"]["rmse_future"] is None
        table["1.0"]["rmse_future"] = 0.0
        assert all(np.isfinite(value) for row in table.values() for value in row.values())


@pytest.mark.slow
def test_baselines_of_a_shifted_demonstration():
    """Three are predicted from two alike and one off by 0.4, that one from three alike."""
    four = [exact(f"d{i}", "a", 0.3, shift=0.4 * (i == 3)) for i in range(4)]
    found = evaluate(four, make_folds(some(4), "loo"), SETTINGS, unknown_tasks=False)
    row = found["prediction"]["known_phase"]["0.5"]
    assert row["rmse_mean_of_task"] == pytest.approx((3 * 0.4 / 3 + 0.4) / 4, rel=1e-9)
    assert row["rmse_nearest_neighbour"] == pytest.approx(0.4 / 4, rel=1e-9)


@pytest.mark.slow
def test_several_units_give_one_number_each_in_their_own_unit():
    def with_hand(recording: Demonstration, factor: float) -> Demonstration:
        own = recording.controlled[0]
        hand = Signal(("hx", "hy"), own.stamps_ns, np.repeat(own.values, 2, axis=1) * factor, "m")
        return replace(recording, controlled=(own, hand))

    rng = np.random.default_rng(0)
    noisy = [exact(f"d{i}", "a", 0.3 + 0.05 * rng.normal()) for i in range(5)]
    result = evaluate([with_hand(r, 10.0) for r in noisy], make_folds(some(5), "loo")[:2], SETTINGS)
    assert result["unit"] == ["rad", "m"]
    for phase in ("known_phase", "unknown_phase"):
        row = result["prediction"][phase]["0.5"]
        for key in PREDICTION_KEYS:
            assert set(row[key]) == {"rad", "m"}
        for key in ("rmse_mean_of_task", "rmse_nearest_neighbour"):
            assert row[key]["m"] == pytest.approx(10.0 * row[key]["rad"], rel=1e-9)
        assert row["rmse"]["m"] == pytest.approx(10.0 * row["rmse"]["rad"], rel=0.1)
    assert result["prediction"]["known_phase"]["1.0"]["rmse_future"] == {"rad": None, "m": None}
    assert set(result["recognition"]["known_phase"]["0.5"]) == {"accuracy", "log_loss"}
    json.dumps(result, allow_nan=False)


def test_scores_by_hand_are_means_over_the_dofs_of_a_unit(rng):
    library = replace(
        make_library(rng, n_controlled=3, n_basis=4), controlled_units=("rad", "m", "rad")
    )
    values = np.array([[1.0, 10.0, 3.0], [3.0, 20.0, 5.0]])
    assert per_unit(library, values).tolist() == [3.0, 15.0]
    assert np.all(np.isnan(per_unit(library, values[:0])))
    scores = ScoreTable()
    scores.add("known_phase", 0.5, rmse=np.array([1.0, 10.0]), accuracy=1.0)
    scores.add("known_phase", 0.5, rmse=np.array([3.0, 30.0]), accuracy=0.0)
    table = scores.table("known_phase", (0.5,), ("rad", "m"), ("rmse", "accuracy"))
    assert table == {"0.5": {"rmse": {"rad": 2.0, "m": 20.0}, "accuracy": 0.5}}


@pytest.mark.slow
def test_percentages_observed_are_of_time_not_of_samples():
    """Nearly all samples lie in the first tenth; half of the time must still reach the middle."""
    truth = [exact(f"{t}{i}", t, g) for i in range(3) for t, g in (("a", 0.3), ("b", -0.3))]
    library = learn(truth, SETTINGS)
    times = np.r_[np.linspace(0.0, 0.2, 400), np.linspace(0.21, 2.0, 20)]
    stamps = START_NS + np.round(times * 1e9).astype(np.int64)
    human = 0.3 * minimum_jerk(times / 2.0)
    human = np.where(times <= 0.9, -human, human)  # like b until 45 % of the time, like a after
    odd = replace(truth[0], observed=(Signal(("x",), stamps, human[:, None], "m"),))
    collected = EvaluationRecords()
    score_demonstration(collected, library, truth, odd, False, NearestWindows(truth))
    table = collected.scores.table("known_phase", RECOGNITION_FRACTIONS, ("rad",), ("accuracy",))
    assert table["0.3"]["accuracy"] == 0.0
    assert table["1.0"]["accuracy"] == 1.0


@pytest.mark.slow
def test_what_comes_after_a_fraction_or_before_the_movement_does_not_change_scores(rng):
    truth = make_library(rng, n_tasks=2, groups=(2,), n_basis=8)
    training = [simulate(truth, i % 2, rng, name=str(i), n_samples=40) for i in range(8)]
    library = gathered(training, SETTINGS).library
    test = simulate(truth, 0, rng, n_samples=41, duration_s=2.0)
    signal = test.observed[0]
    changed = signal.values.copy()
    changed[21:] += 5.0
    other = replace(test, observed=(Signal(signal.names, signal.stamps_ns, changed, "m"),))
    stamps_ns = np.r_[signal.stamps_ns - test.end_ns + test.start_ns - 1, signal.stamps_ns]
    values = np.concatenate([changed + 5.0, signal.values])
    longer = replace(test, observed=(Signal(signal.names, stamps_ns, values, "m"),))
    tables, windows = [], NearestWindows(training)
    for recording in (test, other, longer):
        collected = EvaluationRecords()
        score_demonstration(collected, library, training, recording, False, windows)
        names = tuple(PREDICTION_KEYS - {"rmse_nearest_neighbour"})
        tables.append(
            (
                collected.scores.table("unknown_phase", (0.25, 0.5), ("rad",), names),
                collected.scores.table(
                    "unknown_phase", (0.1, 0.2, 0.3, 0.5), ("rad",), ("accuracy", "log_loss")
                ),
                collected.scores.table("unknown_phase", (1.0,), ("rad",), ("rmse",)),
            )
        )
    assert tables[0][:2] == tables[1][:2]
    assert tables[0][2] != tables[1][2]
    assert tables[0] == tables[2]


@pytest.mark.slow
def test_start_posture_moves_trajectories_and_never_the_recognition(rng):
    """The robot stands elsewhere each time, of which the human's movement tells nothing."""
    recordings = []
    for i in range(12):
        one = exact(f"d{i}", "ab"[i % 2], (0.3, -0.3)[i % 2] + 0.02 * rng.normal())
        robot = one.controlled[0]
        moved = Signal(robot.names, robot.stamps_ns, robot.values + 0.2 * rng.normal(), "rad")
        recordings.append(replace(one, controlled=(moved,)))
    folds = make_folds(some(12), "kfold:3")[:1]
    off, on = (
        evaluate(recordings, folds, SETTINGS, unknown_tasks=False, start_posture=known)
        for known in (False, True)
    )
    assert off["recognition"] == on["recognition"]
    for phase in ("known_phase", "unknown_phase"):
        for fraction in ("0.25", "1.0"):
            with_it, without = (r["prediction"][phase][fraction]["rmse"] for r in (on, off))
            assert with_it < 0.5 * without


def steady_library(recordings: Sequence[Demonstration], settings: TrainingSettings) -> TaskLibrary:
    """Learned at steady progress without phase deviations: one joint Gaussian a task."""
    found = accumulate(recordings, settings)
    assert found.preprocessing is not None
    chosen = Hyperparameters("steady", noise_scale=1.0)
    library = library_from_statistics(found.tasks, found.preprocessing, chosen)
    return replace(library, phase_deviation=STEADY, observed_weight_covariance=None)


@pytest.mark.slow
def test_scores_against_a_loop_written_out(rng, monkeypatch):
    """RMSE, coverage and likelihood at full observation, known phase, one joint Gaussian each."""
    monkeypatch.setattr(
        "intent_recognition.evaluation.protocol.learn_with_report",
        lambda *given: SimpleNamespace(library=steady_library(*given)),
    )
    truth = make_library(rng, n_tasks=1, groups=(1,), n_controlled=2, n_basis=8)
    recordings = [simulate(truth, 0, rng, name=str(i), n_samples=12) for i in range(6)]
    folds = make_folds(some(6), "loo")
    row = evaluate(recordings, folds, SETTINGS)["prediction"]["known_phase"]["1.0"]
    expected = {"rmse": [], "coverage_2_sigma": [], "nll": [], "end_rmse": []}
    for train, (i,) in folds:
        library = steady_library([recordings[k] for k in train], SETTINGS)
        test = recordings[i]
        duration = (test.end_ns - test.start_ns) * 1e-9
        times = test.observed[0].seconds(test.start_ns)
        H = np.hstack([library.basis.design_matrix(times / duration), np.zeros((12, 16))])
        crowding = np.r_[1.0, np.maximum(1.0, library.correlation_time_s / np.diff(times))]
        R = np.diag(library.noise_variance[0] * library.noise_scale * crowding)
        mean, covariance = library.primitive(0).weights
        gain = covariance @ H.T @ np.linalg.inv(H @ covariance @ H.T + R)
        mean = mean + gain @ (test.observed[0].values[:, 0] - H @ mean)
        covariance = covariance - gain @ H @ covariance
        at = np.linspace(0.0, 1.0, 100)
        design = library.basis.design_matrix(at)
        error, std = np.empty((100, 2)), np.empty((100, 2))
        for q in range(2):
            block = slice(8 + 8 * q, 16 + 8 * q)
            own = np.interp(at * duration, times, test.controlled[0].values[:, q])
            error[:, q] = design @ mean[block] - own
            variance = np.diag(design @ covariance[block, block] @ design.T)
            std[:, q] = np.sqrt(variance + library.noise_variance[1 + q])
        expected["rmse"].append(np.sqrt(np.mean(error**2)))
        expected["end_rmse"].append(np.sqrt(np.mean(error[-1] ** 2)))
        expected["coverage_2_sigma"].append(np.mean(np.abs(error) < 2 * std))
        nll = 0.5 * (error / std) ** 2 + np.log(std) + 0.5 * np.log(2 * np.pi)
        expected["nll"].append(np.mean(nll))
    for name, values in expected.items():
        assert row[name] == pytest.approx(np.mean(values), rel=1e-3, abs=1e-9), name


@pytest.mark.slow
def test_wrong_labels_are_named_and_movements_unlike_any_task_scored_without_none():
    wrong = replace(IDENTICAL[0], name="wrong", task="b")
    folds = [([*range(6)], [6])]
    result = evaluate([*IDENTICAL, wrong], folds, SETTINGS, unknown_tasks=False)
    (one,) = (one for one in result["mistaken"] if one["recording"] == "wrong")
    assert one == {"recording": "wrong", "true": "b", "recognised": "a"}
    recordings = [*IDENTICAL, exact("far", "a", 0.3, shift=40.0)]
    result = evaluate(recordings, folds, SETTINGS)
    for table in result["recognition"].values():
        assert all(np.isfinite(row["log_loss"]) for row in table.values())
    assert all(np.isfinite(r["rmse"]) for r in result["prediction"]["known_phase"].values())
    json.dumps(result, allow_nan=False)


@pytest.mark.slow
def test_what_cannot_be_scored_is_left_out_and_named(identical):
    """The scores of the others do not change, and those left out are in no fold."""
    short = replace(IDENTICAL[0], name="short", end_ns=START_NS + 100_000_000)
    other = replace(IDENTICAL[0], name="other", controlled=IDENTICAL[0].observed)
    (robot,) = IDENTICAL[0].controlled
    later = replace(robot, stamps_ns=robot.stamps_ns + 300_000_000_000)
    off = replace(IDENTICAL[0], controlled=(later,), name="off")
    everything = [off, *IDENTICAL[:3], short, *IDENTICAL[3:], other]
    done = []
    result = evaluate(everything, "loo", SETTINGS, progress=done.append)
    assert done == [1, 2, 3, 4, 5, 6]
    reasons = {one["recording"]: one["reason"] for one in result.pop("left_out")}
    assert set(reasons) == {"off", "short", "other"}
    assert "two clocks" in reasons["off"] and "0.2 s" in reasons["short"]
    assert "DOFs" in reasons["other"]
    assert result == {k: v for k, v in identical.items() if k != "left_out"}
    by_fold = evaluate(everything, make_folds(everything, "loo"), SETTINGS)
    assert by_fold["n_demonstrations"] == 6 and by_fold["recognition"] == identical["recognition"]
    with pytest.raises(ArgumentError, match="short"):
        evaluate([short, short], [([0], [1])], SETTINGS)


def test_the_only_recording_of_a_task_is_left_out_of_every_table():
    alone = replace(IDENTICAL[0], name="alone", task="c")
    result = evaluate([*IDENTICAL, alone], "kfold:7", SETTINGS)
    (left_out,) = result["left_out"]
    assert left_out == {"recording": "alone", "reason": "no recording of c is left to learn from"}
    n = result["n_demonstrations"]
    assert n == result["none"]["n_known"] == len(IDENTICAL)
    assert result["recognition"]["known_phase"]["1.0"]["accuracy"] == 1.0
    confusion = result["confusion"]["known_phase"]["1.0"]
    assert dict(zip(confusion["true"], map(sum, confusion["counts"]), strict=True))["c"] == 0
    json.dumps(result, allow_nan=False)
    with pytest.raises(ArgumentError, match="no recording of c is left to learn from"):
        evaluate([*IDENTICAL, alone], [([*range(6)], [6])], SETTINGS)


@pytest.mark.slow
def test_no_truth_is_extrapolated():
    """The robot's last moments were not recorded: nothing is scored there."""
    last_ns = IDENTICAL[0].end_ns - 100_000_000
    robot = IDENTICAL[0].controlled[0].between(START_NS, last_ns)
    cut = replace(IDENTICAL[0], name="cut", controlled=(robot,))
    short = replace(IDENTICAL[0], name="cut", end_ns=last_ns)
    folds = [(list(range(1, 6)), [0])]
    ours, theirs = (
        evaluate([one, *IDENTICAL[1:]], folds, SETTINGS, unknown_tasks=False)
        for one in (cut, short)
    )
    assert ours == theirs


def test_a_fold_that_cannot_be_learned_from_is_named():
    with pytest.raises(TrainingError, match=r"learning without a0: .* at least two"):
        evaluate(IDENTICAL[:3:2], "loo", SETTINGS)


def test_chance_is_named():
    (remark,) = [line for line in remarks_on({"tasks": ["a", "b", "c", "d"]}) if "Chance" in line]
    assert "accuracy of 0.25 and a log loss of 1.39" in remark and "Early figures" in remark


@pytest.fixture
def unnamed():
    rng, times_s = np.random.default_rng(0), np.arange(0.0, 2.0, 0.02)
    found = []
    for k in range(10):
        way = np.clip(times_s - 0.4, 0.0, 1.0)[:, None] ** 2 * (0.4 + 0.3 * (k % 2))
        human = way + 0.001 * rng.normal(size=(100, 1))
        found.append(Demonstration.from_arrays(times_s, human, 1.0 - way, task=f"t{k % 2}"))
    return found


def test_demonstrations_without_a_name_are_numbered(unnamed):
    settings = TrainingSettings(n_basis=8)
    assert accumulate(unnamed, settings).used == tuple(f"demonstration_{k}" for k in range(10))
    named = Demonstration.from_arrays([0, 1, 2, 3], np.eye(4), np.eye(4), name="mine")
    assert [d.name for d in numbered([unnamed[0], named])] == ["demonstration_0", "mine"]
    wrong = [
        *unnamed,
        Demonstration.from_arrays(
            np.arange(0.0, 2.0, 0.02),
            human=unnamed[0].observed[0].values,
            robot=np.zeros((100, 2)),
            task="t0",
        ),
    ]
    left_out = evaluate(wrong, "kfold:3", settings)["left_out"]
    assert [one["recording"] for one in left_out] == ["demonstration_10"]
