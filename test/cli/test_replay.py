# SPDX-License-Identifier: Apache-2.0
"""`intent replay`: the posterior over time, as JSON and as a table."""

import json

import numpy as np
import pytest
from bag_builder import START_NS, TEXT
from cli.recorded import DOFS, TRUTH
from model_builder import perform, write_recording

from intent_recognition.bags.reader import BagReader
from intent_recognition.bags.writer import BagWriter
from intent_recognition.demonstrations.observations import iter_observations
from intent_recognition.errors import BagError, ModelError, ResourceBusyError
from intent_recognition.model.file import load_model
from intent_recognition.recognition.decision import DecisionSettings, decision_settings
from intent_recognition.recognition.estimator import IntentEstimator
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
def test_keys_are_the_contract_s_and_stamps_the_recording_s(replay, bag):
    code, text, rows = replay(bag)
    assert code == 0
    stamps = perform(TRUTH, 1, 50).observed[0].stamps_ns
    assert [row["stamp"] for row in rows] == stamps.tolist()
    labels = ["task_0", "task_1", "none"]
    for row in rows:
        assert set(row) == {"stamp", "probabilities", "phase", "active_task"}
        assert isinstance(row["stamp"], int)
        assert list(row["probabilities"]) == list(row["phase"]) == labels
        assert abs(sum(row["probabilities"].values()) - 1.0) < 1e-9
        assert row["phase"]["none"] == 0.0
    assert "task_1" in text and f"{len(rows)} observations" in text
    assert "time [s]" in text
    assert 15 < len([line for line in text.splitlines() if "│" in line]) < 50


@pytest.mark.slow
def test_the_right_task_becomes_active_and_ends(replay, bag, model):
    rows = replay(bag)[2]
    active = [row["active_task"] for row in rows]
    assert set(active) == {"", "task_1"} and active[0] == ""
    first = active.index("task_1")
    threshold = decision_settings(load_model(model).library).risk.threshold
    believed = [row["probabilities"] for row in rows]
    sure = [p["task_1"] >= threshold * (1.0 - p["none"]) for p in believed]
    assert all(sure[first - 4 : first + 1])  # five on end


@pytest.mark.slow
def test_why_a_recognised_task_never_was_active_is_said(replay, bag, monkeypatch):
    assert "not activated" not in replay(bag)[1]
    strict = DecisionSettings(max_end_std_rad=1e-6, max_end_std_m=1e-6)
    monkeypatch.setattr(
        "intent_recognition.evaluation.replaying.decision_settings", lambda library: strict
    )
    _, text, rows = replay(bag)
    assert {row["active_task"] for row in rows} == {""}
    assert "not activated: recognised task_1, but the predicted end is uncertain" in text
    assert "no task became active" in text


@pytest.mark.slow
def test_numbers_are_the_estimator_s(replay, bag, model):
    rows = replay(bag)[2]

    estimator = IntentEstimator(load_model(model).library)
    for row, observation in zip(rows, iter_observations(BagReader(bag), DOFS), strict=True):
        estimate = estimator.update(observation)
        np.testing.assert_array_equal(list(row["probabilities"].values()), estimate.probabilities)
        np.testing.assert_array_equal(list(row["phase"].values()), estimate.phase)


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


def test_a_recording_without_observations_is_refused_with_what_it_has(replay, tmp_path):
    with BagWriter(tmp_path / "talk") as writer:
        writer.write_message("chatter", TEXT, {"data": "hello"}, START_NS)
    with pytest.raises(BagError, match=r"mocap/wrist/pose.*chatter"):
        replay(tmp_path / "talk")
    with BagWriter(tmp_path / "lost") as writer:
        entry = DOFS.observed[0]
        message = {"header": {"stamp": START_NS, "frame_id": "elsewhere"}}
        writer.write_message(entry.topic, entry.type, message, START_NS)
    with pytest.raises(BagError, match="1 unknown_frame"):
        replay(tmp_path / "lost")


def test_what_cannot_be_read_is_refused(run_command, replay, model, bag, tmp_path):
    with pytest.raises(BagError, match="missing"):
        replay(tmp_path / "missing")
    with pytest.raises(ModelError, match=r"none\.npz"):
        run_command("replay", bag, "--model", tmp_path / "none.npz")
    with pytest.raises(ResourceBusyError, match="--json"):
        run_command("replay", bag, "--model", model, "--json", tmp_path)
    data = (bag / "bag_0.mcap").read_bytes()
    (bag / "bag_0.mcap").write_bytes(data[: len(data) // 2])
    with pytest.raises(BagError, match="recover"):
        replay(bag)


@pytest.mark.slow
def test_a_table_says_that_it_is_a_sample_and_when_a_task_became_active(replay, bag):
    _, text, rows = replay(bag)
    step = len(rows) // 20
    words = " ".join(text.split())
    assert f"{len(rows)} observations, one in {step} of them shown" in words
    first = next(row for row in rows if row["active_task"])
    after_s = (first["stamp"] - rows[0]["stamp"]) * 1e-9
    assert f"became active: task_1 after {after_s:.2f} s" in words
