# SPDX-License-Identifier: Apache-2.0
"""The cell that the page shows: bodies, furniture and the figure, as topics come in."""

from pathlib import PurePosixPath
from unittest.mock import call, patch

import numpy as np
import pytest
from dashboard.test_hostile_messages import Fed
from geometry_msgs.msg import PoseStamped
from kinematics.robots import lwr_urdf
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from intent_recognition.dashboard.cell import PathMarkers
from intent_recognition.dashboard.scene_file import load_scene
from intent_recognition.dashboard.server import WINDOW
from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.report import task_colours
from sim_bridge.scenarios.toolbox.scene import HOME, arm_posture, stand_pose

FOREARM = "/person/upper_body/upper_arm/forearm"
PLATE = "plate_handover"
WRIST = np.array([0.8, 0.05, 0.3])


@pytest.fixture
def fed(harness):
    """A page that hears its topics."""
    fed = Fed(harness)
    yield fed
    fed.page.close()


def shown(fed, name):
    """A thing of the scene."""
    return fed.page._server.scene._handle_from_node_name[name]


def pose(position):
    message = PoseStamped()
    place = message.pose.position
    place.x, place.y, place.z = map(float, position)
    return message


def joints(q):
    return JointState(name=list(JOINT_NAMES), position=list(map(float, q)))


def test_an_update_goes_out_in_one_transmission(fed, monkeypatch):
    fed.hear("/robot_description", String(data=lwr_urdf()))
    fed.hear("/joint_states", joints(HOME))
    buffer = fed.page._server._websock_server.get_message_buffer()
    grouped, push = [], buffer.push

    def counted(message):
        grouped.append(buffer.atomic_counter > 0)
        push(message)

    monkeypatch.setattr(buffer, "push", counted)
    for k in range(1, 20):
        fed.observe(1)
        grouped.clear()
        fed.now_s += 0.2 * k
        fed.state.take_joints(JOINT_NAMES, np.array(HOME) + 0.01 * k, fed.now_s)
        fed.state.person.take_wrist(WRIST + 0.01 * k, fed.now_s)
        fed.page.update()
        assert all(grouped)
        assert 10 < len(grouped) <= WINDOW


def test_a_task_of_the_model_keeps_its_colour_when_others_are_taught_and_undone(fed):
    def colours(labels, truth):
        chances = np.full(len(labels), 1.0 / len(labels))
        message = JointState(name=labels, position=chances, velocity=np.zeros(len(labels)))
        fed.hear("/coworker/task", String(data=truth))
        fed.hear("/intent/tasks", message)
        return fed.page._colours

    fed.hear("/coworker/task", String(data=PLATE))  # before any model
    first = colours(["hold", PLATE, "none"], PLATE)
    assert first == task_colours(["hold", PLATE])
    shown = colours(["hold", PLATE, "none"], "apple")  # not taught yet
    taught = colours(["apple", "hold", PLATE, "none"], "apple")
    assert shown == taught == taught | first
    more = colours(["all", "apple", "hold", PLATE, "none"], "")
    assert more == more | taught and len(set(more.values())) == len(more)
    assert colours(["all", "hold", PLATE, "none"], "") == {
        task: colour for task, colour in more.items() if task != "apple"
    }


def test_a_path_is_drawn_while_a_known_task_leads(fed):
    person = fed.state.person
    person.drawn = PathMarkers(*np.ones((2, 6, 3)))
    for p in (0.9, 0.1):
        person.drawn_at_s = fed.now_s
        message = JointState(name=[PLATE, "none"], position=[p, 1.0 - p], velocity=[0.0, 0.0])
        fed.hear("/intent/tasks", message)
        assert {shown(fed, n).visible for n in ("/predicted", "/tube", "/task")} == {p > 0.5}


def test_all_of_the_scene_is_drawn_and_the_figure_comes_with_the_wrist(fed):
    scene = load_scene("toolbox")
    for body in scene.bodies:
        np.testing.assert_allclose(shown(fed, f"/bodies/{body.name}").position, body.pose[:3, 3])
    assert shown(fed, "/furniture/table") and shown(fed, "/furniture/stand")
    assert not shown(fed, "/person").visible
    fed.hear("/mocap/wrist/pose", pose(WRIST))
    assert shown(fed, "/person").visible
    wrist = np.array([0.0, 0.0, scene.person.arm_m[1]])
    for name in (FOREARM, *map(str, list(PurePosixPath(FOREARM).parents)[:-1])):  # to the root
        frame = shown(fed, name)
        wrist = frame.position + Rotation.from_quat(np.roll(frame.wxyz, -1)).apply(wrist)
    np.testing.assert_allclose(wrist, WRIST, atol=5e-4)


def test_the_plate_goes_with_the_arm_that_fetched_it(fed):
    fed.hear("/robot_description", String(data=lwr_urdf()))
    fed.hear("/mocap/wrist/pose", pose(WRIST))
    fed.hear("/joint_states", joints(HOME))
    before = np.array(shown(fed, "/bodies/plate").position)
    fed.hear("/intent/active_task", String(data=PLATE))
    at_stand = arm_posture(stand_pose(PLATE))
    for share in np.linspace(0.0, 1.0, 4):
        fed.hear("/joint_states", joints(HOME + share * (at_stand - HOME)))
    away = stand_pose(PLATE)
    away[:3, 3] += [0.1, 0.1, 0.05]
    fed.hear("/joint_states", joints(at_stand))
    fed.hear("/joint_states", joints(arm_posture(away)))
    moved = np.array(shown(fed, "/bodies/plate").position) - before
    np.testing.assert_allclose(moved, [0.1, 0.1, 0.05], atol=0.01)


def test_the_truth_says_what_the_person_holds(fed):
    fed.hear("/mocap/wrist/pose", pose(WRIST))
    fed.hear("/coworker/task", String(data="hold_screwdriver"))
    fed.hear("/mocap/wrist/pose", pose(WRIST))
    fed.hear("/mocap/wrist/pose", pose(WRIST))
    at = shown(fed, "/bodies/screwdriver").position
    np.testing.assert_allclose(at, WRIST + [-0.1, 0.0, 0.0], atol=1e-3)


def test_a_slow_browser_gets_the_lights_before_what_they_shine_on(fed):
    """Shaders with shadows would be compiled for what comes before; who draws fast gets them."""
    server, scene = fed.page._server, fed.page._scene

    def lights():
        kept = list(server._websock_server.get_message_buffer().message_from_id.values())
        (at,) = (k for k, m in enumerate(kept) if type(m).__name__ == "EnableLightsMessage")
        floor = next(k for k, m in enumerate(kept) if getattr(m, "name", "") == "/floor")
        return kept[at].cast_shadow, at < floor

    assert lights() == (False, True)
    scene.lighten()
    scene.shade()
    assert lights() == (False, True)


def test_who_draws_fast_gets_shadows_until_somebody_slow_comes(fed):
    scene = fed.page._scene
    with patch.object(fed.page._server.scene, "configure_default_lights") as lights:
        scene.shade()
        scene.lighten()
        scene.shade()
    assert lights.mock_calls == [call(), call(cast_shadow=False)]
