# SPDX-License-Identifier: Apache-2.0
"""`intent plan`: from shipped sessions and written ones to a file, and back."""

import re

import pytest

from intent_recognition.cli.main import main
from intent_recognition.plans import read_plan


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


def test_relations_by_hand_outlast_learning(tmp_path, capsys):
    sessions, out = tmp_path / "sessions.yaml", tmp_path / "new" / "plan.yaml"
    sessions.write_text("[[base, {task: lid, who: anna}], [base, lid]]")
    words = ["plan", "learn", str(sessions), "-o", str(out)]
    assert main(words) == 0
    out.write_text(out.read_text().replace("by_hand: {}", "by_hand: {base < lid: 1}"))
    assert main(words) == 0 and main(["plan", "show", str(out)]) == 0
    assert read_plan(out.read_text()).by_hand == {("base", "lid"): 1.0}
    shown = capsys.readouterr().out
    assert "base (by hand)" in shown and "anna 100%" in shown


CIRCLE = "steps: [{step: a}, {step: b}]\norder: {a < b: 1, b < a: 1}"


@pytest.mark.parametrize(
    ("words", "text", "said"),
    [
        (["show", "one.yaml"], None, "expected a file of YAML"),
        (["show", "one.yaml"], "steps: [", "plan: expected YAML, got .* at line 2"),
        (["show", "one.yaml"], CIRCLE, "order and by_hand: expected no circle, got one of a, b"),
        (["learn", "one.yaml", "-o", "p.yaml"], None, "expected a file of YAML"),
        (["learn", "one.yaml", "-o", "p.yaml"], "[{tsk: a}]", "assembly 1, task 1: expected a"),
        (["learn", "two.yaml", "-o", "one.yaml"], "steps: [{stp: a}]", "plan, step 1: expected a"),
    ],
)
def test_a_file_that_cannot_be_used_is_named(words, text, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        (tmp_path / "one.yaml").write_text(text)
    assert main(["plan", *words]) == 1
    assert re.match(f"intent plan: one.yaml: {said}", capsys.readouterr().err)
