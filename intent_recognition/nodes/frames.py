# SPDX-License-Identifier: Apache-2.0
"""Input and output of frames on /tf and /tf_static. Idle if tf2_msgs is not installed."""

from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import Pose, TransformStamped
from rclpy.node import Node
from rclpy.publisher import Publisher

from intent_recognition.errors import IntentError
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns, to_stamp
from intent_recognition.nodes.parameters import declare
from intent_recognition.tracking import RigidTransform, TransformTree


def message_type() -> Any:
    """`tf2_msgs/msg/TFMessage`, or None if it is not installed."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        return None
    return TFMessage


def hear_frames(node: Node, tree: TransformTree, changed: Callable[[], object]) -> bool:
    """Keep a tree of transforms up to date; returns False without tf2_msgs."""
    if (kind := message_type()) is None:
        return False

    def take(message: Any, fixed: bool) -> None:
        for stamped in message.transforms:
            at, turn = stamped.transform.translation, stamped.transform.rotation
            try:
                pose = RigidTransform(
                    np.array([at.x, at.y, at.z]), np.array([turn.x, turn.y, turn.z, turn.w])
                )
            except IntentError:
                continue
            tree.add(
                stamped.header.frame_id,
                stamped.child_frame_id,
                stamp_ns(stamped),
                pose,
                fixed=fixed,
            )
        changed()

    node.create_subscription(kind, "/tf", lambda m: take(m, False), qos.TRANSFORMS)
    node.create_subscription(kind, "/tf_static", lambda m: take(m, True), qos.FIXED_TRANSFORMS)
    return True


class FrameOutput:
    """Publishes poses as frames, while somebody listens."""

    def __init__(self, node: Node) -> None:
        self._publisher: Publisher | None = None
        wanted = declare(node, "frames")["broadcast_frames"]
        self._type: Any = message_type() if wanted else None
        if self._type is not None:
            self._publisher = node.create_publisher(self._type, "/tf", qos.TRANSFORMS)
            self._fixed = node.create_publisher(self._type, "/tf_static", qos.FIXED_TRANSFORMS)

    @property
    def heard(self) -> bool:
        """Whether anybody listens to /tf."""
        return self._publisher is not None and self._publisher.get_subscription_count() > 0

    def send(self, time_ns: int, parent: str, child: str, pose: Pose) -> None:
        """Publish the pose of the frame `child` in `parent` at a time [ns]."""
        if self._publisher is not None and self.heard and parent:
            stamped = [_stamped(time_ns, parent, child, pose)]
            self._publisher.publish(self._type(transforms=stamped))

    def send_fixed(self, time_ns: int, parent: str, poses: dict[str, Pose]) -> None:
        """Publish the poses of fixed frames, once."""
        if self._publisher is not None and poses:
            stamped = [_stamped(time_ns, parent, child, pose) for child, pose in poses.items()]
            self._fixed.publish(self._type(transforms=stamped))


def _stamped(time_ns: int, parent: str, child: str, pose: Pose) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.stamp, message.header.frame_id = to_stamp(time_ns), parent
    at = message.transform.translation
    at.x, at.y, at.z = pose.position.x, pose.position.y, pose.position.z
    message.transform.rotation = pose.orientation
    return message
