# SPDX-License-Identifier: Apache-2.0
"""`intent evaluate`: protocols, tables, JSON of the contract, report."""

import io
import json
import shutil
from contextlib import redirect_stdout
from typing import NamedTuple
from unittest.mock import Mock

import pytest
from cli.recorded import spoil
from rich.console import Console

from intent_recognition.cli import evaluate as command
from intent_recognition.cli.main import main
from intent_recognition.errors import ArgumentError
from intent_recognition.evaluation import make_folds
from intent_recognition.report.evaluation_report import ONLINE_COLUMNS


class Run(NamedTuple):
    """What one run of the command left behind."""

    code: int
    text: str
    result: dict
    page: str


@pytest.fixture(scope="module")
def scored(tmp_path_factory, recorded) -> Run:
    """All there is to score, in three folds."""
    folder, text = tmp_path_factory.mktemp("scored"), io.StringIO()
    numbers, page = folder / "scores.json", folder / "report" / "page.html"
    options = ["--dofs", recorded / "dofs.yaml", "--basis", 8, "--protocol", "kfold:3"]
    options += ["--json", numbers, "--report", page]
    bags = recorded / "bags"
    words = ["evaluate", bags, bags / "../bags/demo_00", *options]  # read once
    with redirect_stdout(text):
        code = main([str(word) for word in words])
    return Run(code, text.getvalue(), json.loads(numbers.read_text()), page.read_text())


@pytest.fixture
def evaluate(run_command, recorded, tmp_path):
    def run(*arguments, bags=recorded / "bags"):
        output = tmp_path / "deep" / "scores.json"
        options = ("--dofs", recorded / "dofs.yaml", "--basis", 8, "--json", output)
        code, text = run_command("evaluate", bags, *options, *arguments)
        return code, text, json.loads(output.read_text())

    return run


@pytest.mark.slow
def test_folds_by_index(scored):
    code, text, result, page = scored
    assert code == 0
    assert result["n_demonstrations"] == 8 and result["left_out"] == []
    assert result["tasks"] == ["task_0", "task_1"] and result["unit"] == "rad"
    assert result["recognition"]["known_phase"]["1.0"]["accuracy"] == 1.0
    for title in ("recognition, known phase", "prediction, unknown phase", "8 demonstrations"):
        assert title in text
    assert "online, as the nodes run" in text
    assert "…" not in text
    assert "squared error [rad²]" in text and "8 of 8" in text
    assert "recording observed" in text
    assert "Shares observed are of the recording" in text and "--segment movement" in text
    assert "nothing to recognise" not in text
    for row in result["online"].values():
        assert set(row) == {"n", *ONLINE_COLUMNS}
        assert row["recognised"] >= 0.75 and row["wrongly_acted_on"] == 0.0
    assert "wrote " in text and text.rstrip().endswith("page.html")
    assert "Evaluation on bags" in page and 'src="http' not in page
    none = result["none"]  # tasks are left out in turn
    assert (none["n_known"], none["n_unknown"], len(none["left_out"])) == (8, 8, 2)
    assert 0.0 <= none["area"] <= 1.0 and "tasks left out in turn: area" in text


@pytest.fixture
def asked(evaluate, monkeypatch):
    """What the command asks the evaluation for: recordings, folds, settings and options."""

    def run(*options):
        mock = Mock(side_effect=ArgumentError("enough"))
        monkeypatch.setattr(command, "evaluate", mock)
        with pytest.raises(ArgumentError, match="enough"):
            evaluate(*options)
        return mock.call_args

    return run


@pytest.mark.parametrize(
    ("options", "more"),
    [
        ((), {}),
        (("--start-posture", "on"), {"start_posture": True}),
        (("--unknown-tasks", "off"), {"unknown_tasks": False}),
    ],
)
def test_leaving_one_out_is_the_default_and_options_are_passed_on(asked, options, more):
    (usable, folds, _), given = asked(*options)
    assert folds == make_folds(usable, "loo")
    default = {"start_posture": False, "unknown_tasks": True}
    assert {key: given[key] for key in default} == default | more


@pytest.mark.slow
def test_broken_and_unlabelled_bags_are_left_out_and_named(evaluate, recorded, tmp_path):
    learned, held_out = tmp_path / "learned", tmp_path / "held_out"
    shutil.copytree(recorded / "bags", learned)
    for name in ("demo_00", "demo_01"):
        shutil.copytree(recorded / "bags" / name, held_out / name)
    for folder in (learned, held_out):
        reasons = spoil(folder)
        shutil.rmtree(folder / "short")
    reasons.pop("short")
    code, text, result = evaluate("--test", held_out, "--unknown-tasks", "off", bags=learned)
    assert code == 0
    assert result["n_demonstrations"] == 2
    left_out = [one["recording"] for one in result["left_out"]]
    assert sorted(left_out) == sorted(2 * [*reasons])
    for name, reason in reasons.items():
        assert reason in text
        for folder in (learned, held_out) if name != "nameless" else ():
            assert f"left out {folder / name}" in text
    assert text.count("left out nameless") == 2
    assert result["none"]["area"] is None and result["none"]["n_unknown"] == 0
    assert "left out in turn" not in text


def test_a_folder_and_a_protocol_contradict_each_other(evaluate, recorded):
    with pytest.raises(ArgumentError, match="--test: expected no --protocol"):
        evaluate("--test", recorded / "bags", "--protocol", "loo")


@pytest.mark.parametrize(
    "option", [("--test", "{}"), ("--protocol", "holdout:{}")], ids=["test", "holdout"]
)
def test_a_folder_to_test_on_is_in_one_fold(asked, recorded, option):
    usable, folds, _ = asked(*(word.format(recorded / "bags") for word in option)).args
    assert (len(usable), folds) == (16, [(list(range(8)), list(range(8, 16)))])


@pytest.mark.slow
def test_recordings_taken_for_another_task_and_a_single_task_are_told(scored):
    mistaken = [{"recording": f"d{k}", "true": "a", "recognised": "b"} for k in range(7)]
    text = io.StringIO()
    result = scored.result | {"mistaken": mistaken, "tasks": ["a"]}
    command.print_result(Console(file=text, width=140), result)
    assert "taken for another task at the end: d0 (a) for b, " in text.getvalue()
    assert "d4 (a) for b and 2 more" in text.getvalue()
    assert "With one task there is nothing to recognise" in text.getvalue()
    assert "taken for another" not in scored.text


@pytest.mark.slow
@pytest.mark.parametrize("width", [80, 120])
def test_tables_fit_the_terminal_and_cut_no_heading(scored, width):
    text = io.StringIO()
    command.print_result(Console(file=text, width=width), scored.result)
    table = [line for line in text.getvalue().splitlines() if line[:1] in "│┃"]
    assert table and max(map(len, table)) <= width
    assert "\N{HORIZONTAL ELLIPSIS}" not in text.getvalue()
    for heading in ("rmse nearest neighbour", "median share at decision", "100%"):
        assert any(heading in line for line in table)
