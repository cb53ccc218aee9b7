# SPDX-License-Identifier: Apache-2.0
"""Read motion capture: BVH, with computed joint positions, Xsens MVNX, and JSON of QTM."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.tables.cells import Values
from intent_recognition.tables.table import Table, check_columns, table_of, unusable
from intent_recognition.untrusted import MOST_ARRAYS, MOST_MESH, UntrustedError, check_regular

DEEPEST = 200
"""Longest accepted chain of joints from the root; that of a hand has 10."""


class _Joint(NamedTuple):
    """One joint: name, parent's index (-1 for a root), offset, channels and their first column."""

    name: str
    parent: int
    offset: Floats
    channels: tuple[str, ...]
    column: int


def open_bvh(path: Path) -> Table:
    """Read channels as `JOINT.Xrotation` [deg], and joint positions as `JOINT.x`, `JOINT.y`, ...

    BVH files do not state their unit of length, so the map must.
    """
    try:
        check_regular(path, MOST_MESH)
        text = path.read_text(encoding="utf-8", errors="replace")
        hierarchy, motion = re.split(r"^\s*MOTION\s*$", text, maxsplit=1, flags=re.MULTILINE)
        motion = motion.replace(",", ".")
        joints = _joints(hierarchy)
        count = int(re.search(r"Frames:\s*(\d+)", motion)[1])  # type: ignore[index]
        period, rows = re.split(r"Frame [Tt]ime:\s*", motion, maxsplit=1)[1].split("\n", 1)
        width = sum(len(joint.channels) for joint in joints)
        flat = np.array(rows.split(), np.float64)
        values = flat[: flat.size // width * width].reshape(-1, width)
        if len(values) > count:
            raise ValueError(f"{len(values)} of {count} frames")
        is_cut = flat.size < width * count
        rate = 1.0 / float(period) if float(period) > 0.0 else 0.0
        places_of = _places(joints, values)
    except (OSError, UntrustedError, ValueError, TypeError, IndexError, ZeroDivisionError) as error:
        raise unusable(path, "a BVH file", error, "Export it again as BVH.") from error
    check_columns(path, values.shape[1] + 3 * len(joints))
    channels = [f"{joint.name}.{channel}" for joint in joints for channel in joint.channels]
    places = [f"{joint.name}.{axis}" for joint in joints for axis in "xyz"]
    columns = np.hstack([values, *places_of])
    reach: list[float] = []  # along the bones from the root
    for joint in joints:
        bone = float(np.linalg.norm(joint.offset))
        reach.append(reach[joint.parent] + bone if joint.parent >= 0 else 0.0)
    degrees = {k: "deg" for k, name in enumerate(channels) if name.endswith("rotation")}
    return Table(
        path,
        (*channels, *places),
        lambda wanted: [columns[:, k] for k in wanted],
        units=degrees,
        reach=max(reach),
        limbs=len({*range(len(joints))} - {joint.parent for joint in joints}),
        must_say=True,
        defaults={"time": {"rate": rate}} if rate else {},
        notes=(f"{len(values)} of {count} frames: the file ends after them",) if is_cut else (),
    )


def _joints(hierarchy: str) -> list[_Joint]:
    words = iter(re.findall(r"(?:ROOT|JOINT)[^\S\n]+[^\n{]*[^\s{]|\S+", hierarchy))
    joints: list[_Joint] = []
    above: list[int] = []  # joints whose brackets are open; -1 for the end of a limb
    column, name = 0, ""
    for word in words:
        if word.startswith(("ROOT", "JOINT")):
            _, name = word.split(maxsplit=1)
        elif word == "End":
            name = ""
        elif word == "{":
            if len(above) > DEEPEST:
                raise ValueError(f"more than {DEEPEST} joints within one another")
            if name:
                parent = above[-1] if above else -1
                joints.append(_Joint(name, parent, np.zeros(3), (), column))
            above.append(len(joints) - 1 if name else -1)
        elif word == "}":
            above.pop()
        elif word == "OFFSET":
            offset = np.array([float(next(words)) for _ in range(3)])
            if above[-1] >= 0:
                joints[above[-1]] = joints[above[-1]]._replace(offset=offset)
        elif word == "CHANNELS":
            channels = tuple(next(words) for _ in range(int(next(words))))
            joints[above[-1]] = joints[above[-1]]._replace(channels=channels, column=column)
            column += len(channels)
    if not joints or not column:
        raise ValueError("no joints with channels")
    return joints


def _places(joints: list[_Joint], values: Floats) -> list[Floats]:
    """Position (T, 3) of each joint in the root's frame, applying rotations in channel order."""
    found: list[tuple[Floats, Rotation]] = []
    for joint in joints:
        own = values[:, joint.column : joint.column + len(joint.channels)]
        place = np.tile(joint.offset, (len(values), 1))
        turn = Rotation.identity(len(values))
        for channel, column in zip(joint.channels, own.T, strict=True):
            if channel.endswith("position"):  # in BVH, positions replace the offset
                place[:, "XYZ".index(channel[0])] = column
            else:
                turn = turn * Rotation.from_euler(channel[0], column[:, None], degrees=True)
        if joint.parent >= 0:
            origin, before = found[joint.parent]
            place, turn = origin + before.apply(place), before * turn
        found.append((place, turn))
    return [place for place, _ in found]


OF_SEGMENTS = {"position": "xyz", "orientation": "wxyz", "velocity": "xyz", "acceleration": "xyz"}
"""Quantities of each segment in a frame: [m], a unit quaternion, [m/s] and [m/s^2]."""
OF_JOINTS = {"jointAngle": ("abduction", "rotation", "flexion")}
"""Angles of each joint in a frame [deg], about x, y and z in Xsens' ZXY sequence."""
UNITS = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2", "jointAngle": "deg"}


def open_mvnx(path: Path) -> Table:
    """Read columns such as `RightHand.position.x`, `Head.orientation.w`, `jRightElbow.flexion`."""
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
                        if part.text and (key in OF_SEGMENTS or key in OF_JOINTS):
                            rows.setdefault(key, []).append(list(map(float, part.text.split())))
                element.clear()
        if not (count := len(rows.get("time", ()))):
            raise ValueError("no frame of a movement")
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


def of_qualisys(path: Path, content: Mapping[str, Any]) -> Table:
    """Markers and bodies of QTM [mm], stored in parts that each begin at a frame."""
    base = content["Timebase"]
    first, last = (int(base["Range"][key]) for key in ("Start", "End"))
    columns: dict[str, Values] = {}
    for one in (*content.get("Markers", ()), *content.get("RigidBodies", ())):
        places = np.full((last - first + 1, 3), np.nan)
        for part in one["Parts"]:
            rows = [v[0] if isinstance(v[0], list) else v for v in part["Values"]]  # a body's turns
            if rows:
                start = int(part["Range"]["Start"]) - first
                places[start : start + len(rows)] = np.array(rows, np.float64)[:, :3]
        columns |= {f"{one['Name']}.{axis}": places[:, k] for k, axis in enumerate("xyz")}
    defaults = {"time": {"rate": float(base["Frequency"])}}
    return table_of(path, columns, unit="mm", must_say=True, defaults=defaults)
