# SPDX-License-Identifier: Apache-2.0
"""Columns of one file, their names and units."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from intent_recognition.array_types import Floats
from intent_recognition.errors import BagError, first_of
from intent_recognition.signals import UNITS, as_quotient, spelled
from intent_recognition.tables.cells import Values, scale_between
from intent_recognition.tables.times import unit_of_times

MOST_TEXT = 2**28
"""Largest accepted text file [bytes]. An hour of fifty columns at 100 Hz takes 0.2 GB as a CSV, an
hour of MediaPipe at 30 Hz 0.3 GB."""
MOST_COLUMNS = 10_000
"""Most columns of a table; a motion capture suit has several hundred."""
UNIT_IN_NAME = re.compile(
    r"(?i)(?:[\[(]|(?<=[xyz])_(?=m$)|[_ .,/-](?=(?:[mcdk\u00b5]m|px|deg(?:ree)?s?|rad(?:ian)?s?"
    r"|(?:milli|centi|deci)met(?:er|re)s?|inch(?:es)?|ft|feet)$))\s*([^\[\]()_\s]+)\s*[\])]?$"
)
"""The unit at the end of a column's name: `x [mm]`, `x (mm)`, `x_mm`, `x.mm`, `X MM`."""
NO_MOTION = r"(?:[mhk\u00b5]?(?:N|V|Pa)|N.?mm?|W|g|a\.u\.|dBm?|(?:deg|\u00b0)C)"
"""Units of forces, voltages, ... that sensors and models add to recordings of motion."""
OTHER_UNIT = re.compile(rf"(?i:\s\[[^\[\]\d]+\]|[(_ ./-](?:px|pixels?|%|km)\)?)$|\({NO_MOTION}\)$")
"""An unsupported unit at the end of a name, as in `x [V]`, `x (px)`, `x (N)`; not `x (left)`."""
ELEMENT = re.compile(r"(?:\.\d+)+$")
"""Indices at the end of the name of an array element."""


@dataclass(frozen=True)
class Table:
    """The columns of one file, which are read on demand."""

    source: Path  # the file, or the folder of a data set
    # names of all columns; a repeated name cannot be used to select a column
    names: tuple[str, ...]
    read: Callable[[Sequence[int]], Sequence[Values]]  # reads columns by index, each (T,) or (1,)
    # row numbers in the file of the rows that are read, from 0, if some are empty
    counts: Callable[[], Floats] | None = None
    aliases: Mapping[str, int] = field(default_factory=dict)  # column indices by further names
    unit: str = ""  # unit of all columns, "" if the file states none
    # units of single columns, by index; other columns may have a unit at the end of their name
    units: Mapping[int, str] = field(default_factory=dict)
    reach: float = 0.0  # length of a skeleton's longest chain of bones, in an unknown unit
    limbs: int = 0  # number of a skeleton's ends
    must_say: bool = False  # whether the map must give the unit if the file does not
    # settings found in the file, under the keys of a map: time, segments, task
    defaults: Mapping[str, object] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # oddities of the file, as sentences

    def columns(self, wanted: Sequence[str]) -> dict[str, Values]:
        """Read columns by name, or by index from 0 on; raises BagError if a column is missing."""
        names = list(dict.fromkeys(wanted))
        found = {name: self.find(name) for name in names}
        if missing := [name for name, number in found.items() if number is None]:
            expected = f"the columns of the map, {first_of(missing, 6)} among them"
            got = first_of([*dict.fromkeys(self.names)], 40) or "no columns"
            cure = "Correct the names in the map; --suggest writes one that has them."
            raise BagError.about(str(self.source), expected, got, cure)
        values = self.read([number for number in found.values() if number is not None])
        return dict(zip(names, values, strict=True))

    def find(self, name: str) -> int | None:
        """The index of a column; None if there is no such column."""
        lower = [own.lower() for own in self.names]
        for wanted, known in ((name, self.names), (name.lower(), lower)):
            same = [k for k, own in enumerate(known) if own == wanted]
            if len(same) > 1:
                places = " and ".join(map(str, same))
                cure = f"Name it by its number, {same[0]} or another, if that is what you want."
                got = f"twice {name!r}, the columns {places}"
                raise BagError.about(str(self.source), "every column of the map once", got, cure)
            if same:
                return same[0]
        if name in self.aliases:
            return self.aliases[name]
        return int(name) if name.isdecimal() and int(name) < len(self.names) else None

    def unit_of(self, name: str, wanted: str) -> str:
        """The unit of a column, as spelled in this package; `wanted` if it is unknown."""
        said = self.said_of(name)
        such = "deg" if wanted.startswith("rad") else "mm"
        cure = f"Give it as columns_unit in the map, such as {such}."
        if not said:
            if self.must_say:
                raise BagError.about(str(self.source), f"the unit of {name}", "none", cure)
            return wanted
        unit = spelled(said)
        if unit != wanted and scale_between(unit, wanted) is None:
            expected = f"a unit of {name} that becomes {wanted}"
            raise BagError.about(str(self.source), expected, repr(said), cure)
        return unit

    def said_of(self, name: str) -> str:
        """The unit of a column as in the file or at the end of the column's name; "" for none."""
        if (number := self.find(name)) is None:
            return self.unit
        own = self.names[number]
        if re.sub("(?i)px$", "py", own) in {*self.names} - {own}:  # a coordinate, not pixels
            own = ""
        return self.units.get(number) or self.unit or _in_name(own)

    def time_unit_of(self, name: str) -> str:
        """The unit of a column of times, a key of `PER_UNIT`; "" if the file states none."""
        number = self.find(name)
        said = ("", "") if number is None else (self.units.get(number, ""), self.names[number])
        return unit_of_times(said[0]) or unit_of_times(said[1])


def is_unit(text: str) -> bool:
    """Whether a text is a unit of length, angle or time, or an unsupported unit."""
    is_other = OTHER_UNIT.search(f"({text})") is not None
    return is_other or spelled(text).partition("/")[0] in UNITS or bool(unit_of_times(text))


def _in_name(name: str) -> str:
    bare = as_quotient(ELEMENT.sub("", name))
    found = UNIT_IN_NAME.search(bare)
    said = found is not None and (is_unit(found[1]) or OTHER_UNIT.search(bare))
    return found[1] if found is not None and said else ""


def table_of(source: Path, columns: Mapping[str, Values], **more: Any) -> Table:
    """Make a table from columns in memory."""
    values = list(columns.values())
    return Table(source, tuple(columns), lambda wanted: [values[k] for k in wanted], **more)


def without_subjects(names: Sequence[str]) -> dict[str, int]:
    """Indices of the columns `SUBJECT:MARKER.x` by `MARKER.x`, if only one subject has it."""
    short = [name.rpartition(":")[2] for name in names]
    return {name: k for k, name in enumerate(short) if short.count(name) == 1}


def check_columns(source: Path, count: int) -> None:
    """Raise BagError if a table has more than `MOST_COLUMNS`."""
    if count > MOST_COLUMNS:
        cure = "Leave columns out of the file."
        raise unusable(source, f"at most {MOST_COLUMNS} columns", count, cure)


def unusable(source: Path, expected: str, error: object, cure: str) -> BagError:
    """Make the error for a file whose content does not match its name."""
    return BagError.about(str(source), expected, error, cure)
