# SPDX-License-Identifier: Apache-2.0
"""Exchange of boxes with a MoveIt planning scene. Needs moveit_msgs."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Pose
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from shape_msgs.msg import SolidPrimitive

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import Box
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import orientation_array, position_array, to_pose
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.runtime import steady_timer

OFF, READ, OFFER, BOTH = "off", "read", "offer", "both"
MONITORED, CHANGES = "monitored_planning_scene", "planning_scene"
"""Topics on which move_group publishes its scene, and takes changes to it."""


class PlanningSceneLink:
    """Reads the objects of move_group as `boxes`, and offers it our own boxes.

    `use` is `OFF`, `READ`, `OFFER` or `BOTH`. Our own boxes are in the frame of the scene, and are
    not read back from it. Objects in another frame are rejected.

    Raises:
        ArgumentError: moveit_msgs is needed, but not installed.
    """

    def __init__(
        self, node: Node, diagnostics: Diagnostics, use: str, frame: str, own: Sequence[Box]
    ) -> None:
        self.boxes: tuple[Box, ...] = ()
        self._node, self._diagnostics, self._frame, self._own = node, diagnostics, frame, own
        self._things: dict[str, tuple[Box, ...]] = {}
        if use == OFF:
            return
        try:
            from moveit_msgs.msg import CollisionObject, PlanningScene
        except ImportError as error:
            cure = "Install ros-jazzy-moveit-msgs, or leave planning_scene off."
            raise ArgumentError.about("planning_scene", "moveit_msgs", "none", cure) from error
        self._scene_type, self._object_type = PlanningScene, CollisionObject
        if use in (READ, BOTH):
            node.create_subscription(PlanningScene, MONITORED, self.take, qos.STATE)
        if use in (OFFER, BOTH) and own:
            self._changes = node.create_publisher(PlanningScene, CHANGES, qos.STATE)
            steady_timer(node, 1.0, self._offer)  # repeated for late subscribers

    def take(self, scene: Any) -> None:
        """Take a `moveit_msgs/msg/PlanningScene`: a whole one, or changes to it."""
        if not scene.is_diff:
            self._things.clear()
        for thing in scene.world.collision_objects:
            self._change(thing)
        named = {box.name for box in self._own}
        self.boxes = tuple(
            box._replace(name=f"{name}_{k}" if len(boxes) > 1 else name)
            for name, boxes in self._things.items()
            if name not in named
            for k, box in enumerate(boxes)
        )

    def _change(self, thing: Any) -> None:
        kind, operation = self._object_type, thing.operation
        if operation == kind.REMOVE:
            for name in [thing.id] if thing.id else list(self._things):
                self._things.pop(name, None)
        elif operation == kind.MOVE:
            text = f"{thing.id} is moved without its shape: only whole objects are read"
            self._diagnostics.reject("moved_object", text)
        elif thing.header.frame_id not in ("", self._frame):
            text = f"{thing.id} in {thing.header.frame_id!r}, the scene's is {self._frame!r}"
            self._diagnostics.reject("unknown_frame", text)
        else:
            before = self._things.get(thing.id, ()) if operation == kind.APPEND else ()
            self._things[thing.id] = (*before, *enclosing_boxes(thing))

    def _offer(self) -> None:
        scene = self._scene_type(is_diff=True)
        scene.world.collision_objects = [self._object(box) for box in self._own]
        self._changes.publish(scene)

    def _object(self, box: Box) -> Any:
        thing = self._object_type(id=box.name, operation=self._object_type.ADD)
        thing.header.frame_id = self._frame
        thing.header.stamp = self._node.get_clock().now().to_msg()
        thing.pose = to_pose(np.array(box.center), np.array(box.quaternion))
        thing.primitives = [SolidPrimitive(type=SolidPrimitive.BOX, dimensions=list(box.size))]
        thing.primitive_poses = [Pose()]
        return thing


def enclosing_boxes(thing: Any) -> tuple[Box, ...]:
    """Boxes around the primitives and meshes of a `moveit_msgs/msg/CollisionObject`.

    A box stays as it is; a sphere, cylinder, cone or mesh is enclosed along its own axes. Shapes
    without an extent, or with numbers that are not finite, are left out.
    """
    found = []
    shapes = [
        (_primitive(shape), pose) for shape, pose in _pairs(thing.primitives, thing.primitive_poses)
    ]
    shapes += [(_mesh(shape), pose) for shape, pose in _pairs(thing.meshes, thing.mesh_poses)]
    for (center, size), pose in shapes:
        turn, turn_within = _rotation(thing.pose), _rotation(pose)
        within = position_array(pose) + turn_within.apply(center)
        place = position_array(thing.pose) + turn.apply(within)
        if np.all(np.isfinite([*place, *size])) and min(size) > 0.0:
            turned = (turn * turn_within).as_quat()
            found.append(Box(thing.id, tuple(place), tuple(size), tuple(turned)))
    return tuple(found)


def _pairs(shapes: Sequence[Any], poses: Sequence[Any]) -> Iterable[tuple[Any, Any]]:
    """Shapes with their poses; missing poses at the end are the identity."""
    return zip(shapes, [*poses, *[Pose()] * (len(shapes) - len(poses))], strict=False)


def _primitive(shape: SolidPrimitive) -> tuple[Floats, Floats]:
    """Centre and size of the box around a solid, (3,) each [m]."""
    first, second, third = [*(float(edge) for edge in shape.dimensions), 0.0, 0.0, 0.0][:3]
    size = {
        SolidPrimitive.BOX: (first, second, third),
        SolidPrimitive.SPHERE: (2 * first, 2 * first, 2 * first),
        SolidPrimitive.CYLINDER: (2 * second, 2 * second, first),
        SolidPrimitive.CONE: (2 * second, 2 * second, first),
    }.get(shape.type, (0.0, 0.0, 0.0))
    return np.zeros(3), np.array(size)


def _mesh(mesh: Any) -> tuple[Floats, Floats]:
    if not mesh.vertices:
        return np.zeros(3), np.zeros(3)
    points = np.array([(p.x, p.y, p.z) for p in mesh.vertices])
    lowest, highest = points.min(axis=0), points.max(axis=0)
    return (lowest + highest) / 2.0, highest - lowest


def _rotation(pose: Pose) -> Rotation:
    """Rotation of a pose; the identity if its quaternion was not filled, as in MoveIt."""
    quaternion = orientation_array(pose)
    usable = np.all(np.isfinite(quaternion)) and quaternion.any()
    return Rotation.from_quat(quaternion) if usable else Rotation.identity()
