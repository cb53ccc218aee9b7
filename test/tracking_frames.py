# SPDX-License-Identifier: Apache-2.0
"""The same recordings in the world and in a tracker's own frame."""

from pathlib import Path

import numpy as np
from model_builder import message_of, messages_of

from intent_recognition.bags import POSE, BagWriter
from intent_recognition.demonstrations import DofSpec
from intent_recognition.signals import Demonstration
from intent_recognition.tracking import RigidTransform, multiply_quaternions

TRACKER = "optitrack"
ENTRY = f"{TRACKER} 0.4 -0.3 1.1 0.1 0.7 -0.2 0.6"
IN_WORLD = RigidTransform(np.array([0.4, -0.3, 1.1]), np.array([0.1, 0.7, -0.2, 0.6]))
IN_TRACKER = IN_WORLD.inverse()


def as_tracked(fields: dict, frame: str = TRACKER) -> dict:
    """Fields of a pose in the world as the tracker sends them."""
    position, turn = fields["pose"]["position"], fields["pose"]["orientation"]
    moved = IN_TRACKER.apply([position.get(axis, 0.0) for axis in "xyz"])
    turned = np.array([turn.get(axis, 0.0) for axis in "xyzw"])
    turned = multiply_quaternions(IN_TRACKER.quaternion, turned)
    pose = {
        "position": dict(zip("xyz", moved.tolist(), strict=True)),
        "orientation": dict(zip("xyzw", turned.tolist(), strict=True)),
    }
    return {**fields, "header": {**fields["header"], "frame_id": frame}, "pose": pose}


def write_tracked(path: Path, recording: Demonstration, dofs: DofSpec, **options: str) -> Path:
    """As `write_recording`, with raw poses in the tracker's frame."""
    with BagWriter(path, {"task": recording.task}) as writer:
        for entry, stamp_ns, values in messages_of(recording, dofs):
            fields = message_of(entry, stamp_ns, values)
            if entry.type == POSE:
                fields = as_tracked(fields, **options)
            writer.write_message(entry.topic, entry.type, fields, stamp_ns)
    return path
