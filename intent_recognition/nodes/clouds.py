# SPDX-License-Identifier: Apache-2.0
"""PointCloud2 messages to arrays and back."""

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from intent_recognition.errors import MessageError

TYPES = {
    PointField.INT8: "i1",
    PointField.UINT8: "u1",
    PointField.INT16: "i2",
    PointField.UINT16: "u2",
    PointField.INT32: "i4",
    PointField.UINT32: "u4",
    PointField.FLOAT32: "f4",
    PointField.FLOAT64: "f8",
}
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
    if (
        len(message.data) != expected
        or message.row_step < message.width * message.point_step
        or (n and message.point_step == 0)
    ):
        got = f"{len(message.data)} bytes, {n} points of {message.point_step}"
        cure = "Set width, height, point_step and row_step to what data holds."
        raise MessageError.about("data", f"{expected} bytes", got, cure)
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.row_step)
    rows = rows[:, : message.width * message.point_step].reshape(n, message.point_step)
    order = ">" if message.is_bigendian else "<"
    points = np.column_stack([_column(rows, fields[name], order) for name in POSITION])
    if not all(name in fields for name in NORMAL):
        return points, None
    return points, np.column_stack([_column(rows, fields[name], order) for name in NORMAL])


def to_labelled_cloud(
    header: Header, points: NDArray, normals: NDArray, labels: NDArray
) -> PointCloud2:
    """Message of points (n, 3), normals (n, 3) and labels (n,), 28 bytes a point."""
    names = [*POSITION, *NORMAL]
    table = np.zeros(len(points), [*((name, "<f4") for name in names), (LABEL, "<u4")])
    for index, name in enumerate(POSITION):
        table[name] = points[:, index]
        table[NORMAL[index]] = normals[:, index]
    table[LABEL] = labels
    fields = [
        PointField(name=name, offset=4 * index, datatype=PointField.FLOAT32, count=1)
        for index, name in enumerate(names)
    ]
    fields.append(PointField(name=LABEL, offset=24, datatype=PointField.UINT32, count=1))
    message = PointCloud2(
        header=header,
        height=1,
        width=len(points),
        fields=fields,
        is_bigendian=False,
        point_step=table.itemsize,
        row_step=table.itemsize * len(points),
        is_dense=True,
    )
    message.data = table.tobytes()
    return message


def _column(rows: NDArray, field: PointField, order: str) -> NDArray:
    """One field (n,) of all points as float64."""
    if field.datatype not in TYPES:
        cure = "Use FLOAT32."
        raise MessageError.about(f"field {field.name}", "a known type", field.datatype, cure)
    kind = np.dtype(order + TYPES[field.datatype])
    if field.offset + kind.itemsize > rows.shape[1]:
        cure = "Set offset and point_step to what data holds."
        got = f"offset {field.offset}"
        expected = f"inside a point of {rows.shape[1]} bytes"
        raise MessageError.about(f"field {field.name}", expected, got, cure)
    cells = np.ascontiguousarray(rows[:, field.offset : field.offset + kind.itemsize])
    with np.errstate(invalid="ignore"):  # bytes that are a signalling NaN
        return cells.view(kind)[:, 0].astype(float)
