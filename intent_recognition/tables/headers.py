# SPDX-License-Identifier: Apache-2.0
"""Multi-line headers that motion capture and simulators write above a table of text."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Any

from intent_recognition.tables.cells import is_number, with_point
from intent_recognition.tables.table import is_unit, without_subjects
from intent_recognition.tables.times import PER_UNIT, unit_of_times

OF_VICON = ("Trajectories", "Objects", "Segments", "Model Outputs", "Joints")
"""Titles of tables of Nexus and Tracker; the first of these that a file holds is read."""
QTM_UNITS = {"x": "mm", "y": "mm", "z": "mm", "Roll": "deg", "Pitch": "deg", "Yaw": "deg"}
"""Units of Qualisys, by the ends of names."""
QTM_KEY = re.compile(r"[A-Z]+(?:_[A-Z]+)+|DESCRIPTION|EVENT|FREQUENCY|REFERENCE|SCALE|SOLVER")
"""First cells of the lines of a header of Qualisys."""
OF_ALL, OF_BODY = ("scorer",), ("bodyparts",)
"""First cells of DeepLabCut's lines that name the scorer and the body parts."""
OF_RATES = {"Velocities": "/s", "Speeds": "/s", "Accelerations": "/s^2"}
"""Titles of OpenSim's files, and what they add to the units of the columns."""
OF_VECTORS = {"vec3": "xyz", "quaternion": "wxyz"}
"""OpenSim's types of cells with several numbers, and the names of these numbers."""
OF_LENGTHS = ("_tx", "_ty", "_tz", "_px", "_py", "_pz", "_X", "_Y", "_Z")
"""Ends of OpenSim's names of translations and positions."""
NUMBER = re.compile(r"[+-]?\d[\d.,]*(?:[eE][+-]?\d+)?|\d[\d:.,T /-]*")
"""A number or a time."""
AXIS = re.compile(r"(?i)(?:.*[\W_])?([xyz])(?:\s*[\[(][^\[\]()]*[\])])?")
"""The name of a coordinate: `x`, `pos_x`, `X (mm)`."""
Rows = Sequence[Sequence[str]]


@dataclass(frozen=True)
class Header:
    """The header of a table."""

    names: tuple[str, ...]
    skip: int  # rows before the numbers
    about: Mapping[str, Any] = field(default_factory=dict)  # further attributes of the `Table`
    ends_blank: bool = False  # whether a blank line ends the table
    commas: bool = False  # whether cells hold several numbers, separated by commas


def known_header(rows: Rows) -> Header | None:
    """The header of a file exported by a known motion capture program; None for other files."""
    for read in READERS:
        try:
            if header := read(rows):
                return header
        except (LookupError, ValueError, StopIteration):  # the file only begins like one
            continue
    return None


def motive(rows: Rows) -> Header | None:
    """OptiTrack Motive: `BODY.Position.X`, `BODY.Rotation.W`, `BODY:MARKER.Position.X`."""
    at = next(k for k, row in enumerate(rows) if row and row[0].strip() == "Frame")
    if rows[0][:1] != ["Format Version"] and rows[at][1].strip() != "Time (Seconds)":
        return None
    said = dict(pairwise(rows[0]))  # notes may have commas; the line may be left out
    heads = [row for row in rows[:at] if row[1:] and not row[0].strip() and any(row)]
    above = {row[1].strip(): row for row in heads if len(row) > 1}
    if not above.keys() & {"Name", "Type"}:  # before version 1.21 these rows have no names
        above = dict(zip(("Type", "Name"), heads, strict=False))
    bodies, sorts, kinds, axes = above["Name"], above.get("Type"), rows[at - 1], rows[at]
    names = [*axes[:2]]
    aliases: dict[str, int] = {}
    units: dict[int, str] = {}
    for k in range(2, len(axes)):
        body, kind, axis = (row[k].strip() for row in (bodies, kinds, axes))
        names.append(".".join(filter(None, (body, kind, axis))))
        if sorts:
            aliases[f"{sorts[k].strip()}/{names[-1]}"] = k
        if axes.count(axes[k]) == 1:
            aliases[axis] = k
        angles = kind == "Rotation" and said.get("Rotation Type", "").strip() != "Quaternion"
        if kind.startswith("Position") or angles:
            units[k] = "deg" if angles else said.get("Length Units", "").strip()
    rate = said.get("Export Frame Rate", said.get("Capture Frame Rate", ""))
    time = {"time": _clock(rows[at + 1 :], axes, rate)}
    about = {"aliases": aliases, "units": units, "defaults": time, "must_say": True}
    if said.get("Coordinate Space") == "Local":
        about["notes"] = ("Coordinate Space Local: places are in the frame of each parent",)
    return Header(tuple(names), at + 1, about)


def nexus(rows: Rows) -> Header | None:
    """Vicon Nexus and Tracker: `SUBJECT:MARKER.X`, `OBJECT:OBJECT.TX`, at the rate of the table."""
    title = next((k for k, row in enumerate(rows) if row and row[0].strip()), 0)
    if rows[title][0].strip().title() not in OF_VICON:
        return None
    at = next(k for k, row in enumerate(rows) if row[:1] in (["Frame"], ["Field #"]))  # of 1.x
    owner, names = "", [name for name in rows[at][:2] if name in ("Frame", "Field #", "Sub Frame")]
    for k in range(len(names), len(rows[at])):
        owner = (rows[at - 1][k].strip() if k < len(rows[at - 1]) else "") or owner
        names.append(f"{owner}.{rows[at][k].strip()}")
    below = [] if rows[at + 1][0].strip() else rows[at + 1]
    units = {k: unit.strip() for k, unit in enumerate(below) if unit.strip()}
    time = {"column": names[0], "unit": "samples", "rate": float(with_point(rows[title + 1][0]))}
    return _of_markers(names, at + 1 + bool(below), units, time, ends_blank=True)


def trc(rows: Rows) -> Header | None:
    """TRC of OpenSim and Cortex: `MARKER.x`, with the rate and unit of its third line."""
    if rows[0][0].strip() != "PathFileType":
        return None
    said = dict(zip(rows[1], rows[2], strict=False))
    at = next(k for k, row in enumerate(rows) if row and row[0].strip() in ("Frame#", "Frame"))
    names = [name.strip() for name in rows[at][:2]]
    labels = [cell.strip() for cell in rows[at][2:]]
    if not any(labels[1::3]) and not any(labels[2::3]):  # each above its x
        labels = labels[::3]
    else:
        labels = [label for label in labels if label]
    below = [k for k, row in enumerate(rows) if k > at and any(map(str.strip, row))]
    first, skip = [*below, len(rows)][:2]
    axes = [cell.strip() for cell in rows[first]]
    numbered = {axis: k for k, axis in enumerate(axes)}  # X1, Y1, Z1, X2, ...
    if all(map(is_number, axes)):  # no line of axes: the names may hold them
        numbered, skip = {}, first
        names += labels if 2 * len(labels) > len(axes) - 2 else _places_of(labels)
    else:
        names += _places_of(labels[::3] if len(labels) == sum(map(bool, axes)) > 1 else labels)
    units = dict.fromkeys(range(2, len(names)), said.get("Units", "").strip())
    time = _clock(rows[skip:], names, said.get("DataRate", ""))
    return _of_markers(names, skip, units, time, numbered)


def _places_of(labels: Sequence[str]) -> list[str]:
    """Columns `LABEL.x`, ... of markers; some may have no label, up to the last that has one."""
    count = max((k for k, label in enumerate(labels, 1) if label), default=0)
    known = [label or f"unlabelled_{k}" for k, label in enumerate(labels[:count], 1)]
    return [f"{label}.{axis}" for label in known for axis in "xyz"]


def qtm(rows: Rows) -> Header | None:
    """TSV of Qualisys: `MARKER.x` or `BODY.x`, with lengths in millimetres, angles in degrees."""
    if rows[0][0].strip() not in ("NO_OF_FRAMES", "FILE_VERSION"):
        return None
    said = {row[0].strip(): row for row in rows if row}
    skip = next(k for k, row in enumerate(rows) if row and not QTM_KEY.fullmatch(row[0].strip()))
    if "BODY_NAMES" in said or "SOLVER" in said:
        names, skip = _qtm_bodies(rows[skip]), skip + 1
    elif "DATA_TYPES" in said:  # velocities, angles, ... that were computed
        names = ["Frame", "Time", *filter(None, map(str.strip, said["DATA_TYPES"][1:]))]
    else:
        names = _places_of([label.strip() for label in said["MARKER_NAMES"][1:]])
        first = [cell.strip() for cell in rows[skip]]
        before = next((k for k, cell in enumerate(first) if cell.endswith(" X")), -1)
        skip += before >= 0 or first[0] == "Frame"
        stated = int(said.get("NO_OF_MARKERS", ("", "0"))[1])  # some may have no name
        if before < 0 and len(rows[skip]) >= max(3 * stated, len(names)) + 2:
            before, first = 2, ["Frame", "Time"]
        names = [*first[: max(before, 0)], *names]
    units = {k: QTM_UNITS.get(name.rpartition(".")[2], "") for k, name in enumerate(names)}
    rate = said["FREQUENCY"][1].strip()
    time = {"column": "Time"} if rate == "EXT" else {"rate": float(with_point(rate))}
    return _of_markers(names, skip, {k: unit for k, unit in units.items() if unit}, time)


def _qtm_bodies(cells: Sequence[str]) -> list[str]:
    """Columns of bodies: `BODY.x`, ..., `BODY.Roll`, ..., `BODY.Residual`, `BODY.Rot[0]`, ..., and
    of segments of skeletons, whose names stand above empty columns: `SEGMENT.x`, `SEGMENT.QX`, ...
    """
    body, before, names = "", "", []
    for cell in (cell.strip() for cell in cells):
        owner, _, axis = cell.rpartition(" ")
        body = (owner or before) if axis == "X" else body
        before = cell
        name = axis.lower() if axis in ("X", "Y", "Z") else cell
        names.append(f"{body}.{name}" if body and cell else cell)
    return names


def opensim(rows: Rows) -> Header | None:
    """MOT and STO of OpenSim: angles in degrees if it says so, translations in metres.

    Vectors and quaternions become columns `BODY.x`, ....
    """
    at = next((k for k, row in enumerate(rows) if row and row[0].strip() == "endheader"), None)
    if at is None:
        return None
    said = dict(row[0].strip().lower().split("=", 1) for row in rows[:at] if row and "=" in row[0])
    names = tuple(name.strip() for name in rows[at + 1])
    if axes := OF_VECTORS.get(said.get("datatype", "").strip()):
        names = (names[0], *(f"{name}.{axis}" for name in names[1:] for axis in axes))
        units = dict.fromkeys(range(1, len(names) * (axes == "xyz")), said.get("units", "").strip())
        header = _of_markers(names, at + 2, units, {"column": "time"})
        return replace(header, commas=True)
    angle = "deg" if said.get("indegrees", "").strip() == "yes" else "rad"
    per = OF_RATES.get(rows[0][0].strip(), "")
    units = {}
    for k, name in enumerate(names):
        state, slash, last = name.rpartition("/")  # /jointset/JOINT/COORDINATE/value, or speed
        coordinate = state if slash else name
        if "indegrees" in said and name != "time" and (not slash or last in ("value", "speed")):
            unit = "m" if coordinate.endswith(OF_LENGTHS) else angle
            units[k] = f"{unit}/s" if last == "speed" else unit + per
    return Header(names, at + 2, {"units": units, "defaults": {"time": {"column": "time"}}})


def levels(rows: Rows) -> Header | None:
    """Names in several lines with axes in the last, as in DeepLabCut and Visual3D: `BODY.x`."""
    has_number = (any(NUMBER.fullmatch(cell.strip()) for cell in row) for row in rows)
    at = next((k for k, found in enumerate(has_number) if found), 0)
    count = len(rows[at])
    heads = [[cell.strip() for cell in (*row, *[""] * count)[:count]] for row in rows[:at]]
    own = heads.pop()[0] if len(heads) > 2 and not any(heads[-1][1:]) else ""  # of pandas' index
    below = heads.pop() if len(heads) > 2 and all(map(is_unit, filter(None, heads[-1]))) else []
    axes = {match[1].lower() for cell in heads[-1:] for match in map(AXIS.fullmatch, cell) if match}
    if len(heads) < 2 or not {"x", "y"} <= axes:
        return None
    if len(heads) > 6 or not all(any(row[1:]) for row in heads):  # Visual3D's are five
        return None
    above = [_spread(row) for row in heads[:-1] if row[0].lower() not in OF_ALL]
    above = [row for row in above if len(set(row[1:])) > 1 or row[0].lower() in OF_BODY]
    firsts = [name for name in (own, *(row[0] for row in heads[::-1])) if name]  # `time` above `s`
    first = next((name for name in firsts if name not in PER_UNIT), "".join(firsts[:1]))
    names = [".".join(filter(None, (row[k] for row in (*above, heads[-1])))) for k in range(count)]
    names = [first, *names[1:]] if first else names
    units = {k: unit for k, unit in enumerate(below) if unit}
    units = units or ({0: heads[-1][0]} if unit_of_times(heads[-1][0]) else {})
    return Header(tuple(names), at, {"must_say": True, "units": units})


def _clock(rows: Rows, names: Sequence[str], rate: str) -> dict[str, object]:
    """Where times are: in the second column or, if blank or repeated, in frames at the rate."""
    times = [row[1].strip() for row in rows if row[1:] and row[0].strip()]
    if rate.strip() and ("" in times or len({*times}) < len(times)):
        return {"column": names[0], "unit": "samples", "rate": float(with_point(rate))}
    return {"column": names[1]}


def _spread(row: Sequence[str]) -> list[str]:
    """Repeat the label of a group, given in its first cell only, in each of its cells."""
    spread = [*row[:1]]
    for cell in row[1:]:
        spread.append(cell or (spread[-1] if len(spread) > 1 else ""))
    return spread


def _of_markers(
    names: Sequence[str],
    skip: int,
    units: Mapping[int, str],
    time: Mapping[str, object],
    aliases: Mapping[str, int] = MappingProxyType({}),
    ends_blank: bool = False,
) -> Header:
    """A header whose units must be known, and whose names need no subject."""
    about = {"aliases": {**aliases, **without_subjects(names)}, "defaults": {"time": time}}
    return Header(tuple(names), skip, {**about, "units": units, "must_say": True}, ends_blank)


READERS: tuple[Callable[[Rows], Header | None], ...] = (motive, nexus, trc, qtm, opensim, levels)


def of_joint_states(row: Sequence[str]) -> tuple[str, ...]:
    """Columns of JointState as `ros2 topic echo --csv` writes it: names above, positions, ...."""
    texts = [k for k, cell in enumerate(row) if cell and not is_number(cell)]
    count = len(row) - 3
    joints = next((n for n in range(2, count) if texts and texts[-1] == 2 + n), 0)
    parts, more = divmod(count, joints) if joints else (0, 1)
    if more or not 2 <= parts <= 4 or texts[-joints:] != [*range(3, 3 + joints)]:
        return ()
    kinds = ("name", "position", "velocity", "effort")[:parts]
    numbers = (f"{kind}.{joint}" for kind in kinds for joint in row[3 : 3 + joints])
    return ("sec", "nanosec", "frame_id", *numbers)
