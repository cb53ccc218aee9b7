# SPDX-License-Identifier: Apache-2.0
"""Which body numbers are of: rows of a table for each body and moment, lists of bodies."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, count
from typing import Any

import numpy as np

from intent_recognition.array_types import Integers
from intent_recognition.errors import first_of
from intent_recognition.tables.cells import Values
from intent_recognition.tables.table import Table, check_columns

OF_BODY = re.compile(
    r"(?i)(?:rigid[_ ]?body|body(?:[_ ]?part)?|marker|joint|segment|landmark|key[_ ]?point|sensor"
    r"|tracker|tracking|track|tag|device|child(?:_frame)?|topic|port|tool|handle|station)"
    r"(?:[_ ]?(?:name|type|id))?"
)
"""The column that says which body a row is of."""
OF_ANY = re.compile(r"(?i)name|id|object|hand|side|person|subject|agent")
"""Likewise, where the rows of a moment follow one another; else a recording may be meant."""
OF_MOMENT = re.compile(r"(?i)t|%?(?:time|stamp|frame|sec|nsec|nanosec|seq|date).*|header\..*")
"""Columns that are of a moment, not of a body; so are those before the name of the body that say
the same of all."""
MOST_BODIES = 1000
"""Bodies of a table. Convention: landmarks of a face and two hands are some 500."""
ROWS_A_MOMENT = 1.5
"""Rows of a moment, on an average, at least. Convention: two bodies, one of which is often hidden.
"""


def by_body(table: Table) -> Table:
    """Columns `BODY.x` of a table that has a column of bodies and several rows for each moment.

    A body that is missing at a moment was not measured. Any other table is returned as it is.
    """
    names, bare = table.names, [name.strip() for name in table.names]
    named = [k for of in (OF_BODY, OF_ANY) for k, n in enumerate(bare) if of.fullmatch(n)]
    named.sort(key=lambda k: bare[k].lower().endswith("type"))  # many may be of one
    for which in named if len(names) > 2 else ():
        said = [k for k, n in enumerate(bare) if k < which or OF_MOMENT.fullmatch(n)]
        texts, *columns = table.read([which, *said])
        bodies, body = _distinct(texts)
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
    own = [k for k in range(len(names)) if k not in (which, *shared)]
    places += [(k, number) for number in range(len(bodies)) for k in own]

    def read(wanted: Sequence[int]) -> list[Values]:
        found = [places[k] for k in wanted]
        rows = dict(zip(own_of := sorted({k for k, _ in found}), table.read(own_of), strict=True))
        return [
            rows[k][first] if number is None else _at(rows[k], moment, body == number, len(first))
            for k, number in found
        ]

    wide = tuple(names[k] if b is None else f"{bodies[b]}.{names[k]}" for k, b in places)
    units = {n: table.units[k] for n, (k, _) in enumerate(places) if k in table.units}
    check_columns(table.source, len(wide))
    return replace(table, names=wide, read=read, counts=None, units=units, aliases={})


def _with_note(table: Table, bodies: Sequence[str], body: Integers) -> Table:
    """The table, with a note where rows of a few bodies alternate, each at times of its own."""
    if not np.count_nonzero(np.diff(body)) > len(body) / 2 > len(bodies) or "" in bodies:
        return table
    note = (
        f"rows of {first_of(bodies, 4)} alternate, each at times of its own, and are read as one"
        " body. Write a file for each."
    )
    return replace(table, notes=(*table.notes, note))


def _distinct(values: Values) -> tuple[list[str], Integers]:
    """Texts in the order in which they first come, and the number of that of each row (T,)."""
    numbers: dict[str, int] = {}
    rows = [numbers.setdefault(str(value).strip(), len(numbers)) for value in values.tolist()]
    return list(numbers), np.array(rows, dtype=np.int64)


def _joined(columns: Sequence[Values]) -> Values:
    """Each row of several columns as one text (T,)."""
    return np.array([" ".join(map(str, row)) for row in zip(*columns, strict=True)])


def _ranks(moments: Sequence[str]) -> Integers:
    """Numbers of moments by their times; by when they first come where these are no numbers."""
    try:
        return np.argsort(np.argsort(np.array(moments, np.float64), kind="stable"))
    except ValueError:
        return np.arange(len(moments))


def _at(values: Values, moment: Integers, rows: np.ndarray, count: int) -> Values:
    """The values of some rows at their moments; elsewhere they are missing."""
    if values.dtype.kind not in "biuf":
        values = values.astype(object)
    elif np.count_nonzero(rows) < count:  # whole numbers have no value for what is missing
        values = values.astype(np.float64)
    missing = {"O": "", "f": np.nan}.get(values.dtype.kind, 0)
    made = np.full(count, missing, values.dtype)
    made[moment[rows]] = values[rows]
    return made


def flat(content: Any, name: str = "", by_name: bool = True) -> Iterator[tuple[str, Any]]:
    """Numbers and texts in mappings and lists within one another, by their paths: `0`, `1.x`.

    Mappings in a list that say which body each is of are called so, not by their places.
    """
    if isinstance(content, dict | list):
        listed = _own_names(content) if by_name and isinstance(content, list) else count()
        named = content.items() if isinstance(content, dict) else zip(listed, content, strict=False)
        for key, value in named:
            yield from flat(value, f"{name}.{key}" if name else str(key), by_name)
    elif name and isinstance(content, int | float | str | None):
        yield name, content


def _own_names(listed: Sequence[Any]) -> Sequence[object]:
    """Different names or numbers that mappings have for themselves; of others their places."""
    keys = listed[0] if listed and isinstance(listed[0], dict) else ()
    for key in [k for of in (OF_BODY, OF_ANY) for k in keys if of.fullmatch(str(k))]:
        names = [one.get(key) if isinstance(one, dict) else None for one in listed]
        known = {str(name) for name in names if type(name) in (int, str)}
        if len(known) == len(listed):
            return names
    return range(len(listed))
