# SPDX-License-Identifier: Apache-2.0
"""A first map from what a table holds: places, what moves, times, units."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from intent_recognition.bags import JOINT_STATE, NANOSECONDS, POSE
from intent_recognition.errors import BagError
from intent_recognition.signals import POSITION_FIELDS
from intent_recognition.tables.cells import numbers, texts, without_zeros
from intent_recognition.tables.file_kinds import FileKind, file_kinds
from intent_recognition.tables.files import find_tables
from intent_recognition.tables.scales import spelled
from intent_recognition.tables.table import Table
from intent_recognition.tables.times import PER_UNIT

READ_AT_ONCE = 50
"""Columns that are read together. Convention."""
STILL = 1e-9
"""Extent of a column, as a share of its size, below which it is constant. Convention: rounding."""
MOST_LISTED = 12
"""Columns of a kind that a comment lists. Convention."""
LEAST_SEEN = 0.5
"""Share of the rows that a body is seen in, below which it is only named. Convention."""
MOST_BODIES = 8
"""Bodies and joints that a suggestion has. Convention: a person is asked to delete the others."""
USUAL_PERIODS_S = 1e-3, 0.5
"""Steps between samples by which the unit of times is known [s]. Convention."""
TIME_NAME = re.compile(r"(?i)(^|[^a-z])(t|time|timestamp|stamp|secs?|seconds|zeit)([^a-z]|$)")
NO_JOINT = re.compile(
    r"(?i)stamp|secs?\b|header|vel|effort|torque|current|temp|force|quality|error"
)
"""What columns are called that move and are no position of a joint."""
JOINT = re.compile(r"(?:.*[./])?(?P<joint>[^./]+)[./](?:position|pos|q)$")
"""Columns that name their joint, such as `/joint_states/panda_joint1/position`."""
COUNT_NAME = re.compile(r"(?i)(frame|index|row|sample)#?$")
ELEMENTS = re.compile(r"(?i)^(?P<body>.*(pos|position|xyz|translation))\.(?P<element>\d+)$")
NO_PLACE = re.compile(r"(?i)rotation|orientation|velocity|acceleration")
PLACES = re.compile(r"^(?P<body>.*?)(?P<between>[._ ]?)(?P<axis>[xXyYzZ])$")
FARTHEST = {"m": 20.0, "rad": 4.0 * np.pi}
"""Beyond this a number is taken for another unit [m, rad]. Convention: a lab, two turns."""
FARTHEST_CM = 300.0
"""Centimetres beyond which numbers are millimetres [cm]. Convention: what a person reaches."""


class _Column(NamedTuple):
    """A column of numbers: its name, values, whether they change, and share of rows with one."""

    name: str
    values: NDArray[np.float64]
    moves: bool
    seen: float


def suggest_map(source: Path) -> str:
    """The text of a map of what is in a source, with comments; it is to be corrected.

    Recordings of several files, in a folder for each kind, get an entry for each kind.

    Args:
        source: file, folder or data set.

    Raises:
        BagError: nothing can be read.
    """
    kinds = file_kinds(source, find_tables(source))
    several = len(kinds) > 1
    parts = [_suggest(kind, kind.name if several else "") for kind in kinds]
    parts.sort(key=lambda part: not part.bodies)  # the person first
    entries = [entry for part in parts for entry in (*part.bodies, *part.others)]
    if not entries:
        place = str(kinds[0].table.source)
        raise BagError.about(place, "columns that move", "none", "Check the file.")
    others = [line for entry in entries[1:] for line in entry]
    lines = [
        *(f"# Suggested from {line}" for part in parts for line in part.told),
        "# Delete what is not needed, name the topics, move what the robot does to `controlled`.",
        *(f"# Note: {note}" for part in parts for note in part.notes),
        *_files(kinds),
        "observed:",
        *entries[0],
        *(["controlled:"] if others else []),
        *others,
        *parts[0].times,
        *parts[0].tasks,
        *(line for part in parts for line in part.left_out),
    ]
    return "\n".join(lines) + "\n"


class _Part(NamedTuple):
    """What a kind of file contributes to a map: lines."""

    told: list[str]
    notes: Sequence[str]
    bodies: list[list[str]]
    others: list[list[str]]
    times: list[str]
    tasks: list[str]
    left_out: list[str]


def _suggest(kind: FileKind, name: str) -> _Part:
    """The part of a kind of file, whose entries name it if it has a name."""
    table = kind.table
    columns, labels = _columns(table)
    time, time_note = _time(table, columns)
    used = {str(time.get("column", ""))}
    bodies = _bodies(columns)
    used |= {column for body in bodies.values() for column in body}
    joints = [c for c in columns.values() if c.moves and c.name not in used and not _counts(c)]
    others = [c.name for c in joints if NO_JOINT.search(c.name)]
    joints = [c for c in joints if c.name not in others]
    still = [c.name for c in columns.values() if not c.moves and c.name not in used]
    moving = [body for body, names in bodies.items() if any(columns[n].moves for n in names)]
    seldom = [b for b in moving if columns[bodies[b][0]].seen < LEAST_SEEN]
    markers = [b for b in moving if b not in seldom and _is_marker_of(b, moving)]
    moving = [b for b in moving if b not in (*seldom, *markers)]
    own = [f"    file: {_flow(name)}", f"    time: {_flow(time)}  # {time_note}"] if name else []
    found = [_body(table, columns, body, bodies[body]) + own for body in moving[:MOST_BODIES]]
    arm = [_joints(table, joints[:MOST_BODIES]) + own] if joints else []
    rows = max((column.values.size for column in columns.values()), default=0)
    left_out = []
    for title, names in (
        ("They do not move", still),
        ("They move, and are no positions", others),
        ("Markers of these bodies", markers),
        ("Seldom seen", seldom),
        ("More bodies that move", moving[MOST_BODIES:]),
        ("More columns that move", [c.name for c in joints[MOST_BODIES:]]),
    ):
        if names:
            more = [f"and {len(names) - MOST_LISTED} more"] if names[MOST_LISTED:] else []
            left_out.append(f"# {title}: {', '.join([*names[:MOST_LISTED], *more])}")
    return _Part(
        [f"{kind.first}: {rows} rows, {len(table.names)} columns."],
        table.notes,
        found,
        arm,
        [] if name else [f"time: {_flow(time)}  # {time_note}"],
        [*_of_texts(kind, labels)],
        left_out,
    )


def _files(kinds: Sequence[FileKind]) -> Iterator[str]:
    """The patterns of file names, where they tell the task or belong together."""
    if len(kinds) > 1:
        yield "files:  # of one recording"
        for kind in kinds:
            yield f"  {kind.name}: {_flow(kind.pattern)}"
    elif kinds[0].says_task:
        yield f"files: {_flow(kinds[0].pattern)}"


def _is_marker_of(body: str, bodies: Sequence[str]) -> bool:
    """Whether a body is a marker `BODY:MARKER` of another one."""
    owner, colon, _ = body.partition(":")
    return bool(colon) and any(other.split(".")[0] == owner for other in bodies)


def _columns(table: Table) -> tuple[dict[str, _Column], dict[str, list[str]]]:
    """Columns with a name of their own: those of numbers, and those of texts."""
    found: dict[str, _Column] = {}
    labels: dict[str, list[str]] = {}
    alone = [k for k, name in enumerate(table.names) if name and table.names.count(name) == 1]
    for start in range(0, len(alone), READ_AT_ONCE):
        part = alone[start : start + READ_AT_ONCE]
        for k, cells in zip(part, table.read(part), strict=True):
            name = table.names[k]
            try:
                values = numbers(cells, table.source, name)
            except (BagError, ValueError, TypeError):
                labels[name] = texts(cells)
                continue
            seen = values[np.isfinite(values)]
            if seen.size:
                moves = bool(np.ptp(seen) > STILL * max(1.0, float(np.abs(seen).max())))
                found[name] = _Column(name, values, moves, seen.size / values.size)
    return found, labels


def _counts(column: _Column) -> bool:
    """Whether a column counts rows, as frames and indices do."""
    by_one = bool(np.all(np.diff(column.values) == 1.0)) and column.values[0] in (0.0, 1.0)
    return by_one or bool(COUNT_NAME.search(column.name))


def _time(table: Table, columns: Mapping[str, _Column]) -> tuple[dict[str, object], str]:
    said = table.defaults.get("time")
    if isinstance(said, Mapping):
        rate = said.get("rate")
        return dict(said), f"the file says so{f', {rate:g} Hz' if isinstance(rate, float) else ''}"
    for column in columns.values():
        steps = np.diff(column.values)
        named = column.name == "0" or TIME_NAME.search(column.name)
        if not named or not steps.size or not np.all(steps > 0.0):
            continue
        for unit, per in PER_UNIT.items():
            period_s = float(np.median(steps)) * per / NANOSECONDS
            if USUAL_PERIODS_S[0] <= period_s <= USUAL_PERIODS_S[1]:
                return {"column": column.name, "unit": unit}, f"{1.0 / period_s:.4g} Hz then"
    return {"rate": 100}, "nothing in the file says when: give the rate in Hz"


def _bodies(columns: Mapping[str, _Column]) -> dict[str, list[str]]:
    """Columns x, y, z of each body."""
    found: dict[str, dict[str, str]] = {}
    for name in columns:
        if match := ELEMENTS.match(name):
            found.setdefault(match["body"], {})[match["element"]] = name
        match = PLACES.match(name)
        if match and not NO_PLACE.search(match["body"]):
            found.setdefault(match["body"], {})[match["axis"].lower()] = name
    return {
        body: [axes[a] for a in sorted(axes)]
        for body, axes in found.items()
        if set(axes) in (set("xyz"), set("012"))
    }


def _body(
    table: Table, columns: Mapping[str, _Column], body: str, names: Sequence[str]
) -> list[str]:
    values, _ = without_zeros(np.column_stack([columns[name].values for name in names]))
    extent = float(np.nanmax(np.nanmax(values, axis=0) - np.nanmin(values, axis=0)))
    unit, note = _unit(table, names[0], values, "m")
    topic = (
        re.sub(r"\W+", "_", re.sub(r"(?i)[._ ](position|pos)$|_t$", "", body)).strip("_").lower()
    )
    return [
        f"  - topic: /mocap/{topic or 'wrist'}/pose  # moves over {extent:.3g} {unit or 'm'}",
        f"    type: {POSE}",
        f"    fields: {_flow(list(POSITION_FIELDS))}",
        "    unit: m",
        f"    columns: {_flow(list(names))}",
        *([f"    columns_unit: {unit}  # {note}"] if unit else []),
    ]


def _joints(table: Table, joints: Sequence[_Column]) -> list[str]:
    found = [JOINT.fullmatch(joint.name) for joint in joints]
    called = [
        match["joint"] if match else joint.name for match, joint in zip(found, joints, strict=True)
    ]
    names = [re.sub(r"\W+", "_", name).strip("_") for name in called]
    values = np.column_stack([joint.values for joint in joints])
    unit, note = _unit(table, joints[0].name, values, "rad")
    return [
        "  - topic: /joint_states  # they move, and are no place of a body",
        f"    type: {JOINT_STATE}",
        f"    joints: {_flow(names)}",
        "    unit: rad",
        f"    columns: {_flow([joint.name for joint in joints])}",
        *([f"    columns_unit: {unit}  # {note}"] if unit else []),
    ]


def _unit(table: Table, name: str, values: NDArray[np.float64], base: str) -> tuple[str, str]:
    """Unit of columns, "" where it is that of the entry, and how it is known."""
    number = table.find(name)
    said = spelled(table.units.get(number if number is not None else -1, "") or table.unit)
    if said:
        return ("" if said == base else said), "the file says so"
    if table.must_say and base == "m":
        return "mm", "guessed: the usual unit of motion capture"
    farthest = float(np.nanmax(np.abs(values)))
    if farthest <= FARTHEST[base]:
        return "", ""
    unit = "deg" if base == "rad" else "cm" if farthest <= FARTHEST_CM else "mm"
    return unit, f"guessed: {farthest:.3g} {base} is too far"


def _of_texts(kind: FileKind, labels: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Where demonstrations begin, and what their label is."""
    table = kind.table
    for key in ("segments", "task"):
        if isinstance(said := table.defaults.get(key), Mapping):
            yield f"{key}: {_flow(dict(said))}  # the file says so"
    if "task" in table.defaults:
        return
    for name, values in labels.items():
        kinds = sorted(set(filter(None, values)))
        shown = ", ".join(kinds[:MOST_LISTED])
        yield f"# task: {_flow({'column': name})}  # it says: {shown}"[:200]
    if not labels and not kind.says_task:
        yield "task: give_it_a_name"


def _flow(content: object) -> str:
    text = yaml.safe_dump(content, default_flow_style=True, sort_keys=False, width=10**6)
    return text.strip().removesuffix("...").strip()
