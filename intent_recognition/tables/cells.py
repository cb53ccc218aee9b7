# SPDX-License-Identifier: Apache-2.0
"""Convert cells of a table to numbers and texts, and values between units."""

import re
from collections.abc import Mapping, Sequence
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
     "<na>", "nat", "#na", "#n/a n/a", r"\n", "inf", "+inf", "-inf", "infinity", "-infinity",
     "nan(ind)", "-nan(ind)", "nan(snan)", "1.#qnan", "-1.#qnan", "1.#ind", "-1.#ind", "1.#snan",
     ".", "missing", "n.a.", "undefined"}
)  # fmt: skip
"""Texts, in lower case, of cells without a measurement, as written by pandas, Excel, C, SQL, SAS,
Julia and JavaScript."""
THOUSANDS = re.compile(
    r"([+-]?\d{1,3})((?:[ '\u2019\u00a0\u202f]\d{3})+|(?:,\d{3})+(?=\.)|(?:,\d{3}){2,})"
)
"""A number with thousands separators, which differ from its decimal mark."""
MAYBE_THOUSANDS = re.compile(r"[+\-\u2212]?[1-9]\d{0,2}([.,])\d{3}(?:\1\d{3})*")
"""A number with marks that may be thousands separators or a decimal mark."""
MARK = re.compile(r"[.,](?=\d)")
"""A thousands separator or decimal mark."""
VECTOR = re.compile(r"[\[(]([^\[\]()]+)[\])]")
"""Several numbers in one cell, as Unity, numpy and pandas print them: `(0.1, 0.2)`, `[0.1 0.2]`."""
NUMPY = re.compile(r"np\.float\d+\(([^()]*)\)")
"""A number in a list as numpy 2 prints it: `[np.float64(0.1), np.float64(0.2)]`."""


def cell_at(text: str, row: int) -> str:
    """A cell, cut to 60 characters, and its row, as text for messages."""
    return f"{text[:60]!r} in row {row + 1}"


def numbers(values: Values, source: Path, name: str) -> Floats:
    """Convert a column to numbers (T,), NaN where nothing was measured or a number is infinite."""
    if values.dtype.kind in "fiub":
        found = values.astype(np.float64)
        return np.where(np.isfinite(found), found, np.nan)
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
    return np.where(np.isfinite(found), found, np.nan)


def without_thousands(cells: Sequence[str]) -> Sequence[str]:
    """Remove thousands separators that other cells of a column identify.

    `1,000` beside `1,000.5` or `1,000,000` becomes `1000`, as does `1.000` beside `1.000,5`.
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
    """The decimal mark, "." or ",", of a column with this number; "" if the number is ambiguous."""
    marks = MARK.findall(text)
    if len(marks) > 1 and len(set(marks)) == 1:  # a repeated mark separates thousands
        return "," if marks[0] == "." else "."
    return marks[-1] if marks and not MAYBE_THOUSANDS.fullmatch(text) else ""


def _check_marks(cells: Sequence[str], source: Path, name: str) -> None:
    """Raise BagError if commas, or points beside commas, may be thousands separators."""
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
    """Replace a decimal comma by a point, and remove thousands separators."""
    text = text.replace("\N{MINUS SIGN}", "-")
    if found := THOUSANDS.match(text):
        text = re.sub(r"[^\d+-]", "", found[0]) + text[found.end() :]
    if text.count(",") != 1:
        return text
    whole, _, decimals = text.partition(",")
    return f"{whole.replace('.', '')}.{decimals}" if "." not in decimals else text


def is_number(text: str) -> bool:
    """Whether a cell holds a number or marks a missing one."""
    text = text.strip()
    try:
        return text.lower() in MISSING or float(with_point(text)) is not None
    except ValueError:
        return False


def _elements(cell: str) -> list[str]:
    """The numbers of a `VECTOR` in a cell; empty for any other cell."""
    vector = VECTOR.fullmatch(NUMPY.sub(r"\1", cell.strip()))
    parts = re.split(r"[,;\s]+", vector[1].strip()) if vector else []
    return parts if all(map(is_number, parts)) else []


def vector_sizes(rows: Sequence[Sequence[str]]) -> dict[int, int]:
    """Number of elements in each cell, for the columns whose cells hold vectors."""
    found: dict[int, set[int]] = {}
    for row in rows:
        for column, cell in enumerate(row):
            if cell.strip():
                found.setdefault(column, set()).add(len(_elements(cell)))
    return {c: max(sizes) for c, sizes in found.items() if len(sizes) == 1 and max(sizes) > 1}


def spread(row: Sequence[str], sizes: Mapping[int, int]) -> list[str]:
    """Split the vectors of a row into cells; a cell without vector is followed by blank cells."""
    cells: list[str] = []
    for column, cell in enumerate(row):
        size = sizes.get(column, 0)
        found = _elements(cell) if size else []
        cells += found if size and len(found) == size else [cell, *[""] * (size - 1)]
    return cells


def text_of(value: object) -> str:
    """Convert one value of a column to text, "" if it is missing."""
    if value is None or (isinstance(value, float | np.floating) and np.isnan(value)):
        return ""
    if isinstance(value, float | np.floating) and float(value).is_integer():
        return str(int(value))
    return (value.decode(errors="replace") if isinstance(value, bytes) else str(value)).strip()


def texts(values: Values) -> list[str]:
    """Convert a column to texts, "" for missing values; whole numbers have no decimals."""
    return [text_of(value) for value in values]


OF_IMAGE = "the landmarks are places in the image, not in metres"


def are_of_image(triples: Values) -> bool:
    """Whether numbers (..., 3) are pixels x and y with a confidence, for each landmark."""
    seen, places = triples[..., 2], triples[..., :2]
    are_shares = np.all((seen >= 0.0) & (seen <= 1.0)) and seen.any()
    return bool(are_shares and np.nanmax(places, initial=0.0) > 10.0)


def pixels_of(triples: Values) -> Floats:
    """Pixels (..., 2) from numbers (..., 3), NaN where the confidence is zero."""
    return np.where(triples[..., 2:] > 0.0, triples[..., :2], np.nan)


PER_BASE = {
    "m": (1, 1), "dm": (1, 10), "cm": (1, 100), "mm": (1, 1000), "um": (1, 10**6),
    "in": (127, 5000), "ft": (381, 1250), "rad": (1, 1), "deg": (np.pi, 180),
}  # fmt: skip
"""Each unit in metres or radians, as a quotient so that conversion rounds once."""
ANGLES = ("deg", "rad")
LENGTHS = tuple(unit for unit in UNITS if unit not in ANGLES)


def check_convertible(unit: str, wanted: str, place: str) -> None:
    """Make sure that one unit can be converted to the other."""
    if spelled(unit) != wanted and scale_between(spelled(unit), wanted) is None:
        known = f"{wanted}, or one of {', '.join(UNITS)}, for lengths and angles"
        raise DofError.about(place, known, unit, "Convert the columns, or correct the unit.")


def convert(values: Floats, unit: str, wanted: str) -> Floats:
    """Convert values to another unit; they stay unchanged if there is no factor between them."""
    scale = scale_between(spelled(unit), wanted)
    if scale is None or scale[0] == scale[1]:
        return values
    multiplier, divisor = scale
    return values * multiplier / divisor  # a quotient of small integers rounds once


def scale_between(unit: str, wanted: str) -> tuple[float, float] | None:
    """Factor and divisor from one unit to the other, None if they are not commensurable."""
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
