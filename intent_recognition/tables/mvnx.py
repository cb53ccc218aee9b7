# SPDX-License-Identifier: Apache-2.0
"""Xsens MVNX: segments and joints of a suit."""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from intent_recognition.tables.cells import Values
from intent_recognition.tables.table import Table, check_columns, table_of, unusable
from intent_recognition.untrusted import MOST_ARRAYS, UntrustedError, check_regular

OF_SEGMENTS = {"position": "xyz", "orientation": "wxyz", "velocity": "xyz", "acceleration": "xyz"}
"""What a frame has of each segment: [m], a unit quaternion, [m/s], [m/s^2]."""
OF_JOINTS = {"jointAngle": ("abduction", "rotation", "flexion")}
"""What a frame has of each joint [deg]: about x, y and z in Xsens' ZXY sequence."""
UNITS = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2", "jointAngle": "deg"}


def open_mvnx(path: Path) -> Table:
    """Columns such as `RightHand.position.x`, `RightHand.orientation.w`, `jRightElbow.flexion`."""
    names: dict[str, list[str]] = {"segment": [], "joint": []}
    rows: dict[str, list[list[float]]] = {}
    rate = 0.0
    try:
        check_regular(path, MOST_ARRAYS)
        for event, element in ET.iterparse(path, events=("start", "end")):
            tag = element.tag.rpartition("}")[2]
            if event == "start":
                if tag == "subject" and rate:
                    raise unusable(path, "one person", "several", "Export each by itself.")
                rate = float(element.get("frameRate") or 0.0) if tag == "subject" else rate
            elif tag in names and element.get("label"):
                names[tag].append(str(element.get("label")))
            elif tag == "frame":
                if element.get("type", "normal") == "normal":
                    rows.setdefault("time", []).append([float(element.get("time", "nan"))])
                    for part in element:
                        key = part.tag.rpartition("}")[2]
                        if key in OF_SEGMENTS or key in OF_JOINTS:
                            rows.setdefault(key, []).append(list(map(float, part.text.split())))
                element.clear()
        count = len(rows["time"])
    except (OSError, UntrustedError, ET.ParseError, ValueError, AttributeError, KeyError) as error:
        raise unusable(path, "an MVNX file", error, "Export it again from MVN.") from error
    columns: dict[str, Values] = {"time": np.array(rows.pop("time"))[:, 0]}
    units = {0: "ms"}
    for key, values in rows.items():
        owners = names["segment"] if key in OF_SEGMENTS else names["joint"]
        parts = OF_SEGMENTS.get(key) or OF_JOINTS[key]
        array = np.array(values) if len({len(row) for row in values}) == 1 else np.empty(0)
        if array.shape != (count, len(owners) * len(parts)):
            got = f"{key} of shape {array.shape} for {len(owners)} of them in {count} frames"
            raise unusable(path, "an MVNX file", got, "Export it again from MVN.")
        check_columns(path, len(columns) + array.shape[1])
        for k, column in enumerate(array.T):
            owner, part = owners[k // len(parts)], parts[k % len(parts)]
            middle = "" if key in OF_JOINTS else f"{key}."
            units[len(columns)] = UNITS.get(key, "")
            columns[f"{owner}.{middle}{part}"] = column
    time: dict[str, object] = {"column": "time", "unit": "ms"}
    if not np.all(np.isfinite(columns["time"])):
        time = {"rate": rate}
    return table_of(path, columns, units=units, defaults={"time": time})
