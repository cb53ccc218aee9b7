# SPDX-License-Identifier: Apache-2.0
"""Assigns numbers to bodies: tables with a row per body and time, and lists of bodies."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, count
from typing import Any

import numpy as np

from intent_recognition.array_types import Integers
from intent_recognition.errors import first_of
from intent_recognition.tables.cells import Values
from intent_recognition.tables.table import MOST_COLUMNS, Table, check_columns

OF_BODY = re.compile(
    r"(?i)(?:rigid[_ ]?body|body(?:[_ ]?part)?|marker|joint|segment|landmark|key[_ ]?point|sensor"
    r"|tracker|tracking|track|tag|device|child(?:_frame)?|topic|port|tool|handle|station"
    r"|variable|field)(?:[_ ]?(?:name|type|id))?"
)
"""Names of the column that identifies the body, or the quantity, of a row."""
OF_AXIS = re.compile(r"(?i)axis|coord|coordinate|component|dim(?:ension)?")
"""Names of the column that identifies the axis of a row beside its body."""
OF_ANY = re.compile(
    r"(?i)name|id|object|hand|side|person|subject|agent|(?:marker|body|joint|landmark)[_ ]?index"
)
"""Further such names, if rows are in order of time; otherwise they may identify a recording."""
OF_MOMENT = re.compile(r"(?i)t|%?(?:time|stamp|frame|sec|nsec|nanosec|seq|date).*|header\..*")
"""Names of columns of a time rather than a body. Columns before that of the body may be, too, if
their values are the same for all bodies at a time."""
MOST_BODIES = 1000
"""Most bodies in a table; landmarks of a face and two hands are about 500."""
ROWS_A_MOMENT = 1.5
"""Least mean number of rows per time: two bodies, one of which is often hidden."""
SELDOM = 0.3
"""Least average share of rows with values in a column for identifying bodies by name or number, not
by place in a list: a tracker that renumbers bodies keeps each number for seconds only."""


def by_body(table: Table) -> Table:
    """Reshape a table with a column of bodies and several rows per time to columns `BODY.x`.

    A body without a row at a time was not measured then. Any other table is returned unchanged.
    """
    names, bare = table.names, [name.strip() for name in table.names]
    named = [k for of in (OF_BODY, OF_ANY) for k, n in enumerate(bare) if of.fullmatch(n)]
    named.sort(key=lambda k: bare[k].lower().endswith("type"))  # many bodies may have one type
    axis = [k for k, n in enumerate(bare) if named and OF_AXIS.fullmatch(n)][:1]
    axes = [a for a in table.read(axis) if len(_distinct(a)[0]) > 1] if axis else []
    axis = axis[: len(axes)]
    for which in named if len(names) > 2 else ():
        said = [k for k, n in enumerate(bare) if k < which or OF_MOMENT.fullmatch(n)]
        said = [k for k in said if k not in axis]
        texts, *columns = table.read([which, *said])
        bodies, body = _distinct(_joined([texts, *axes], ".") if axes else texts)
        if said and 1 < len(bodies) <= MOST_BODIES:
            break
    else:
        return table
    for column in chain(columns, map(_joined, [columns])):  # all: seconds with nanoseconds
        moments, moment = _distinct(column)
        unique = len(np.unique(moment * len(bodies) + body)) == len(body)
        if unique and len(body) >= ROWS_A_MOMENT * len(moments):
            break
    else:
        return _with_note(table, bodies, body)
    if not OF_BODY.fullmatch(bare[which]) and np.any(np.diff(moment) < 0):
        return table
    moment = _ranks(moments)[moment]
    first = np.unique(moment, return_index=True)[1]
    shared = [
        k for k, of in zip(said, columns, strict=True) if np.array_equal(of, of[first][moment])
    ]
    places: list[tuple[int, int | None]] = [(k, None) for k in shared]
    own = [k for k in range(len(names)) if k not in (which, *axis, *shared)]
    places += [(k, number) for number in range(len(bodies)) for k in own]

    def read(wanted: Sequence[int]) -> list[Values]:
        found = [places[k] for k in wanted]
        rows = dict(zip(own_of := sorted({k for k, _ in found}), table.read(own_of), strict=True))
        return [
            rows[k][first] if number is None else _at(rows[k], moment, body == number, len(first))
            for k, number in found
        ]

    wide = tuple(
        names[k] if b is None else re.sub(r"(?i)\.value$", "", f"{bodies[b]}.{names[k]}")
        for k, b in places
    )
    units = {n: table.units[k] for n, (k, _) in enumerate(places) if k in table.units}
    check_columns(table.source, len(wide))
    return replace(table, names=wide, read=read, counts=None, units=units, aliases={})


def _with_note(table: Table, bodies: Sequence[str], body: Integers) -> Table:
    """The table, with a note if rows of a few bodies alternate, each with its own times."""
    if not np.count_nonzero(np.diff(body)) > len(body) / 2 > len(bodies) or "" in bodies:
        return table
    note = (
        f"rows of {first_of(bodies, 4)} alternate, each at times of its own, and are read as one"
        " body. Write a file for each."
    )
    return replace(table, notes=(*table.notes, note))


def _distinct(values: Values) -> tuple[list[str], Integers]:
    """Distinct texts in order of appearance, and the index of each row's text (T,)."""
    numbers: dict[str, int] = {}
    rows = [numbers.setdefault(str(value).strip(), len(numbers)) for value in values.tolist()]
    return list(numbers), np.array(rows, dtype=np.int64)


def _joined(columns: Sequence[Values], between: str = " ") -> Values:
    """Each row of several columns, joined to one text (T,)."""
    return np.array([between.join(map(str, row)) for row in zip(*columns, strict=True)])


def _ranks(moments: Sequence[str]) -> Integers:
    """Ranks of times, or their order of appearance if they are not numbers."""
    try:
        return np.argsort(np.argsort(np.array(moments, np.float64), kind="stable"))
    except ValueError:
        return np.arange(len(moments))


def _at(values: Values, moment: Integers, rows: np.ndarray, count: int) -> Values:
    """Values of selected rows at the indices of their times; missing values elsewhere."""
    if values.dtype.kind not in "biuf":
        values = values.astype(object)
    elif np.count_nonzero(rows) < count:  # integers have no missing value
        values = values.astype(np.float64)
    missing = {"O": "", "f": np.nan}.get(values.dtype.kind, 0)
    made = np.full(count, missing, values.dtype)
    made[moment[rows]] = values[rows]
    return made


def of_records(frames: Sequence[Any], bodies: Sequence[str] = ()) -> dict[str, Values]:
    """Columns, such as `wrist.x`, of the numbers and texts in objects, one object per row.

    Lists with a list or an object for each of `bodies`, in their order, are of these.
    """
    rows = [dict(flat(frame, bodies=bodies)) for frame in frames]
    names = list(dict.fromkeys(name for row in rows for name in row))
    if sum(map(len, rows)) < SELDOM * len(rows) * len(names):  # changing names identify nobody
        rows = [dict(flat(frame, by_name=False, bodies=bodies)) for frame in frames]
        names = list(dict.fromkeys(name for row in rows for name in row))
    if not names or len(names) > MOST_COLUMNS:
        raise ValueError("no landmarks, and no rows of numbers by name")
    columns: dict[str, Values] = {}
    for name in names:
        cells = [row.get(name) for row in rows]
        are_numbers = all(cell is None or isinstance(cell, int | float) for cell in cells)
        columns[name] = np.array(cells, np.float64 if are_numbers else object)
    return columns


def flat(
    content: Any, name: str = "", by_name: bool = True, bodies: Sequence[str] = ()
) -> Iterator[tuple[str, Any]]:
    """Numbers and texts in nested mappings and lists, with their paths: `0`, `1.x`.

    In a list of mappings that name their bodies, paths use those names instead of indices, and in
    one of as many lists or mappings as there are `bodies` the names of these: `WRIST.x`.
    """
    if isinstance(content, dict | list):
        own = naming_key(content) if by_name and isinstance(content, list) else ""
        are_nested = isinstance(content, list) and all(isinstance(v, dict | list) for v in content)
        indices = bodies if are_nested and bodies and len(bodies) == len(content) else count()
        listed = [one[own] for one in content] if own else indices
        named = content.items() if isinstance(content, dict) else zip(listed, content, strict=False)
        for key, value in named:
            if indices is bodies and isinstance(value, list) and len(value) in (2, 3):
                value = dict(zip("xyz", value, strict=False))
            yield from flat(value, f"{name}.{key}" if name else str(key), by_name, bodies)
    elif name and isinstance(content, int | float | str | None):
        yield name, content


def listed_names(content: Any) -> list[str]:
    """Names of bodies that an object lists beside its rows, as under `joint_names`; else empty."""
    for key, listed in content.items() if isinstance(content, dict) else ():
        are_names = isinstance(listed, list) and all(isinstance(v, str) and v for v in listed)
        if are_names and OF_BODY.fullmatch(key.removesuffix("s")) and len({*listed}) == len(listed):
            return listed
    return []


def naming_key(listed: Sequence[Any]) -> str:
    """The key that names bodies in a list of mappings, each differently; "" if there is none."""
    keys = listed[0] if listed and isinstance(listed[0], dict) else ()
    for key in [k for of in (OF_BODY, OF_ANY) for k in keys if of.fullmatch(str(k))]:
        names = [one.get(key) if isinstance(one, dict) else None for one in listed]
        known = {str(name) for name in names if type(name) in (int, str)}
        if len(known - {""}) == len(listed):
            return str(key)
    return ""
