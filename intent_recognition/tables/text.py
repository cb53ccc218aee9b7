# SPDX-License-Identifier: Apache-2.0
"""Read tables of text: CSV, and text exported by motion capture software.

`headers.py` names the columns of known exporters; any other file is a CSV with or without a line of
names.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import chain, islice, pairwise
from os import SEEK_END
from pathlib import Path

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.tables.by_body import by_body
from intent_recognition.tables.cells import Values, is_number, spread, vector_sizes, with_point
from intent_recognition.tables.headers import (
    NUMBER,
    OF_VICON,
    Header,
    known_header,
    of_joint_states,
)
from intent_recognition.tables.table import Table, check_columns, is_unit, unusable
from intent_recognition.tables.times import TIME_NAME

DELIMITERS = ",;\t| "
"""Delimiters of CSV cells, in order of preference; blanks only if there is no other."""
LEAST_CELLS = 3
"""Fewest cells of a table's rows; rows above with fewer cells are titles."""
MOST_CELLS = 10_000_000
"""Most cells read from a CSV, which take 0.7 GB while they are read; an hour of twenty columns at
100 Hz has 7 million."""
LONGEST_LINE = 2**16
"""Number of characters of a line searched for delimiters, for `MOST_COLUMNS` of six characters."""
HEAD_ROWS = 60
"""Number of rows searched for a header; OpenSim's headers have about thirty."""
MOST_NOTES = 10
"""Most rows at the end that may be notes, or means and the like."""
UNIT_LINE = re.compile(r"(?i)(?:length |position )?units? [\[(]?([^\s\])]+)[\])]?")
"""A line that states the unit of all columns."""
RATE_LINE = re.compile(
    r"(?i)(?:(?:export|capture|camera|data|frame|sampl\w*) ?)*(?:frequency|rate|fps)"
    r"(?: [\[(]?hz[\])]?)? (\d+(?:\.\d+)?)(?: hz)?"
)
"""A line that states the rate of all rows [Hz]."""
COMMENTS = ("#", "% ")
"""Beginnings of comment lines."""
NO_PLACES = ("Devices", "Events", "Analog", "Force Plates")
"""Titles of Nexus tables without positions, which are never read."""
TEXTS = (".csv", ".tsv", ".txt", ".dat", ".trc", ".mot", ".sto", ".log")


def open_text(path: Path, skip_rows: int) -> Table:
    """Open a CSV, TSV, TRC, MOT or STO file, or a CSV of Motive, Nexus or QTM."""
    encoding = _encoding(path)
    comments = _comments(path, encoding)
    before, others = _before_places(path, comments, encoding)
    head = list(islice(_rows(path, comments, encoding), before, before + HEAD_ROWS))
    header = known_header(head)
    is_plain = header is None
    sizes: dict[int, int] = {}
    if header is not None:
        skip_rows = comments
    else:
        skip_rows, before, others = skip_rows or comments, 0, ()
        head = list(islice(_rows(path, skip_rows, encoding), HEAD_ROWS))
        header = _plain_header(path, head)
        sizes = vector_sizes(head[header.skip :])
        header = _with_elements(header, sizes)
    start = before + header.skip
    unit, defaults = _said_above(path, skip_rows + start, encoding)
    if any(map(TIME_NAME.search, header.names)):
        defaults = {}
    check_columns(path, len(header.names))

    def rows(last: int) -> Iterator[tuple[int, list[str]]]:
        of_table = islice(_rows(path, skip_rows, encoding), start, None)
        cells: Iterable[list[str]] = of_table
        if sizes:
            cells = (spread(row, sizes) for row in of_table)
        elif header.commas:
            cells = (",".join(row).split(",") for row in of_table)
        return _below(header, cells, last, path)

    def read(wanted: Sequence[int]) -> list[Values]:
        cells: list[list[str]] = [[] for _ in wanted]
        most = MOST_CELLS // max(1, len(wanted))
        for number, row in rows(max(wanted, default=0)):
            if number >= most:
                cure = "Split it, or name fewer of its columns in the map."
                got = f"more than {most} rows of {len(wanted)} columns"
                raise unusable(path, f"at most {MOST_CELLS} cells", got, cure)
            if is_plain and _is_shifted(row, len(header.names)):
                got = f"{len(row)} in row {number + 1}"
                cure = "Name every column; between cells with decimal commas put semicolons."
                raise unusable(path, f"{len(header.names)} cells, one for each name", got, cure)
            for column, place in zip(cells, wanted, strict=True):
                column.append(row[place])
        return [np.array(column, object) for column in cells]

    @cache
    def counts() -> Floats:
        return np.array([number for number, _ in rows(0)], np.float64)

    notes = (f"only {head[0][0].strip()} are read, not {', '.join(others)}",) if others else ()
    about = {"counts": counts, "notes": notes, "unit": unit, "defaults": defaults, **header.about}
    table = Table(path, header.names, read, **about)
    return by_body(table) if is_plain else table


def _below(
    header: Header, rows: Iterable[list[str]], last: int, path: Path
) -> Iterator[tuple[int, list[str]]]:
    """Numbers and cells of the rows below a header, filled up to the column `last`.

    Missing cells at the end of a row are empty. Successive short rows that may be one row broken
    over several lines are an error. A short last row is left out if it does not end with a line
    break, since writing may have stopped, or is a single cell, which may be a remark.
    """
    width, together, run, before, whole = len(header.names), 0, 0, [""], [""]
    for (number, row), (_, after) in pairwise(chain(_numbered(header, rows), [(0, [])])):
        if header.skip and _are_names(row, header.names):
            got, cure = f"its names again in row {number + 1}", "Split it there, into two files."
            raise unusable(path, "one recording", got, cure)
        size = len(row)
        together, run = (together + size, run + 1) if size < width else (0, 0)
        is_less = run > 0 and size < len(before)
        if is_less and not after and (size == 1 or not _ends_line(path)):
            break
        is_pair = run == 2 and (not after or width <= len(after))
        # a line break within a cell splits it into two
        is_broken = is_pair and together in (width, width + 1)
        firsts = [one[0] for one in (whole, before, row, after) if one][-3:]
        is_broken = is_broken and not _goes_on(*firsts, evenly=not after)
        is_broken |= run > 1 and together == width and size <= last
        if is_broken or (size == 1 <= last and bool(after)):
            cure = "Correct or remove the row, or begin it with # as a comment."
            raise unusable(path, f"{width} cells", f"{size} in row {number + 1}", cure)
        before, whole = row, row if size >= width else whole
        yield number, [*row, *[""] * (last + 1 - size)] if size <= last else row


def _goes_on(*cells: str, evenly: bool) -> bool:
    """Whether first cells of rows may be times: increasing, and if `evenly`, in similar steps."""
    try:
        numbers = [float(with_point(cell)) for cell in cells]
    except ValueError:
        return False
    steps = [b - a for a, b in pairwise(numbers)]
    return 0.0 < min(steps) and (not evenly or max(steps) < 2.0 * min(steps))


def _numbered(header: Header, rows: Iterable[list[str]]) -> Iterator[tuple[int, list[str]]]:
    """Rows below a header with their numbers. Blank lines, comments, and rows at the end with text
    for a number, alone or below a blank line, are no rows; empty ones are counted but left out.
    """
    number = -1
    before, is_apart = "", False
    held: list[tuple[int, list[str]]] = []  # perhaps notes at the end
    for row in rows:
        is_blank = not any(cell.strip() for cell in row)
        if is_blank and header.ends_blank and number >= 0:
            break
        is_comment = len(row) != len(header.names) and row and row[0].startswith(COMMENTS)
        is_apart |= is_blank
        if (is_blank and len(row) < 2) or is_comment:
            continue
        number += 1
        if is_blank:
            continue
        held.append((number, row))
        first = row[0].strip()
        is_note = first[:1].isalpha() and not is_number(first) and NUMBER.fullmatch(before)
        is_alone = is_apart or not any(map(str.strip, row[1:]))
        if not (is_note and is_alone) or len(held) > MOST_NOTES:
            yield from held
            held, before, is_apart = [], first, False


def _ends_line(path: Path) -> bool:
    """Whether a file ends with a line break."""
    with path.open("rb") as stream:
        stream.seek(-min(2, path.stat().st_size), SEEK_END)
        end = stream.read()
    return b"\n" in end or b"\r" in end


def _are_names(row: Sequence[str], names: Sequence[str]) -> bool:
    """Whether a row repeats the names, unless these are numbers."""
    cells = (cell.strip().lstrip("#").strip() for cell in row)
    return all(map(str.__eq__, cells, names)) and not all(map(is_number, names))


def _comments(path: Path, encoding: str) -> int:
    """Number of comment lines (or Excel's `sep=;`) before the names, which may begin with a #."""
    count = 0
    try:
        with path.open(encoding=encoding, newline="") as stream:
            for line in iter(lambda: stream.readline(LONGEST_LINE), ""):
                if not line.startswith(COMMENTS) and not (count == 0 and line.startswith("sep=")):
                    cells = re.split(r"[,;\s]+", line.strip())
                    return count - all(map(is_number, cells)) if count else 0
                count += 1
    except (UnicodeError, OSError) as error:
        raise unusable(path, "a table of text", error, "Save it as CSV in UTF-8.") from error
    return 0


def _said_above(path: Path, count: int, encoding: str) -> tuple[str, dict[str, object]]:
    """The unit and the rate stated in lines above the numbers, such as `# units: mm`: "" if none or
    several units, and no default if none or several rates.
    """
    with path.open(encoding=encoding) as stream:
        lines = [re.sub(r"[#,;:=\s]+", " ", stream.readline(LONGEST_LINE)) for _ in range(count)]
    unit, rate = (
        {match[1] for line in lines if (match := form.fullmatch(line.strip()))}
        for form in (UNIT_LINE, RATE_LINE)
    )
    defaults: dict[str, object] = {"time": {"rate": float(*rate)}} if len(rate) == 1 else {}
    return unit.pop() if len(unit) == 1 and all(map(is_unit, unit)) else "", defaults


def _before_places(path: Path, skip_rows: int, encoding: str) -> tuple[int, Sequence[str]]:
    """Number of rows before the table to read in Vicon's export, and titles of its other tables."""
    rows = _rows(path, skip_rows, encoding)
    titles = (*OF_VICON, *NO_PLACES)
    first = next((row for row in rows if any(map(str.strip, row))), [])
    if "".join(first).strip().title() not in titles:
        return 0, ()
    starts: dict[str, int] = {}
    for k, row in enumerate(_rows(path, skip_rows, encoding)):
        if row and (title := row[0].strip().title()) in titles:
            starts.setdefault(title, k)
    main = min(starts, key=titles.index)
    return starts[main], [t for t in starts if t != main and t in OF_VICON]


def _plain_header(path: Path, head: Sequence[Sequence[str]]) -> Header:
    """Header from the lines of names and units below titles; columns without names are numbered."""
    keys = [k for k, row in enumerate(head) if "".join(row[:1]).strip().endswith(":")]
    counts = [sum(bool(cell.strip()) for cell in row) for row in head]
    for key in keys if len(keys) > 1 else ():  # titles, such as `Rate (Hz):` and its values
        counts[key] = 0
    if not any(counts):
        raise unusable(path, "a line of column names", "an empty file", "Check the path.")
    if max(counts) >= LEAST_CELLS > counts[0]:
        titles = next(k for k, count in enumerate(counts) if count >= LEAST_CELLS)
        if not all(is_number(cell) for cell in head[titles] if cell.strip()):
            below_them = _plain_header(path, head[titles:])
            return replace(below_them, skip=below_them.skip + titles)
    first = head[0]
    if (
        first
        and first[0].strip() in ("#", "%")
        and len(head) > 1
        and len(first) == len(head[1]) + 1
    ):
        first = first[1:]  # a separate comment mark before names separated by blanks
    names = tuple(name.strip().lstrip("#").removeprefix("% ").strip() for name in first)
    names = _with_parts(names, head[1:])
    if len(names) >= LEAST_CELLS and names == tuple(map(str, range(len(names)))):
        return Header(names, 1)  # pandas' header of columns without names
    if all(map(is_number, names)) or _is_row(names, head[1:3]):
        return Header(of_joint_states(names) or tuple(map(str, range(len(names)))), 0)
    second = len(head) > 1 and _is_second_line(head[1:])
    below = [cell.strip().strip("[]()") for cell in head[1]] if second else []
    said = {k: unit for k, unit in enumerate(below) if unit}
    are_units = 2 * sum(map(is_unit, said.values())) >= len(said)
    units = {k: unit for k, unit in said.items() if are_units or is_unit(unit)}
    return Header(names, 1 + second, {"units": units})


def _with_parts(names: Sequence[str], rows: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Prefix all names up to the next empty column by that of the empty column before them, if one
    of them repeats beyond: rosbag_to_csv writes `position,x,y,z,orientation,x,y,z,w`.
    """
    counts = Counter(names)
    parts: list[list[str]] = [[]]
    for column, name in enumerate(names):
        if not any(cell.strip() for row in rows for cell in row[column : column + 1]):
            parts.append([])
        parts[-1].append(name)
    found = [*parts[0]]
    for part, *inside in parts[1:]:
        repeats = part and any(counts[name] > own for name, own in Counter(inside).items())
        found += [part, *(f"{part}.{name}" if repeats else name for name in inside)]
    return tuple(found)


def _with_elements(header: Header, sizes: Mapping[int, int]) -> Header:
    """A header with a column for each element of vectors: `position.0`, `position.1`, ..."""
    columns = [(c, k) for c in range(len(header.names)) for k in range(sizes.get(c, 1))]
    names = [f"{header.names[c]}.{k}" if c in sizes else header.names[c] for c, k in columns]
    said = header.about.get("units", {})
    units = {number: said[c] for number, (c, _) in enumerate(columns) if c in said}
    return replace(header, names=tuple(names), about={"units": units})


def _is_second_line(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the first row belongs to the header, as units do: its texts are above numbers."""
    said = [k for k, cell in enumerate(rows[0]) if cell.strip()]
    return not any(is_number(rows[0][k]) for k in said) and any(
        k < len(row) and row[k].strip() and is_number(row[k]) for row in rows[1:] for k in said
    )


def _is_shifted(row: Sequence[str], width: int) -> bool:
    """Whether a row has more cells than names, unless the last column has text with delimiters."""
    return len(row) > width and is_number(row[width - 1]) and any(map(str.strip, row[width:]))


def _is_row(first: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
    """Whether a line has numbers and texts in the same columns as the lines below it."""
    cells = [(k, is_number(cell)) for k, cell in enumerate(first) if cell]
    return any(has_number for _, has_number in cells) and all(
        len(row) == len(first) and all(is_number(row[k]) == has_number for k, has_number in cells)
        for row in rows
    )


def _rows(path: Path, skip_rows: int, encoding: str) -> Iterator[list[str]]:
    """The rows of a CSV, as lists of cells, after `skip_rows` lines."""
    try:
        with path.open(encoding=encoding, newline="") as stream:
            while skip_rows and stream.readline(LONGEST_LINE):
                skip_rows -= 1
            at = stream.tell()
            head = [stream.readline(LONGEST_LINE) for _ in range(HEAD_ROWS)]
            stream.seek(at)
            yield from csv.reader(stream, delimiter=_delimiter(path, head), skipinitialspace=True)
    except (UnicodeError, csv.Error, OSError) as error:
        raise unusable(path, "a table of text", error, "Save it as CSV in UTF-8.") from error


def _delimiter(path: Path, head: Sequence[str]) -> str:
    """The delimiter of cells: tabs in formats that use them, else the most frequent one."""
    if path.suffix.lower() in (".trc", ".mot", ".sto", ".tsv") and any("\t" in n for n in head):
        return "\t"
    counts = [head[0].count(delimiter) for delimiter in DELIMITERS]
    alike = [n * (head[1].count(d) == n) for n, d in zip(counts, DELIMITERS, strict=True)]
    if any(alike[:4]):  # others may be in names
        counts = alike
    if (counts[0] and counts[1]) or not any(counts[:4]):  # decimal commas, or a title
        counts = [sum(line.count(delimiter) for line in head) for delimiter in DELIMITERS]
        if counts[1] >= len([line for line in head if line.strip()]) // 2 > 0:
            return ";"
    return DELIMITERS[counts.index(max(counts[:4]) or max(counts))]


def _encoding(path: Path) -> str:
    """Encoding of a text file: UTF-16 by its mark or zeros, UTF-8, or else Latin-1."""
    with path.open("rb") as stream:
        start = stream.read(64)
        if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return "utf-16"
        for zeros, encoding in ((start[1::2], "utf-16-le"), (start[::2], "utf-16-be")):
            if zeros and not any(zeros):
                return encoding
        if b"\0" in start:
            raise unusable(path, "a table of text", "bytes that are no text", "Save it as CSV.")
    try:
        with path.open(encoding="utf-8") as text:
            while text.read(2**20):
                pass
        return "utf-8-sig"
    except UnicodeDecodeError:
        return "latin-1"
