# SPDX-License-Identifier: Apache-2.0
"""`intent rehearse`: numbers, worst moments and suggestions, as text, JSON and page."""

import json

import pytest
from cli.recorded import DOFS, TRUTH
from model_builder import learned_model, perform, write_recording

from intent_recognition.errors import BagError, ModelError
from intent_recognition.model import save_model


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    """Bags to learn from, and others to rehearse, one of them with a wrong label."""
    folder = tmp_path_factory.mktemp("bags")
    for seed in range(16):
        write_recording(
            folder / "shown" / f"shown_{seed:02d}", perform(TRUTH, seed % 2, seed), DOFS
        )
    for seed in range(60, 63):
        task = "task_0" if seed == 61 else None
        recorded = perform(TRUTH, seed % 2, seed)
        write_recording(folder / "new" / f"new_{seed}", recorded, DOFS, task=task, group="anna")
    (folder / "dofs.yaml").write_text(
        "observed:\n  - {topic: /mocap/wrist/pose, type: geometry_msgs/msg/PoseStamped, fields:"
        " [pose.position.x, pose.position.y, pose.position.z], unit: m}\ncontrolled:\n"
        "  - {topic: /joint_states, type: sensor_msgs/msg/JointState, joints:"
        f" [{', '.join(DOFS.controlled[0].joints)}], unit: rad}}\n"
    )
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
    text = run_command("rehearse", model, bags / "shown")[1]
    assert "numbers flatter" in text and "left out nameless: it has no label" in text
    with pytest.raises(BagError, match=r"missing topic.* Give recordings of what the") as said:
        run_command("rehearse", model, "bags/assembly")
    assert "--dofs" not in str(said.value)


def test_a_model_without_statistics_cannot_be_rehearsed(run_command, tmp_path, bags):
    save_model(tmp_path / "bare.npz", learned_model(DOFS, TRUTH))
    with pytest.raises(ModelError, match="statistics"):
        run_command("rehearse", tmp_path / "bare.npz", bags / "new")
