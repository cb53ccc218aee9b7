# SPDX-License-Identifier: Apache-2.0
"""Read the markers of a C3D file."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np

from intent_recognition.errors import optional
from intent_recognition.tables.isolated import read_isolated
from intent_recognition.tables.table import Table, unusable, without_subjects

SLOWEST_HZ, FASTEST_HZ = 0.1, 1e5
"""Range of plausible rates in a header; other values mean that no rate was written."""


def open_c3d(path: Path) -> Table:
    """Read markers as columns `LABEL.x`, `LABEL.y`, `LABEL.z`, NaN where a marker was not seen.

    Rate and units come from the file, also of angles and forces that models of Vicon add as points.
    Analog channels are not read, nor rotations of poses (Theia).
    """
    if find_spec("c3d") is None:
        optional("ezc3d")
    found = read_isolated("c3d_reading.py", path, "a C3D file", ("ezc3d", "c3d"))
    points, read, said = found["points"], len(found["points"]), int(found["said"])
    if read > said > 0:  # frames up to the end of the last block, which is padded with zeros
        some = np.flatnonzero(np.any(points[said:] != 0.0, axis=(1, 2)))[-1:] + 1
        points = points[: said + int(some.sum())]
    count, rate = points.shape[1], float(found["rate"])
    if not count:
        cure = "Export the markers; forces and angles as CSV."
        raise unusable(path, "markers", "none: analog channels are not read", cure)
    own = [*found["labels"].tolist(), *[""] * count][:count]
    labels = [_text(label) or f"unlabelled_{k}" for k, label in enumerate(own)]
    notes = []
    if 0 < read < said:
        ends = read >= int(found["room"])
        why = "the file ends after them" if ends else "its parameters state no more"
        notes.append(f"{read} of {said} frames: {why}")
    header_rate = float(found["header_rate"])
    if SLOWEST_HZ < header_rate < FASTEST_HZ and abs(header_rate - rate) > 1e-3 * rate:
        notes.append(f"header: {header_rate:.6g} Hz, POINT:RATE: {rate:.6g} Hz, which is used")
    time = {"time": {"rate": rate}} if rate > 0.0 and np.isfinite(rate) else {}
    values = points.reshape(len(points), 3 * count)
    names = tuple(f"{label}.{axis}" for label in labels for axis in "xyz")
    return Table(
        path,
        names,
        lambda wanted: [values[:, k] for k in wanted],
        aliases=without_subjects(names),
        unit=str(found["unit"]).strip(),
        units={k: unit for k, unit in enumerate(np.repeat(found["units"], 3).tolist()) if unit},
        must_say=True,
        defaults=time,
        notes=tuple(notes),
    )


def _text(label: str) -> str:
    written = label.encode("utf-8", "surrogateescape")
    try:
        return written.decode()
    except UnicodeDecodeError:
        return written.decode("latin-1")
