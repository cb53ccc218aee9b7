# SPDX-License-Identifier: Apache-2.0
"""`intent replay` and `intent rehearse`: numbers, text and page of a recording."""

import json

import numpy as np
import pytest
import yaml
from bag_builder import START_NS, TEXT
from cli.recorded import DOFS, TRUTH
from model_builder import perform, write_recording

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.demonstrations.observations import iter_observations
from intent_recognition.errors import BagError
from intent_recognition.model import load_model
from intent_recognition.recognition import DecisionSettings, IntentEstimator, decision_settings
from intent_recognition.signals.observation import merge


@pytest.fixture
def bag(tmp_path):
    return write_recording(tmp_path / "bag", perform(TRUTH, 1, 50), DOFS)


@pytest.fixture
def replay(run_command, model, tmp_path):
    def run(bag):
        output = tmp_path / "deep" / "rows.json"
        code, text = run_command("replay", bag, "--model", model, "--json", output)
        return code, text, json.loads(output.read_text())

    return run


@pytest.mark.slow
def test_rows_are_the_contract_s_numbers_the_estimator_s_and_the_right_task_is_active(
    replay, bag, model
):
    code, text, rows = replay(bag)
    assert code == 0
    stamps = perform(TRUTH, 1, 50).observed[0].stamps_ns
    assert [row["stamp"] for row in rows] == stamps.tolist()
    library = load_model(model).library
    estimator = IntentEstimator(library)
    for row, observation in zip(rows, iter_observations(BagReader(bag), DOFS), strict=True):
        assert set(row) == {"stamp", "probabilities", "phase", "active_task"}
        assert isinstance(row["stamp"], int)
        assert list(row["probabilities"]) == list(row["phase"]) == ["task_0", "task_1", "none"]
        assert abs(sum(row["probabilities"].values()) - 1.0) < 1e-9
        assert row["phase"]["none"] == 0.0
        estimate = estimator.update(observation)
        np.testing.assert_array_equal(list(row["probabilities"].values()), estimate.probabilities)
        np.testing.assert_array_equal(list(row["phase"].values()), estimate.phase)
    active = [row["active_task"] for row in rows]
    assert set(active) == {"", "task_1"} and active[0] == ""
    first = active.index("task_1")
    threshold = decision_settings(library).risk.threshold
    believed = [row["probabilities"] for row in rows]
    sure = [p["task_1"] >= threshold * (1.0 - p["none"]) for p in believed]
    assert all(sure[first - 4 : first + 1])  # five on end
    assert "time [s]" in text and "not activated" not in text
    assert 15 < len([line for line in text.splitlines() if "│" in line]) < 50
    words, after_s = " ".join(text.split()), (rows[first]["stamp"] - rows[0]["stamp"]) * 1e-9
    assert f"{len(rows)} observations, one in {len(rows) // 20} of them shown" in words
    assert f"became active: task_1 after {after_s:.2f} s" in words


@pytest.mark.slow
def test_why_a_recognised_task_never_was_active_is_said(replay, bag, monkeypatch):
    strict = DecisionSettings(max_end_std_rad=1e-6, max_end_std_m=1e-6)
    settings = "intent_recognition.evaluation.replaying.decision_settings"
    monkeypatch.setattr(settings, lambda library: strict)
    _, text, rows = replay(bag)
    assert {row["active_task"] for row in rows} == {""}
    assert "not activated: recognised task_1, but the predicted end is uncertain" in text
    assert "no task became active" in text


def test_what_is_dropped_is_said(replay, tmp_path):
    recording = perform(TRUTH, 0, 51)
    with BagWriter(tmp_path / "bag") as writer:
        for k, observation in enumerate(merge(recording.observed)):
            x, y, z = (float(v) for v in observation.values)
            message = {
                "header": {"stamp": 0 if k % 40 == 10 else observation.stamp_ns},
                "pose": {"position": {"x": x, "y": y, "z": z}, "orientation": {"w": 1.0}},
            }
            message["header"]["frame_id"] = "elsewhere" if k % 40 == 20 else "world"
            entry = DOFS.observed[0]
            writer.write_message(entry.topic, entry.type, message, observation.stamp_ns)
    code, text, rows = replay(tmp_path / "bag")
    n = len(recording.observed[0].stamps_ns)
    lost = {offset: len(range(offset, n, 40)) for offset in (10, 20)}
    assert code == 0 and len(rows) == n - sum(lost.values())
    assert f"messages dropped: {lost[20]} unknown_frame, {lost[10]} zero_stamp" in text


@pytest.mark.parametrize("command", ["replay", "explain"])
def test_a_recording_without_observations_is_refused_with_what_it_has(
    run_command, model, tmp_path, command
):
    with BagWriter(tmp_path / "talk") as writer:
        writer.write_message("chatter", TEXT, {"data": "hello"}, START_NS)
    with pytest.raises(BagError, match=r"mocap/wrist/pose.*chatter"):
        run_command(command, tmp_path / "talk", "--model", model)
    with BagWriter(tmp_path / "lost") as writer:
        entry = DOFS.observed[0]
        message = {"header": {"stamp": START_NS, "frame_id": "elsewhere"}}
        writer.write_message(entry.topic, entry.type, message, START_NS)
    with pytest.raises(BagError, match="1 unknown_frame"):
        run_command(command, tmp_path / "lost", "--model", model)


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """Bags to learn from, and others to rehearse, one of them with a wrong label."""
    folder = tmp_path_factory.mktemp("bags")
    for seed in range(16):
        write_recording(folder / "shown" / f"s_{seed:02d}", perform(TRUTH, seed % 2, seed), DOFS)
    for seed in range(60, 63):
        task = "task_0" if seed == 61 else None
        recorded = perform(TRUTH, seed % 2, seed)
        write_recording(folder / "new" / f"new_{seed}", recorded, DOFS, task=task, group="anna")
    (folder / "dofs.yaml").write_text(yaml.safe_dump(DOFS.to_dict()))
    return folder


@pytest.mark.slow
def test_numbers_worst_moments_and_suggestions(run_command, bags, tmp_path):
    model = tmp_path / "model.npz"
    out, page = tmp_path / "rehearsal.json", tmp_path / "rehearsal.html"
    trained = ("train", bags / "shown", "--dofs", bags / "dofs.yaml", "--basis", "10")
    assert run_command(*trained, "--output", model)[0] == 0
    code, text = run_command(
        "rehearse", model, bags / "new", "--json", out, "--report", page, "--max-wrong", "0.1"
    )
    assert code == 0
    content = json.loads(out.read_text())
    assert (content["n"], content["wrong"], content["missed"]) == (3, 1, 1)
    by_name = {run["recording"]: run for run in content["runs"]}
    assert by_name["new_61"]["activated"] == ["task_1"]
    assert by_name["new_61"]["decided_s"] is None
    assert 0.0 < by_name["new_60"]["decided_s"] < 4.0
    low, high = content["wrong_interval"]
    assert f"1 of 3 (95 %: {low:.1%} to {high:.1%})" in text
    assert len(content["suggestions"]) == 5
    assert content["suggestions"][0]["task"] == "task_0"
    assert "of anna" in text
    html = page.read_text()
    assert f"1 of 3 (95 %: {low:.1%} to {high:.1%})" in html
    assert html.count("data:image/svg+xml") == 1
    for part in (text, html):
        assert "What to demonstrate next".lower() in part.lower()
    printed = json.loads(run_command("rehearse", model, bags / "new", "--json")[1])
    assert printed["suggestions"] == content["suggestions"]
    write_recording(bags / "shown" / "nameless", perform(TRUTH, 0, 70), DOFS, task="")
    for k in (0, 1):
        copied = perform(TRUTH, 0, 71)
        write_recording(bags / "shown" / f"copy_{k}", copied, DOFS, task=f"task_{k}")
    text = run_command("rehearse", model, bags / "shown")[1]
    assert "numbers flatter" in text and "left out nameless: it has no label" in text
    assert "doubtful copy_0: the observed movement is, number by number, that of copy_1" in text
    with pytest.raises(BagError, match=r"missing topic.* Give recordings of what the") as said:
        run_command("rehearse", model, "bags/assembly")
    assert "--dofs" not in str(said.value)
