# SPDX-License-Identifier: Apache-2.0
"""Markers of a C3D file."""

import warnings
from pathlib import Path

import numpy as np

from intent_recognition.errors import one_line, optional
from intent_recognition.tables.table import Table, Values, unusable


def open_c3d(path: Path) -> Table:
    """The markers as columns `LABEL.x`, `LABEL.y`, `LABEL.z`, NaN where a marker was not seen.

    Rate and unit are those of the file. Analog channels are not read.

    Raises:
        BagError: it is no C3D file.
        MissingPackageError: c3d is not installed.
    """
    c3d = optional("c3d")
    try:
        with path.open("rb") as stream, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that there is no analog channel
            reader = c3d.Reader(stream)
            rate = float(reader.point_rate)
            labels = [str(label).strip() for label in reader.point_labels]
            units = reader.get("POINT:UNITS")
            unit = str(units.string_array.ravel()[0]).strip() if units is not None else ""
            frames = [points for _, points, _ in reader.read_frames()]
            if len(frames) != reader.frame_count:
                raise EOFError(f"{len(frames)} of {reader.frame_count} frames")
        points = np.array(frames, np.float64).reshape(len(frames), -1, 5)
    except Exception as error:  # the library raises what it meets
        cure = "Export it again from the capture software."
        raise unusable(path, "a C3D file", one_line(error), cure) from error
    columns: dict[str, Values] = {}
    for k, label in enumerate(labels[: points.shape[1]]):
        seen = points[:, k, 3] >= 0.0  # a residual of -1 says that there is no point
        for axis, values in zip("xyz", points[:, k].T, strict=False):
            columns.setdefault(f"{label}.{axis}", np.where(seen, values, np.nan))
    return Table(
        path,
        tuple(columns),
        lambda wanted: {name: columns[name] for name in wanted},
        unit=unit,
        defaults={"time": {"rate": rate}} if rate > 0.0 else {},
    )
