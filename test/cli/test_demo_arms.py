# SPDX-License-Identifier: Apache-2.0
"""Several arms in the demo, sessions of a cell, and pours."""

import json
import re
from itertools import product

import numpy as np
import pytest
from kinematics.trees import TREES, urdf

from intent_recognition.bags import BagReader
from intent_recognition.cli import demo
from intent_recognition.cli.demo_scene import CELL_BOXES
from intent_recognition.cli.main import main
from intent_recognition.evaluation.session_summary import InteractionRecord
from intent_recognition.kinematics import Bodies, parse_boxes
from intent_recognition.motion import parse_places
from intent_recognition.nodes.graph import RECOGNITION
from intent_recognition.signals import homogeneous
from sim_bridge.arm import find_robot
from sim_bridge.coworker.styles import STYLES
from sim_bridge.handover import with_fingers
from sim_bridge.scenarios.toolbox import arm_posture, handover_point, handover_rotation


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Run the demo without its nodes; returns its exit code and the sessions asked for."""
    asked = []

    def session(args, scene, console):
        asked.append((args.arm, args.output, scene))
        found = "plate_handover" if args.arm != "xarm" else "none"
        error = {"lwr": 0.01, "iiwa": 0.03}.get(args.arm)
        record = InteractionRecord(1, "plate_handover", found, 40, 0.4, 0.2, error, None, 2.0)
        return [record], {"arm": args.arm}

    monkeypatch.setattr(demo, "_run_one", session)

    def start(*arguments, tasks=("--task-list", "plate_handover")):
        given = ("--headless", *(tasks or ()), "--output", str(tmp_path / "out"))
        return main(["demo", *given, *arguments]), asked

    return start


@pytest.mark.slow
def test_each_arm_has_its_session_and_all_have_one_report(run, tmp_path, capsys):
    code, asked = run("--arm", "lwr,iiwa,xarm", "--json", str(tmp_path / "all.json"))
    assert code == 1  # one of three interactions was missed
    assert [(arm, output.name) for arm, output, _ in asked] == [
        *(("lwr", "lwr"), ("iiwa", "iiwa"), ("xarm", "xarm"))
    ]
    by_joints, by_hand, _ = (scene for *_, scene in asked)
    assert (by_joints.dofs, by_hand.dofs) == ("", "config/dofs_hand.yaml")
    assert by_hand.arguments["hand_link"] == "grip"  # between the fingers that it was given
    last = capsys.readouterr().out.strip().splitlines()[-1]
    assert last.startswith("summary: recognised 2/3, decided before the end 2/3, hand error 2.0 ")
    numbers = json.loads((tmp_path / "all.json").read_text(encoding="utf-8"))
    assert list(numbers["arms"]) == ["lwr", "iiwa", "xarm"]
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    for cell in (">lwr<", ">1/1<", ">0/1<", ">1.0<", ">3.0<"):
        assert cell in page, cell


@pytest.mark.parametrize("arm", ["panda", "lwr"])
def test_in_the_assembly_an_arm_is_in_a_persons_place(run, arm):
    code, ((name, _, scene),) = run(
        *("--scenario", "assembly", "--arm", arm, "--task-list", "fastening,hand_over")
    )
    assert (code, name, scene.graph) == (0, arm, "assembly")
    assert scene.arguments == {"arm": arm, "task_list": "fastening,hand_over"}
    assert scene.own["primitive_activation"]["hand_link"]
    hands = scene.scorings[""].hand_of(np.array([scene.own["primitive_activation"]["home"]]))
    np.testing.assert_allclose(hands[0], scene.scorings[""].home_m, atol=1e-6)
    goals = [one.goal_m for one in scene.plans[""].interactions]
    away = np.linalg.norm(scene.scorings[""].places_m - goals, axis=1)
    assert np.all((away > 0.05) & (away < 0.4))  # beside the worker's wrist, not where it is


@pytest.mark.parametrize(
    ("tree", "length_m", "options", "tip", "where", "reached"),
    [
        ("ur", 0.16, (), "tool0", [0.0, 0.0, 0.0], ""),
        ("so100", 0.09, (), "Fixed_Jaw", [0.5, -0.1, 0.15], ""),
        ("so100", 0.07, (), "Fixed_Jaw", [0.5, -0.1, 0.15], "reaches 4 of 5 places: "),
        ("pr2_right", 0.16, ("--base", "torso", "--tip", "r_palm"), "r_palm", [0.0, 0.0, 0.0], ""),
    ],
)
def test_an_arm_of_a_file_stands_where_it_reaches(
    run, tmp_path, tree, length_m, options, tip, where, reached
):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf(TREES[tree].branches, length_m=length_m))
    _, ((_, output, scene),) = run("--arm", str(path), *options)
    assert scene.own["arm_sim"]["base_position"] == where
    assert re.search(reached, scene.note) and bool(reached) == ("reaches" in scene.note)
    assert scene.arguments["hand_link"] == scene.own["arm_sim"]["tip"] == tip
    assert scene.arguments["arm"] == str(output / "arm.urdf")
    assert 'name="head_pan_joint" type="fixed"' in (output / "arm.urdf").read_text() or not options


def test_arms_of_one_name_and_a_robot_of_two_arms_are_refused(run, tmp_path, capsys):
    assert run("--arm", "a/robot.urdf,b/robot.urdf") == (1, [])
    assert "--arm: expected arms of different names, got a/robot" in capsys.readouterr().err
    path = tmp_path / "robot.urdf"
    path.write_text(urdf(TREES["baxter"].branches))
    assert run("--arm", str(path))[0] == 1
    assert "right_gripper or left_gripper" in capsys.readouterr().err


@pytest.mark.parametrize(("arm", "node"), [("lwr", "lwr_sim"), ("panda", "arm_sim")])
def test_nodes_know_the_plan_the_boxes_and_the_fingers(run, arm, node):
    code, ((*_, scene),) = run("--scenario", "cell", "--arm", arm, tasks=None)
    assert code == 0
    assert [len(plan.interactions) for plan in scene.plans.values()] == [10, 10]
    assert list(scene.plans) == list(scene.scorings) == ["anna", "ben"]
    for name in (node, "coworker_sim", "object_transfer", *RECOGNITION):
        assert scene.own[name]["persons"] == ["anna", "ben"]
    recorded = scene.own["bag_recorder"]["topics"]
    for topic in ("mocap/{}/wrist/pose", "coworker/{}/task", "intent/{}/next_task"):
        assert {topic.format(person) for person in ("anna", "ben")} <= set(recorded)
    assert "intent/active_person" in recorded and "intent/tasks" not in recorded
    assert scene.arguments["plan"].endswith("cell_plan.yaml")
    assert scene.arguments["transfers"]
    known = scene.own["primitive_activation"]
    assert {box.name for box in parse_boxes(known["boxes"])} == {"bin", "lamp"}
    assert scene.own[node]["boxes"] == known["boxes"]  # the arm keeps clear of what stands there
    assert known["clearance"] > 0.0
    assert known["person_dofs"] and len(parse_places(known["slow_at"])) == 2
    assert len(scene.own["object_transfer"]["fingers"]) == 2


def test_the_boxes_are_clear_of_where_the_lwr_hands_over():
    robot = with_fingers(find_robot("lwr"))
    boxes = parse_boxes(list(CELL_BOXES))
    bodies = Bodies(robot.description, robot.joint_names, boxes, clearance_m=0.02)
    for task, style in STYLES.items():
        for corner in product((-1.0, 1.0), repeat=3):
            goal = style.goal_centre_m + style.goal_half_width_m * corner
            q = arm_posture(homogeneous(handover_rotation(task), handover_point(task, goal)))
            assert not bodies.contacts(q[None]), (task, goal)


@pytest.mark.slow
@pytest.mark.long
def test_it_recognises_and_helps_and_a_step_is_done_when_its_object_has_changed_hands(
    tmp_path, toolbox_model, capfd
):
    """Of the toolbox: `make demo`."""
    files = ("--json", str(tmp_path / "numbers.json"), "--record", str(tmp_path / "bag"))
    session = ("--scenario", "cell", "--interactions", "1", "--model", str(toolbox_model))
    words = ("demo", "--headless", "--output", str(tmp_path / "out"), *session, *files)
    assert main(list(words)) == 0
    drawing, ended, last = capfd.readouterr().out.strip().splitlines()[-3:]
    numbers = json.loads((tmp_path / "numbers.json").read_text(encoding="utf-8"))
    assert numbers["settings"]["simulated time per real time"] > 0.0
    duration_s = numbers["settings"]["duration of the session [s, simulated]"]
    assert drawing == "drawing the report ..."
    assert ended.startswith(f"session of {duration_s:.0f} s in simulated time, report: ")
    assert last.startswith("summary: helped 1/1, recognised before the end 1/1, hand error ")
    (one,) = numbers["interactions"]
    assert one["person"] == "anna" and one["observations"] > 5
    assert one["task"] == one["recognised"] == one["believed"] == "plate_handover"
    assert one["hand_error_m"] < 0.06 and not one["wrong_helps"]
    assert one["handed_over"] and 0.0 < one["largest_force_n"] < 15.0
    assert "plate_handover" in (tmp_path / "out/report.html").read_text(encoding="utf-8")
    topic = "/intent/anna/next_task"
    told = [m.message for m in BagReader(tmp_path / "bag").messages([topic])]
    first, last = (dict(zip(m.name, m.position, strict=True)) for m in (told[0], told[-1]))
    assert first["plate_handover"] > 0.8  # nothing else may be first
    assert last["screw_handover"] > 0.3 > first["screw_handover"]  # what anna has done counts


@pytest.mark.slow
@pytest.mark.long
def test_one_pour_is_told(tmp_path, capfd):
    numbers = tmp_path / "numbers.json"
    asked = ["demo", "--scenario", "pouring", "--interactions", "1", "--headless"]
    assert main([*asked, "--output", str(tmp_path), "--json", str(numbers)]) == 0
    told = capfd.readouterr().out
    assert "espresso cup into big bowl" in told
    assert "balls spilled" in told.splitlines()[-1]
    (one,) = json.loads(numbers.read_text(encoding="utf-8"))
    assert one["caught"] + one["kept"] + one["spilled"] == one["balls"] == 40
    assert one["second_parameters"]["opening_radius_m"] > 0.09
    assert one["kept"] <= 8  # a tenth of the cup's volume
    assert one["spilled"] <= 2
