# SPDX-License-Identifier: Apache-2.0
"""Messages of seen objects: point clouds, and parameters and pose of a container."""

import numpy as np
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState, PointCloud2, PointField
from std_msgs.msg import Header

from intent_recognition.array_types import Floats
from intent_recognition.errors import MessageError
from intent_recognition.nodes.conversions import orientation_array, position_array
from intent_recognition.warping import Emptying, PouringParameters, References, SeenContainer

TYPES = dict(enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"), PointField.INT8))
"""NumPy types by the constants of PointField, from INT8 to FLOAT64."""
POSITION = ("x", "y", "z")
NORMAL = ("normal_x", "normal_y", "normal_z")
LABEL = "label"


def cloud_arrays(message: PointCloud2) -> tuple[NDArray, NDArray | None]:
    """Points (n, 3) and normals (n, 3), None without normals; pixels without depth are NaN.

    Raises:
        MessageError: a field is missing or of no known type, or the sizes do not fit.
    """
    fields = {field.name: field for field in message.fields}
    if missing := [name for name in POSITION if name not in fields]:
        cure = "Publish x, y and z."
        raise MessageError.about("fields", "x, y, z", f"no {', '.join(missing)}", cure)
    n = message.width * message.height
    expected = message.row_step * message.height
    fits = len(message.data) == expected and message.row_step >= message.width * message.point_step
    if not fits or (n and message.point_step == 0):
        got = f"{len(message.data)} bytes, {n} points of {message.point_step}"
        cure = "Set width, height, point_step and row_step to what data holds."
        raise MessageError.about("data", f"{expected} bytes", got, cure)
    wanted = [*POSITION, *NORMAL] if all(name in fields for name in NORMAL) else [*POSITION]
    order = ">" if message.is_bigendian else "<"
    try:
        formats = [order + TYPES[fields[name].datatype] for name in wanted]
        offsets = [fields[name].offset for name in wanted]
        parts = {"names": wanted, "formats": formats, "offsets": offsets}
        layout = np.dtype(parts | {"itemsize": message.point_step})  # type: ignore[call-overload]
    except (KeyError, ValueError) as error:
        cure = "Use FLOAT32, and set offset and point_step to what data holds."
        expected = f"known types inside a point of {message.point_step} bytes"
        raise MessageError.about("fields", expected, error, cure) from error
    if not n:
        return np.empty((0, 3)), np.empty((0, 3)) if len(wanted) > 3 else None
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.row_step)
    table = np.ascontiguousarray(rows[:, : message.width * message.point_step]).view(layout)
    with np.errstate(invalid="ignore"):  # bytes that are a signalling NaN
        columns = np.column_stack([table[name].ravel().astype(float) for name in wanted])
    return columns[:, :3], columns[:, 3:] if len(wanted) > 3 else None


def to_labelled_cloud(
    header: Header, points: NDArray, normals: NDArray, labels: NDArray
) -> PointCloud2:
    """Message of points (n, 3), normals (n, 3) and labels (n,), 28 bytes a point."""
    kinds = {**dict.fromkeys((*POSITION, *NORMAL), "<f4"), LABEL: "<u4"}
    table = np.zeros(len(points), list(kinds.items()))
    for name, column in zip(kinds, (*points.T, *normals.T, labels), strict=True):
        table[name] = column
    types = {"<f4": PointField.FLOAT32, "<u4": PointField.UINT32}
    fields = [
        PointField(name=name, offset=4 * k, datatype=types[kind], count=1)
        for k, (name, kind) in enumerate(kinds.items())
    ]
    message = PointCloud2(header=header, height=1, width=len(points), fields=fields, is_dense=True)
    message.point_step, message.row_step = table.itemsize, table.nbytes
    message.data = table.tobytes()
    return message


PERCENTS = tuple(range(100, 0, -5))
"""Shares of the volume whose tilts are sent [%]; interpolating loses 0.5 % of it."""
EMPTY_NAME = "tilt_empty_rad"
_ENDINGS = ("_x", "_y", "_z")


def to_named_vector(header: Header, parameters: PouringParameters, holds: Emptying) -> JointState:
    """Parameters as a stamped named vector: a point has three entries, `_x`, `_y` and `_z`.

    The contents are given by the tilts that leave 100, 95, .. 5 % (`tilt_leaving_50_percent_rad`).
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
    """Read one container from `object/parameters` and `object/pose`.

    Raises:
        MessageError: a parameter is missing or not finite, or the two have different frames.
    """
    if vector.header.frame_id != pose.header.frame_id:
        got = f"{vector.header.frame_id!r} and {pose.header.frame_id!r}"
        cure = "Publish both in one frame."
        raise MessageError.about("frames of parameters and pose", "the same", got, cure)
    values = dict(zip(vector.name, vector.position, strict=False))

    def read(*names: str) -> Floats:
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
