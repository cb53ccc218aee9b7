# SPDX-License-Identifier: Apache-2.0
"""`intent segment`: bags, and what is said of them."""

import json

import pytest

from intent_recognition.bags import BagReader
from intent_recognition.cli.main import main


@pytest.mark.slow
def test_segments_are_written_and_told(repository, tmp_path, capsys):
    session, output = repository / "bags/sessions/session_01", tmp_path / "demos"
    command = ["segment", str(session), "--unlabelled", "--output", str(output), "--json"]
    assert main(command) == 0
    rows = json.loads(capsys.readouterr().out)
    assert len(rows) == 10 and all(row["task"] is None for row in rows)
    for row, folder in zip(rows, sorted(output.iterdir()), strict=True):
        reader = BagReader(folder)
        assert row["bag"] == str(folder) and "task" not in reader.custom_data
        assert row["start_ns"] <= reader.start_ns < reader.end_ns <= row["end_ns"]
        assert reader.custom_data["session"] == "session_01"
        assert "/demonstration" not in reader.topics
    assert main(command) == 1
    assert "no bag of that name" in capsys.readouterr().err


def test_a_table_and_a_file(repository, tmp_path, capsys):
    session, rows = repository / "bags/sessions/session_02", tmp_path / "rows.json"
    output = tmp_path / "demos"
    assert main(["segment", str(session), "--output", str(output), "--json", str(rows)]) == 0
    printed = capsys.readouterr().out
    assert "session_02_000" in printed and "10 demonstrations in" in printed
    assert len(json.loads(rows.read_text())) == 10


def test_a_dof_file_beside_a_model_is_refused_not_passed_over(tmp_path, capsys):
    words = ["segment", "session", "--model", "m.npz", "--dofs", "d.yaml", "--output"]
    assert main([*words, str(tmp_path / "new")]) == 1
    assert "--dofs: expected no --model with it, got m.npz" in capsys.readouterr().err
