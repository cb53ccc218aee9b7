# SPDX-License-Identifier: Apache-2.0
"""Tables of every kind of file: by its suffix, CSV and NPZ here."""

import csv
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from intent_recognition.errors import BagError
from intent_recognition.tables.c3d import open_c3d
from intent_recognition.tables.parquet import open_lerobot, open_parquet
from intent_recognition.tables.table import Table, Values, check_columns, unusable
from intent_recognition.untrusted import UntrustedError, check_regular, read_arrays

DELIMITERS = ",;\t "
"""What may separate the cells of a CSV, in order of preference where a header has none of them."""
MOST_CSV = 2**28
"""Bytes of a CSV. Convention: an hour of fifty columns at 100 Hz takes 0.2 GB."""
MOST_CELLS = 10_000_000
"""Cells that are taken from a CSV, or its rows. Convention: they take 0.7 GB while they are read;
an hour of twenty columns at 100 Hz has 7 million."""
LONGEST_LINE = 2**16
"""Characters of a line that are looked at for what separates its cells. Convention."""
LEROBOT = "meta/info.json"


def open_table(path: Path, skip_rows: int = 0) -> Table:
    """The table in a file, or in the folder of a LeRobot data set.

    Args:
        path: of the file.
        skip_rows: lines of a CSV before its header.

    Raises:
        BagError: the file cannot be read.
        MissingPackageError: its library is not installed.
    """
    if is_lerobot(path):
        return open_lerobot(path)
    try:
        check_regular(path, MOST_CSV if is_text(path) else None)
    except (OSError, UntrustedError) as error:
        raise unusable(path, "a file that can be read", error, "Check the path.") from error
    if is_text(path):
        return _open_csv(path, skip_rows)
    return SUFFIXES[path.suffix.lower()](path)


def is_lerobot(path: Path) -> bool:
    """Whether a folder is a LeRobot data set."""
    return (path / LEROBOT).is_file()


def is_table(path: Path) -> bool:
    """Whether a file can be imported, by its name."""
    return is_text(path) or path.suffix.lower() in SUFFIXES


def is_text(path: Path) -> bool:
    """Whether a file is a CSV by its name."""
    return path.suffix.lower() in (".csv", ".tsv", ".txt")


def _open_csv(path: Path, skip_rows: int) -> Table:
    header = next(_rows(path, skip_rows), [])
    if not header:
        raise unusable(path, "a line of column names", "an empty file", "Check the path.")
    check_columns(path, len(header))
    names = tuple(name.strip() for name in header)
    if doubled := sorted(name for name, count in Counter(names).items() if count > 1):
        got = ", ".join(map(repr, doubled))
        raise unusable(path, "every column name once", f"twice {got}", "Give each its own name.")

    def read(wanted: Sequence[str]) -> dict[str, Values]:
        places = [names.index(name) for name in wanted]
        cells: list[list[str]] = [[] for _ in wanted]
        rows = _rows(path, skip_rows)
        next(rows)
        most = MOST_CELLS // max(1, len(wanted))
        for number, row in enumerate(rows):
            if number >= most:
                cure = "Split it, or name fewer of its columns in the map."
                got = f"more than {most} rows of {len(wanted)} columns"
                raise unusable(path, f"at most {MOST_CELLS} cells", got, cure)
            if not row:
                continue
            if len(row) != len(names):
                got = f"{len(row)} in row {number + 1}"
                raise unusable(path, f"{len(names)} cells", got, "Correct the file.")
            for column, place in zip(cells, places, strict=True):
                column.append(row[place])
        return {name: np.array(column, object) for name, column in zip(wanted, cells, strict=True)}

    return Table(path, names, read)


def _rows(path: Path, skip_rows: int) -> Iterator[list[str]]:
    """The lines of a CSV as cells, from the header on."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            while skip_rows and stream.readline(LONGEST_LINE):
                skip_rows -= 1
            at, header = stream.tell(), stream.readline(LONGEST_LINE)
            stream.seek(at)
            counts = [header.count(delimiter) for delimiter in DELIMITERS]
            delimiter = DELIMITERS[counts.index(max(counts[:3]) or max(counts))]
            yield from csv.reader(stream, delimiter=delimiter, skipinitialspace=True)
    except (UnicodeDecodeError, csv.Error, OSError) as error:
        raise unusable(path, "a CSV file in UTF-8", error, "Save it as CSV again.") from error


def _open_npz(path: Path) -> Table:
    try:
        arrays = read_arrays(path)
    except (UntrustedError, OSError) as error:
        cure = "Write it with numpy.savez, with arrays of numbers or texts."
        raise unusable(path, "an .npz of plain arrays", error, cure) from error
    columns: dict[str, Values] = {}
    for name, array in arrays.items():
        if array.ndim > 2:
            shape = f"{name} of shape {array.shape}"
            cure = "Put one demonstration after the other, with a column that counts them."
            raise unusable(path, "arrays (T,) or (T, d)", shape, cure)
        if array.ndim == 2:
            check_columns(path, len(columns) + array.shape[1])
            columns.update({f"{name}.{k}": array[:, k] for k in range(array.shape[1])})
        else:
            columns[name] = np.atleast_1d(array)
    return Table(path, tuple(columns), lambda wanted: {name: columns[name] for name in wanted})


SUFFIXES: dict[str, Callable[[Path], Table]] = {
    ".npz": _open_npz,
    ".parquet": open_parquet,
    ".c3d": open_c3d,
}


def find_tables(source: Path) -> list[Path]:
    """What of a path can be imported: itself, or the files of a folder, sorted by name.

    Raises:
        BagError: nothing of it can.
    """
    kinds = ".csv, .tsv, .txt, .npz, .parquet, .c3d or a LeRobot data set"
    if is_lerobot(source) or (source.is_file() and is_table(source)):
        return [source]
    found = sorted(path for path in source.rglob("*") if path.is_file() and is_table(path))
    if not found:
        got = "nothing of that name" if not source.exists() else "none"
        raise BagError.about(str(source), kinds, got, "Check the path.")
    return found
