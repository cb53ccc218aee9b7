# SPDX-License-Identifier: Apache-2.0
"""The file that says what stands in a cell: what is shipped can be read, mistakes are one line."""

import numpy as np
import pytest
import yaml
from dashboard.browser import free_port
from scipy.spatial.transform import Rotation

from intent_recognition.cli.demo_scene import CELL_BOXES, CELL_PEOPLE
from intent_recognition.dashboard.node import main
from intent_recognition.dashboard.scene_file import load_scene
from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import parse_boxes
from sim_bridge.scenarios.toolbox.scene import STANDS_M, stand_pose

BOX = {"box": [0.1, 0.2, 0.3]}
TABLE = {"name": "table", "parts": [BOX]}
PLATE = TABLE | {"name": "plate", "task": "give", "grasp": [0.5, 0.0, 0.3]}
PERSON = {"stands": [1.4, 0.0]}


@pytest.fixture
def scene_of(tmp_path):
    """Reads a scene from its content."""

    def read(content):
        path = tmp_path / "cell.yaml"
        path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
        return load_scene(path)

    return read


def test_the_shipped_scene_is_that_of_the_simulation():
    scene = load_scene("toolbox")
    bodies = {body.task: body for body in scene.bodies}
    for task, hand in STANDS_M.items():
        np.testing.assert_allclose(bodies[task].grasp, hand, atol=1e-12)
        ahead = bodies[task].pose[:3, 3] - hand
        np.testing.assert_allclose(np.cross(ahead, stand_pose(task)[:3, 2]), 0.0, atol=2e-3)
    assert bodies["hold_screwdriver"].brought_by == "person"
    assert scene.person is not None
    assert scene.furniture[0].name == "table"


def test_poses_are_as_in_a_urdf_and_what_is_left_out_is_nothing(scene_of):
    scene = scene_of({"furniture": [TABLE | {"xyz": [1, 2, 3], "rpy": [0.1, 0.2, 0.3]}]})
    (table,) = scene.furniture
    expected = Rotation.from_euler("ZYX", [0.3, 0.2, 0.1]).as_matrix()
    np.testing.assert_allclose(table.pose[:3, :3], expected, atol=1e-15)
    np.testing.assert_array_equal(table.pose[:3, 3], [1, 2, 3])
    assert (scene.person, scene.bodies, scene.floor_m) == (None, (), 0.0)


def table(**changed):
    return {"furniture": [TABLE | changed]}


def body(**changed):
    return {"bodies": [PLATE | changed]}


@pytest.mark.parametrize(
    ("content", "place"),
    [
        ("[", "a scene in YAML"),
        ("- 1", "cell.yaml: Expected object, got array"),
        ({"chairs": []}, "unknown field chairs"),
        ({"floor": float("nan")}, "floor: Expected float >= -100"),
        ({"furniture": [TABLE, TABLE]}, "table twice"),
        (table(name="a/b"), "furniture[0].name"),
        (table(parts=[]), "furniture[0].parts"),
        (table(parts=[{}]), "furniture[0].parts[0]"),
        (table(parts=[{"box": [1, 2, -1]}]), "parts[0].box[2]: Expected float > 0"),
        (table(parts=[BOX | {"sphere": 1}]), "parts[0]: Expected one of box, cylinder, sphere"),
        (table(parts=[BOX | {"colour": "red"}]), "colour"),
        (table(xyz=[1, 2, 1e300]), "furniture[0].xyz[2]"),
        (body(task=""), "bodies[0].task"),
        (body(brought_by="dog"), "bodies[0].brought_by: Invalid enum value 'dog'"),
        (body(brought_by="person"), "bodies[0]: Expected in_hand"),
        ({"person": {}}, "person: Object missing required field stands"),
        ({"people": {"anna": {}}}, "people.anna: Object missing required field stands"),
        ({"person": PERSON | {"height": 175}}, "person.height"),
        ({"person": PERSON | {"hand": "both"}}, "person.hand: Invalid enum value 'both'"),
    ],
)
def test_a_mistake_is_named_in_one_line(scene_of, content, place):
    with pytest.raises(ArgumentError) as caught:
        scene_of(content)
    assert place in str(caught.value) and "\n" not in str(caught.value)


def test_the_page_does_not_start_with_a_mistake_and_says_it_in_one_line(tmp_path, capfd):
    path = tmp_path / "cell.yaml"
    path.write_text("floor: low")
    assert main(["--ros-args", "-p", f"scene:={path}", "-p", f"port:={free_port()}"]) == 1
    told = capfd.readouterr().err.strip()
    assert "floor: Expected float, got str. See docs/dashboard.md." in told
    assert "\n" not in told


def test_a_name_that_is_not_shipped_says_which_are():
    with pytest.raises(ArgumentError, match="one of cell, toolbox, got kitchen"):
        load_scene("kitchen")
    with pytest.raises(ArgumentError, match="no such file"):
        load_scene("no/such.yaml")


def test_the_cell_is_the_toolbox_with_its_boxes_and_two_people():
    toolbox, cell = load_scene("toolbox"), load_scene("cell")
    assert [body.name for body in cell.bodies] == [body.name for body in toolbox.bodies]
    n = len(toolbox.furniture)
    assert [one.name for one in cell.furniture[:n]] == [one.name for one in toolbox.furniture]
    assert tuple(cell.people) == CELL_PEOPLE and not toolbox.people
    boxes = {box.name: box for box in parse_boxes(list(CELL_BOXES))}
    drawn = {thing.name: thing.parts[0] for thing in cell.furniture[n:]}
    assert drawn.keys() == boxes.keys()
    for name, part in drawn.items():
        assert part.box == boxes[name].size
        np.testing.assert_allclose(part.pose[:3, 3], boxes[name].center)
