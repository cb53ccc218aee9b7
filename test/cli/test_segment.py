# SPDX-License-Identifier: Apache-2.0
"""`intent segment`, `intent recover` and `intent plan`: files, and what is said of them."""

import json
import re

import pytest
from bag_builder import raw, write_bag

from intent_recognition.bags import BagReader
from intent_recognition.cli.main import main
from intent_recognition.errors import ResourceBusyError
from intent_recognition.plans import read_plan


@pytest.mark.slow
def test_segments_are_written_and_told(repository, tmp_path, capsys):
    session, output = repository / "bags/sessions/session_01", tmp_path / "demos"
    command = ["segment", str(session), "--unlabelled", "--output", str(output)]
    assert main([*command, "--json", str(tmp_path / "rows.json")]) == 0
    printed, rows = capsys.readouterr().out, json.loads((tmp_path / "rows.json").read_text())
    assert "session_01_000" in printed and "10 demonstrations in" in printed
    assert len(rows) == 10 and all(row["task"] is None for row in rows)
    for row, folder in zip(rows, sorted(output.iterdir()), strict=True):
        reader = BagReader(folder)
        assert row["bag"] == str(folder) and "task" not in reader.custom_data
        assert row["start_ns"] <= reader.start_ns < reader.end_ns <= row["end_ns"]
        assert reader.custom_data["session"] == "session_01"
        assert "/demonstration" not in reader.topics
    assert main(["segment", str(session), "--model", "m.npz", "--dofs", "d.yaml"]) == 1
    assert "--dofs: expected no --model with it, got m.npz" in capsys.readouterr().err


def test_an_existing_output_is_not_touched_and_a_script_gets_json(run_command, tmp_path):
    bag = write_bag(tmp_path / "whole")
    other = write_bag(tmp_path / "other", count=3)
    before = raw(other, BagReader)
    with pytest.raises(ResourceBusyError, match="other"):
        run_command("recover", bag, "--output", other)
    assert raw(other, BagReader) == before
    _, output = run_command("recover", bag, "--output", tmp_path / "copy", "--json")
    content = json.loads(output)
    assert content["message_counts"] == {"/joint_states": 50, "/mocap/wrist/pose": 50}
    assert content["message_count"] == 100 and content["damage"] == []
    file = next(bag.glob("*.mcap"))
    file.write_bytes(file.read_bytes()[:-100])
    code, output = run_command("recover", bag, "--output", tmp_path / "saved")
    assert code == 0 and output.startswith("saved 100 messages over ")
    assert "damaged at byte" in output


@pytest.mark.slow
def test_the_order_of_shipped_sessions(tmp_path, repository, capsys):
    out = tmp_path / "box.yaml"
    sessions = str(repository / "bags" / "sessions")
    assert main(["plan", "learn", sessions, "--first", "plate_handover", "-o", str(out)]) == 0
    plan = read_plan(out.read_text())
    assert plan.names == ("plate_handover", "screw_handover", "hold_screwdriver")
    assert plan.before[0, 1] > 0.9 and plan.before[1, 2] > 0.9
    assert all(1.0 < step.duration_s < 10.0 for step in plan.steps)
    assert "from 31 assemblies" in capsys.readouterr().out
    assert main(["plan", "learn", str(tmp_path), "--first", "base", "-o", str(out)]) == 1
    assert "got none in 0 assemblies. Give whole assemblies" in capsys.readouterr().err


def test_relations_by_hand_outlast_learning(tmp_path, capsys):
    sessions, out = tmp_path / "sessions.yaml", tmp_path / "new" / "plan.yaml"
    sessions.write_text("[[base, {task: lid, who: anna}], [base, lid]]")
    words = ["plan", "learn", str(sessions), "-o", str(out)]
    assert main(words) == 0
    out.write_text(out.read_text().replace("by_hand: {}", "by_hand: {base < lid: 1}"))
    assert main(words) == 0
    assert read_plan(out.read_text()).by_hand == {("base", "lid"): 1.0}
    shown = capsys.readouterr().out
    assert "base (by hand)" in shown and "anna 100%" in shown


CIRCLE = "steps: [{step: a}, {step: b}]\norder: {a < b: 1, b < a: 1}"


@pytest.mark.parametrize(
    ("words", "text", "said"),
    [
        (["learn", "two.yaml", "-o", "one.yaml"], "steps: [", "plan: expected YAML, got none"),
        (["learn", "two.yaml", "-o", "one.yaml"], CIRCLE, "order and by_hand: expected no circle"),
        (["learn", "one.yaml", "-o", "p.yaml"], None, "expected a file of YAML"),
        (["learn", "one.yaml", "-o", "p.yaml"], "[{tsk: a}]", "assembly 1, task 1: expected keys"),
        (["learn", "two.yaml", "-o", "one.yaml"], "steps: [{stp: a}]", "plan, step 1: expected a"),
    ],
)
def test_a_file_that_cannot_be_used_is_named(words, text, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        (tmp_path / "one.yaml").write_text(text)
    assert main(["plan", *words]) == 1
    assert re.match(f"intent plan: one.yaml: {said}", capsys.readouterr().err)
