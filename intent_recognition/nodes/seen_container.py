# SPDX-License-Identifier: Apache-2.0
"""A seen container as messages: its warped parameters as a named vector, and its pose."""

import numpy as np
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from intent_recognition.errors import MessageError
from intent_recognition.nodes.conversions import orientation_array, position_array
from intent_recognition.warping import Emptying, PouringParameters, References, SeenContainer

PERCENTS = tuple(range(100, 0, -5))
"""Shares of the volume whose tilts are told [%]. Convention: between them 0.5 % of it are lost."""
EMPTY_NAME = "tilt_empty_rad"
_ENDINGS = ("_x", "_y", "_z")


def to_named_vector(header: Header, parameters: PouringParameters, holds: Emptying) -> JointState:
    """Parameters as a stamped named vector: a point has three entries, `_x`, `_y` and `_z`.

    What it holds is told as the tilts that leave 100, 95, .. 5 % (`tilt_leaving_50_percent_rad`).
    """
    message = JointState(header=header)
    for name, value in parameters._asdict().items():
        values = np.atleast_1d(value)
        endings = ("",) if len(values) == 1 else _ENDINGS
        message.name.extend(name + ending for ending in endings)
        message.position.extend(float(one) for one in values)
    message.name.extend(_leaving(percent) for percent in PERCENTS)
    message.position.extend(holds.tilt_leaving(0.01 * percent) for percent in PERCENTS)
    message.name.append(EMPTY_NAME)
    message.position.append(float(holds.empty_rad))
    return message


def seen_container(vector: JointState, pose: PoseStamped) -> SeenContainer:
    """What `object/parameters` and `object/pose` say of one container.

    Raises:
        MessageError: a parameter is missing or not finite, or the two are of different frames.
    """
    if vector.header.frame_id != pose.header.frame_id:
        got = f"{vector.header.frame_id!r} and {pose.header.frame_id!r}"
        cure = "Publish both in one frame."
        raise MessageError.about("frames of parameters and pose", "the same", got, cure)
    values = dict(zip(vector.name, vector.position, strict=False))

    def read(*names: str) -> NDArray[np.float64]:
        found = np.array([values.get(name, np.nan) for name in names])
        if not np.isfinite(found).all():
            missing = [name for name, one in zip(names, found) if not np.isfinite(one)]
            cure = "Take those of object_warper."
            raise MessageError.about("object/parameters", f"{missing[0]}", "none", cure)
        return found

    turn, place = orientation_array(pose.pose), position_array(pose.pose)
    if not (np.isfinite([*turn, *place]).all() and np.linalg.norm(turn) > 1e-6):
        cure = "Take that of object_warper."
        got = f"{place.tolist()}, {turn.tolist()}"
        raise MessageError.about("object/pose", "a finite place and a rotation", got, cure)
    scalars = read("opening_radius_m", "volume_m3", "height_m", "tilt_reference_rad")
    tilts = read(*(_leaving(percent) for percent in PERCENTS))
    shares = 0.01 * np.array(PERCENTS, dtype=np.float64)
    return SeenContainer(
        References(*scalars.tolist()),
        place,
        read(*("lip_point" + ending for ending in _ENDINGS)),
        Rotation.from_quat(turn).as_matrix()[:, 2],
        Emptying(tilts, shares, float(read(EMPTY_NAME)[0])),
    )


def _leaving(percent: int) -> str:
    return f"tilt_leaving_{percent}_percent_rad"
