# SPDX-License-Identifier: Apache-2.0
"""MoveIt's planning scene: its things are boxes that the arm keeps clear of; ours are offered."""

import sys

import numpy as np
import pytest
from geometry_msgs.msg import Point
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from shape_msgs.msg import Mesh, SolidPrimitive

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import parse_boxes
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_pose
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.planning_scene import CHANGES, MONITORED, PlanningSceneLink

pytestmark = pytest.mark.slow
OWN = parse_boxes(["bench 0.5 0.0 -0.1 1.0 2.0 0.1 0.0 0.0 0.7071068 0.7071068"])
TURN = Rotation.from_euler("xyz", [0.3, -0.4, 1.2])


@pytest.fixture(scope="module")
def moveit(ros_interfaces):
    """moveit_msgs, as far as it is used."""
    ros_interfaces("moveit_msgs")
    import moveit_msgs.msg

    return moveit_msgs.msg


@pytest.fixture
def link(harness, moveit):
    node = harness.add(Node("owner"))
    return PlanningSceneLink(node, Diagnostics(node), "both", "world", OWN)


def pose(position=(0.0, 0.0, 0.0), rotation=None):
    return to_pose(np.array(position), (rotation or Rotation.identity()).as_quat())


def thing(moveit, name, kind=SolidPrimitive.BOX, dimensions=(0.1, 0.2, 0.3), frame="world", **more):
    made = moveit.CollisionObject(id=name, pose=pose((1.0, 2.0, 3.0), TURN), **more)
    made.header.frame_id = frame
    if dimensions:
        made.primitives = [SolidPrimitive(type=kind, dimensions=list(dimensions))]
        made.primitive_poses = [pose((0.1, 0.0, 0.0))]
    return made


def scene(moveit, *things, is_diff=True):
    made = moveit.PlanningScene(is_diff=is_diff)
    made.world.collision_objects = list(things)
    return made


def corners(points):
    return {tuple(np.round(point, 6)) for point in points}


@pytest.mark.parametrize(
    ("kind", "dimensions", "size"),
    [
        (SolidPrimitive.BOX, (0.1, 0.2, 0.3), (0.1, 0.2, 0.3)),
        (SolidPrimitive.SPHERE, (0.1,), (0.2, 0.2, 0.2)),
        (SolidPrimitive.CYLINDER, (0.4, 0.1), (0.2, 0.2, 0.4)),
        (SolidPrimitive.CONE, (0.4, 0.1), (0.2, 0.2, 0.4)),
    ],
)
def test_a_solid_is_enclosed_where_it_stands(link, moveit, kind, dimensions, size):
    link.take(scene(moveit, thing(moveit, "cup", kind, dimensions)))
    (box,) = link.boxes
    assert box.name == "cup"
    np.testing.assert_allclose(box.size, size)
    np.testing.assert_allclose(box.center, np.array([1.0, 2.0, 3.0]) + TURN.apply([0.1, 0, 0]))
    np.testing.assert_allclose(box.rotation, TURN.as_matrix(), atol=1e-12)


def test_a_mesh_is_enclosed_along_its_own_axes(link, moveit):
    """By its corners: those of the box are where the mesh's outermost points come to lie."""
    points = np.array([[x, y, z] for x in (0.0, 0.2) for y in (-0.1, 0.3) for z in (0.0, 0.5)])
    container = thing(moveit, "container", dimensions=None)
    container.meshes = [Mesh(vertices=[Point(x=x, y=y, z=z) for x, y, z in points.tolist()])]
    container.mesh_poses = [pose((0.0, 0.0, 0.2), TURN)]
    link.take(scene(moveit, container))
    (box,) = link.boxes
    expected = TURN.apply(TURN.apply(points) + [0.0, 0.0, 0.2]) + [1.0, 2.0, 3.0]
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    found = signs * np.array(box.size) / 2.0 @ box.rotation.T + box.center
    assert corners(found) == corners(expected)


def test_changes_add_remove_and_replace(link, moveit):
    kind = moveit.CollisionObject
    link.take(scene(moveit, thing(moveit, "a"), thing(moveit, "b")))
    link.take(scene(moveit, thing(moveit, "a", dimensions=(1.0, 1.0, 1.0))))
    assert [(box.name, box.size[0]) for box in link.boxes] == [("a", 1.0), ("b", 0.1)]
    link.take(scene(moveit, thing(moveit, "b", operation=kind.APPEND)))
    assert [box.name for box in link.boxes] == ["a", "b_0", "b_1"]
    link.take(scene(moveit, thing(moveit, "b", operation=kind.REMOVE)))
    assert [box.name for box in link.boxes] == ["a"]
    link.take(scene(moveit, thing(moveit, "c"), is_diff=False))
    assert [box.name for box in link.boxes] == ["c"]
    link.take(scene(moveit, thing(moveit, "", operation=kind.REMOVE)))
    assert link.boxes == ()


def test_what_cannot_be_used_is_left_out_and_counted(link, moveit):
    kind = moveit.CollisionObject
    bad = [
        thing(moveit, "elsewhere", frame="camera"),
        thing(moveit, "moved", operation=kind.MOVE),
        thing(moveit, "flat", dimensions=(1.0, 1.0, 0.0)),
        thing(moveit, "nan", dimensions=(1.0, 1.0, float("nan"))),
        thing(moveit, "short", dimensions=(1.0,)),
        thing(moveit, "empty", dimensions=None),
        thing(moveit, "bench"),  # ours, told back
    ]
    link.take(scene(moveit, *bad, thing(moveit, "good")))
    assert [box.name for box in link.boxes] == ["good"]
    assert link._diagnostics.rejected("unknown_frame") == 1
    assert link._diagnostics.rejected("moved_object") == 1


def test_what_is_offered_is_read_back_as_it_was(harness, link, moveit):
    offered = harness.collect(moveit.PlanningScene, CHANGES, qos.STATE)
    harness.spin_until(lambda: offered, what="our boxes")
    assert offered[0].is_diff
    other = PlanningSceneLink(link._node, link._diagnostics, "read", "world", ())
    told = harness.publisher(moveit.PlanningScene, MONITORED, qos.STATE)
    harness.connect(told, subscribers=2)
    told.publish(offered[0])
    harness.spin_until(lambda: other.boxes, what="the scene")
    (box,) = other.boxes
    assert box.name == OWN[0].name
    np.testing.assert_allclose(box.center, OWN[0].center)
    np.testing.assert_allclose(box.size, OWN[0].size)
    np.testing.assert_allclose(box.rotation, OWN[0].rotation, atol=1e-9)
    assert link.boxes == ()


def test_without_moveit_msgs_the_node_says_what_to_install(harness, monkeypatch):
    node = harness.add(Node("owner"))
    monkeypatch.setitem(sys.modules, "moveit_msgs.msg", None)
    with pytest.raises(ArgumentError, match="ros-jazzy-moveit-msgs"):
        PlanningSceneLink(node, Diagnostics(node), "read", "world", ())
    assert PlanningSceneLink(node, Diagnostics(node), "off", "world", ()).boxes == ()
