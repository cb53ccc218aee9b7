# SPDX-License-Identifier: Apache-2.0
"""`intent evaluate`: protocols, tables, JSON of the contract, report."""

import json
import math
import shutil

import pytest
from cli.recorded import spoil, write_all

from intent_recognition.errors import ArgumentError, BagError, ResourceBusyError

RECOGNITION = {"accuracy", "log_loss"}
PREDICTION = {
    "rmse",
    "rmse_inferred_task",
    "rmse_future",
    "rmse_mean_of_task",
    "rmse_nearest_neighbour",
    "end_rmse",
    "coverage_2_sigma",
    "nll",
}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    write_all(folder)
    return folder


@pytest.fixture
def evaluate(run_command, recorded, tmp_path):
    def run(*arguments, bags=recorded / "bags"):
        output = tmp_path / "deep" / "scores.json"
        options = ("--dofs", recorded / "dofs.yaml", "--basis", 8, "--json", output)
        code, text = run_command("evaluate", bags, *options, *arguments)
        return code, text, json.loads(output.read_text())

    return run


def check_contract(result):
    """The keys of the contract, and numbers that can be true."""
    assert set(result) >= {"n_demonstrations", "tasks", "unit", "recognition", "prediction"}
    assert set(result["recognition"]) == {"known_phase", "unknown_phase"}
    assert set(result["prediction"]) == {"known_phase", "unknown_phase"}
    for phase in ("known_phase", "unknown_phase"):
        rows = result["recognition"][phase]
        assert list(rows) == ["0.1", "0.2", "0.3", "0.5", "0.7", "1.0"]
        for row in rows.values():
            assert set(row) == RECOGNITION
            assert 0.0 <= row["accuracy"] <= 1.0 and row["log_loss"] >= 0.0
        rows = result["prediction"][phase]
        assert list(rows) == ["0.25", "0.5", "0.75", "1.0"]
        for fraction, row in rows.items():
            assert set(row) == PREDICTION
            future = row.pop("rmse_future")  # nothing is left to predict at the end
            assert (future is None) == (fraction == "1.0")
            assert all(math.isfinite(value) for value in row.values())
            assert 0.0 <= row["coverage_2_sigma"] <= 1.0 and row["rmse"] > 0.0


def test_folds_by_index(evaluate):
    code, text, result = evaluate("--protocol", "kfold:4")
    assert code == 0
    check_contract(result)
    assert result["n_demonstrations"] == 8
    assert result["tasks"] == ["task_0", "task_1"] and result["unit"] == "rad"
    assert result["recognition"]["known_phase"]["1.0"]["accuracy"] == 1.0
    for title in ("recognition, known phase", "prediction, unknown phase", "8 demonstrations"):
        assert title in text
    assert "…" not in text


def test_leaving_one_out_is_the_default_and_start_posture_an_option(evaluate):
    _, _, off = evaluate()
    _, _, on = evaluate("--start-posture", "on")
    check_contract(off)
    check_contract(on)
    assert off["n_demonstrations"] == on["n_demonstrations"] == 8
    assert off["recognition"] == on["recognition"]  # never evidence for the task
    assert off["prediction"] != on["prediction"]


def test_with_and_without_start_posture_in_one_go(evaluate):
    _, text, both = evaluate("--start-posture", "both", "--unknown-tasks", "off")
    _, _, off = evaluate("--unknown-tasks", "off")
    _, _, on = evaluate("--start-posture", "on", "--unknown-tasks", "off")
    assert both["prediction"] == off["prediction"]
    assert both["prediction_with_start_posture"] == on["prediction"]
    assert "prediction with start posture, known phase" in text


def test_tasks_are_left_out_in_turn_unless_told_otherwise(evaluate):
    _, text, result = evaluate("--protocol", "kfold:4")
    none = result["none"]
    assert (none["n_known"], none["n_unknown"]) == (8, 8)
    assert set(none["left_out"]) == {"task_0", "task_1"}
    assert 0.0 <= none["area"] <= 1.0
    assert "tasks left out in turn: area" in text and "unknown movements: 8" in text
    _, text, result = evaluate("--protocol", "kfold:4", "--unknown-tasks", "off")
    assert result["none"]["area"] is None and result["none"]["n_unknown"] == 0
    assert "left out in turn" not in text


def test_a_folder_held_out(evaluate, recorded, tmp_path):
    held_out = tmp_path / "held_out"
    for name in ("demo_00", "demo_01"):
        shutil.copytree(recorded / "bags" / name, held_out / name)
    spoil(held_out)
    shutil.rmtree(held_out / "short")
    code, text, result = evaluate("--protocol", f"holdout:{held_out}")
    assert code == 0
    check_contract(result)
    assert result["n_demonstrations"] == 2
    lines = text
    assert "left out nameless" in lines and f"left out {held_out / 'cut'}" in lines


def test_broken_and_unlabelled_bags_are_left_out_and_named(evaluate, recorded, tmp_path):
    shutil.copytree(recorded / "bags", tmp_path / "all")
    reasons = spoil(tmp_path / "all")
    shutil.rmtree(tmp_path / "all" / "short")
    reasons.pop("short")
    code, text, result = evaluate("--protocol", "kfold:4", bags=tmp_path / "all")
    assert code == 0
    assert result["n_demonstrations"] == 8
    lines = text
    for name, reason in reasons.items():
        assert name in lines and reason in lines


@pytest.mark.parametrize(
    "protocol", ["kfold:1", "kfold:9", "kfold:x", "kfold", "half", "holdout", "holdout:", "loo:2"]
)
def test_protocols_that_make_no_sense_are_refused(evaluate, protocol):
    with pytest.raises(ArgumentError, match="protocol"):
        evaluate("--protocol", protocol)


def test_a_folder_to_test_on_must_hold_something(evaluate, tmp_path):
    with pytest.raises(BagError, match="nowhere"):
        evaluate("--protocol", f"holdout:{tmp_path / 'nowhere'}")
    spoil(tmp_path / "held_out")
    for name in ("cut", "alone", "short", "void"):
        shutil.rmtree(tmp_path / "held_out" / name)
    with pytest.raises(ArgumentError, match="--protocol"):
        evaluate("--protocol", f"holdout:{tmp_path / 'held_out'}")


def test_the_report_is_a_page_by_itself(evaluate, tmp_path):
    evaluate("--protocol", "kfold:4", "--report", tmp_path / "report" / "page.html")
    page = (tmp_path / "report" / "page.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html") and "task_1" in page
    assert 'src="http' not in page


@pytest.mark.parametrize("option", ["--json", "--report"])
def test_an_output_that_cannot_be_written_is_refused_before_the_work(run_command, tmp_path, option):
    (tmp_path / "file").write_text("")
    for output in (tmp_path, tmp_path / "file" / "out"):
        with pytest.raises(ResourceBusyError, match=option):
            run_command("evaluate", "/no/bag", option, output)
