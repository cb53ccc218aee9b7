# SPDX-License-Identifier: Apache-2.0
"""Cells of a table as numbers and texts."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.errors import BagError, DofError
from intent_recognition.signals import UNITS, spelled

Values = NDArray[Any]
"""A column: numbers, dates, or texts (of dtype object)."""
MISSING = frozenset(
    {"", "na", "n/a", "nan", "null", "none", "-", "--", "#n/a", "#div/0!", "#value!", "#num!",
     "<na>", "nat", "#na", "#n/a n/a", r"\n",
     "nan(ind)", "-nan(ind)", "nan(snan)", "1.#qnan", "-1.#qnan", "1.#ind", "-1.#ind", "1.#snan"}
)  # fmt: skip
"""What a cell of text says in lower case where nothing was measured. Convention, as in pandas,
Excel, C and SQL."""
THOUSANDS = re.compile(
    r"([+-]?\d{1,3})((?:[ '\u2019\u00a0\u202f]\d{3})+|(?:,\d{3})+(?=\.)|(?:,\d{3}){2,})"
)
"""A number whose thousands are separated by something else than its decimals."""
MAYBE_THOUSANDS = re.compile(r"[+\-\u2212]?[1-9]\d{0,2}([.,])\d{3}(?:\1\d{3})*")
"""A number that may have thousands, or decimals."""
MARK = re.compile(r"[.,](?=\d)")
"""A mark of thousands, or of decimals."""


def cell_at(text: str, row: int) -> str:
    """A cell, at most 60 characters of it, and its row as a message has them."""
    return f"{text[:60]!r} in row {row + 1}"


def numbers(values: Values, source: Path, name: str) -> Floats:
    """A column as numbers (T,), NaN where nothing was measured."""
    if values.dtype.kind in "fiub":
        return values.astype(np.float64)
    found = np.empty(values.size)
    cells = without_thousands([str(cell).strip() for cell in values])
    for row, text in enumerate(cells):
        try:
            found[row] = np.nan if text.lower() in MISSING else float(with_point(text))
        except ValueError as error:
            cure = "Name a column of numbers in the map; leave empty what was not measured."
            got = cell_at(text, row)
            raise BagError.about(f"{source}: {name}", "numbers", got, cure) from error
    _check_marks(cells, source, name)
    return found


def without_thousands(cells: Sequence[str]) -> Sequence[str]:
    """Cells of a column; of `1,000` beside `1,000.5` or `1,000,000` without the mark of thousands.

    So are those of `1.000` beside `1.000,5`.
    """
    if not any("," in text for text in cells):
        return cells
    marks = set(map(_decimal_mark, cells)) - {""}
    if len(marks) != 1 or all(len(MARK.findall(text)) < 2 for text in cells):
        return cells
    of_thousands = "," if marks == {"."} else "."
    return [
        text.replace(of_thousands, "") if MAYBE_THOUSANDS.fullmatch(text) else text
        for text in cells
    ]


def _decimal_mark(text: str) -> str:
    """What decimals are certainly behind, in a column that has such a number; "" of any other."""
    marks = MARK.findall(text)
    if len(marks) > 1 and len(set(marks)) == 1:  # several thousands
        return "," if marks[0] == "." else "."
    return marks[-1] if marks and not MAYBE_THOUSANDS.fullmatch(text) else ""


def _check_marks(cells: Sequence[str], source: Path, name: str) -> None:
    """Refuse a column whose commas, or points beside commas, may separate thousands."""
    known = [text for text in cells if text.lower() not in MISSING]
    commas = [text for text in known if "," in text]
    others = [text for text in known if "," not in text]
    points = [text for text in others if "." in text]
    decimals = [text for text in commas if "." not in text]
    for doubtful, beside in ((commas, others), (points, decimals)):
        if doubtful and beside and all(map(MAYBE_THOUSANDS.fullmatch, doubtful)):
            got = f"{doubtful[0]!r} beside {beside[0]!r}: thousands?"
            cure = "Save it without separators of thousands."
            raise BagError.about(f"{source}: {name}", "one decimal mark", got, cure)


def with_point(text: str) -> str:
    """A number with a decimal point, where it has a decimal comma; without marks of thousands."""
    text = text.replace("\N{MINUS SIGN}", "-")
    if found := THOUSANDS.match(text):
        text = re.sub(r"[^\d+-]", "", found[0]) + text[found.end() :]
    if text.count(",") != 1:
        return text
    whole, _, decimals = text.partition(",")
    return f"{whole.replace('.', '')}.{decimals}" if "." not in decimals else text


def text_of(value: object) -> str:
    """One value of a column as text, "" where there is none."""
    if value is None or (isinstance(value, float | np.floating) and np.isnan(value)):
        return ""
    if isinstance(value, float | np.floating) and float(value).is_integer():
        return str(int(value))
    return (value.decode(errors="replace") if isinstance(value, bytes) else str(value)).strip()


def texts(values: Values) -> list[str]:
    """A column as texts, "" where there is none; whole numbers have no decimals."""
    return [text_of(value) for value in values]


def without_zeros(places: Floats) -> tuple[Floats, int]:
    """Places (T, 3) of a marker, NaN where it is at exactly zero while it is elsewhere at others.

    Returns:
        The places, and how many of them were zero: exporters write that for occlusion. Where all
        are, they stay: a marker may be the origin.
    """
    zero = np.all(places == 0.0, axis=1)
    if not zero.any() or np.all(zero | np.isnan(places).any(axis=1)):
        return places, 0
    return np.where(zero[:, None], np.nan, places), int(zero.sum())


OF_IMAGE = "the landmarks are places in the image, not in metres"


def are_of_image(triples: Values) -> bool:
    """Whether numbers (..., 3) are pixels, two of each landmark, with how sure they are."""
    seen, places = triples[..., 2], triples[..., :2]
    are_shares = np.all((seen >= 0.0) & (seen <= 1.0)) and seen.any()
    return bool(are_shares and np.nanmax(places, initial=0.0) > 10.0)


def pixels_of(triples: Values) -> Floats:
    """Pixels (..., 2) of numbers (..., 3), NaN where the last says that nothing was seen."""
    return np.where(triples[..., 2:] > 0.0, triples[..., :2], np.nan)


PER_BASE = {
    "m": (1, 1), "dm": (1, 10), "cm": (1, 100), "mm": (1, 1000), "um": (1, 10**6),
    "in": (127, 5000), "ft": (381, 1250), "rad": (1, 1), "deg": (np.pi, 180),
}  # fmt: skip
"""What each unit is, in metres or radians, as a quotient that rounds once."""
ANGLES = ("deg", "rad")
LENGTHS = tuple(unit for unit in UNITS if unit not in ANGLES)


def check_convertible(unit: str, wanted: str, place: str) -> None:
    """Make sure that there is a factor between two units."""
    if spelled(unit) != wanted and scale_between(spelled(unit), wanted) is None:
        known = f"{wanted}, or one of {', '.join(UNITS)}, for lengths and angles"
        raise DofError.about(place, known, unit, "Convert the columns, or correct the unit.")


def convert(values: Floats, unit: str, wanted: str) -> Floats:
    """Values in another unit; as they are where it is the same or unknown."""
    scale = scale_between(spelled(unit), wanted)
    if scale is None or scale[0] == scale[1]:
        return values
    multiplier, divisor = scale
    return values * multiplier / divisor  # a quotient of small integers rounds once


def scale_between(unit: str, wanted: str) -> tuple[float, float] | None:
    """Factor and divisor from one unit to the other, None where there is none."""
    (one, _, per), (other, _, other_per) = unit.partition("/"), wanted.partition("/")
    if unit == wanted:
        return 1, 1
    if per != other_per or one not in PER_BASE or other not in PER_BASE:
        return None
    if (one in ANGLES) != (other in ANGLES):
        return None
    (a, b), (c, d) = PER_BASE[one], PER_BASE[other]
    shared = np.gcd(a * d, b * c) if one not in ANGLES else 1
    return a * d / shared, b * c / shared
