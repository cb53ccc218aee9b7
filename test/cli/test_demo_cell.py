# SPDX-License-Identifier: Apache-2.0
"""The demo's cell: a work plan, boxes, and objects that change hands by force, at once."""

import json
import subprocess
import sys

import pytest

from intent_recognition.bags import BagReader
from intent_recognition.cli import demo
from intent_recognition.cli.main import main
from intent_recognition.evaluation.session_summary import InteractionRecord
from intent_recognition.kinematics import parse_boxes

END_S = 900.0


@pytest.mark.parametrize(("arm", "node"), [("lwr", "lwr_sim"), ("panda", "arm_sim")])
def test_nodes_know_the_plan_the_boxes_and_the_fingers(monkeypatch, tmp_path, arm, node):
    asked = []

    def session(args, scene, console):
        asked.append(scene)
        return [
            InteractionRecord(1, "plate_handover", "plate_handover", 40, 0.4, 0.2, 0.0, None, 2.0)
        ], {}

    monkeypatch.setattr(demo, "_run_one", session)
    words = ("--headless", "--scenario", "cell", "--arm", arm, "--output", str(tmp_path))
    assert main(["demo", *words]) == 0
    (scene,) = asked
    assert len(scene.plan.interactions) == 20
    assert scene.arguments["plan"].endswith("cell_plan.yaml")
    assert scene.arguments["transfers"] == "true"
    known = scene.own["primitive_activation"]
    assert {box.name for box in parse_boxes(known["boxes"])} == {"bin", "lamp"}
    assert scene.own[node]["boxes"] == known["boxes"]  # the arm keeps clear of what stands there
    assert known["clearance"] > 0.0
    assert len(scene.own["object_transfer"]["fingers"]) == 2


@pytest.mark.slow
def test_a_step_of_the_plan_is_done_when_its_object_has_changed_hands(tmp_path, toolbox_model):
    files = ("--json", str(tmp_path / "numbers.json"), "--record", str(tmp_path / "bag"))
    session = ("--scenario", "cell", "--interactions", "1", "--model", str(toolbox_model))
    words = ("demo", "--headless", "--output", str(tmp_path / "out"), *session, *files)
    result = subprocess.run(
        [sys.executable, "-m", "intent_recognition.cli.main", *words],
        capture_output=True,
        text=True,
        timeout=END_S,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    numbers = json.loads((tmp_path / "numbers.json").read_text(encoding="utf-8"))
    (interaction,) = numbers["interactions"]
    assert interaction["task"] == interaction["recognised"] == "plate_handover"
    assert interaction["handed_over"] and 0.0 < interaction["largest_force_n"] < 15.0
    told = [m.message for m in BagReader(tmp_path / "bag").messages(["/intent/next_task"])]
    first, last = (dict(zip(m.name, m.position, strict=True)) for m in (told[0], told[-1]))
    assert first["plate_handover"] > 0.8  # nothing else may be first
    due = min(last["plate_handover"], last["screw_handover"])
    assert due > 0.3 > last["hold_screwdriver"]  # by habit alone another board has 0.05
