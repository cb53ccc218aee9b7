# SPDX-License-Identifier: Apache-2.0
"""Poses of tracker frames in the world as texts, as the node and the DOF file have them."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.tracking.settings import frame_name
from intent_recognition.tracking.transforms import RigidTransform

Extrinsics = dict[str, tuple[Floats, Floats]]
"""Position (3,) [m] and quaternion (4,) xyzw of each tracker frame in the world."""


def parse_extrinsics(entries: Sequence[str], argument: str = "extrinsics") -> Extrinsics:
    """Read entries 'frame x y z qx qy qz qw' [m, quaternion]; empty ones are ignored.

    Raises:
        ArgumentError: an entry does not have eight fields, a field is not a finite number, the
            quaternion is zero, or a frame occurs twice.
    """
    extrinsics: Extrinsics = {}
    known: set[str] = set()
    for index, entry in enumerate(entries):
        fields = entry.split()
        if not fields:
            continue
        frame, *numbers = fields
        pose = _pose(numbers)
        if pose is None or frame_name(frame) in known:
            expected = "one 'frame x y z qx qy qz qw' for each tracker frame"
            cure = "Give each frame once, metres and a quaternion."
            raise ArgumentError.about(f"{argument}[{index}]", expected, repr(entry), cure)
        known.add(frame_name(frame))
        extrinsics[frame] = pose
    return extrinsics


def _pose(numbers: Sequence[str]) -> tuple[Floats, Floats] | None:
    try:
        values = np.array([float(number) for number in numbers])
        RigidTransform(values[:3], values[3:])  # raises for what is no pose
    except ValueError:
        return None
    return values[:3], values[3:]
