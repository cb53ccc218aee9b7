# SPDX-License-Identifier: Apache-2.0
"""Columns of Parquet files, by pyarrow."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from intent_recognition.errors import BagError, one_line, optional
from intent_recognition.tables.cells import Values
from intent_recognition.tables.table import Table, check_columns, unusable
from intent_recognition.untrusted import MOST_ARRAYS, UntrustedError, check_regular


def open_parquet(path: Path) -> Table:
    """A Parquet file; elements of a list column are `NAME.0`, `NAME.1`, ..."""
    return parquet_table(path, [path], {})


def parquet_table(source: Path, files: Sequence[Path], names: Mapping[str, Sequence[str]]) -> Table:
    """Files of one schema as one table.

    Args:
        source: the file, or the folder of a data set.
        files: in their order.
        names: of the elements of list columns, where they have any.
    """
    parquet = optional("pyarrow.parquet")
    places = _places(parquet, files[0], names)
    own = [name for name, (_, element, alias) in places.items() if not alias]
    numbers = {places[name][:2]: k for k, name in enumerate(own)}
    aliases = {name: numbers[place[:2]] for name, place in places.items() if place[2]}

    def read(wanted: Sequence[int]) -> list[Values]:
        chosen = [places[own[k]] for k in wanted]
        stored = list(dict.fromkeys(column for column, _, _ in chosen))
        _check_size(parquet, files, stored)
        single = [column for column, element, _ in chosen if element is None]
        parts = [_read(parquet, file, stored, single) for file in files]
        columns = {name: np.concatenate([part[name] for part in parts]) for name in stored}
        return [
            columns[column] if element is None else columns[column][:, element]
            for column, element, _ in chosen
        ]

    return Table(source, tuple(own), read, aliases=aliases)


def _places(
    parquet: Any, path: Path, names: Mapping[str, Sequence[str]]
) -> dict[str, tuple[str, int | None, bool]]:
    """Stored column and element of each name, and whether it is a second name of it."""
    places: dict[str, tuple[str, int | None, bool]] = {}

    def look(file: Any) -> None:
        types = file.schema_arrow
        for column in types.names:
            kind = types.field(column).type
            if not _is_list(kind):
                if not _is_nested(kind):
                    places[column] = (column, None, False)
                continue
            _check_size(parquet, [path], [column])
            row = next(file.iter_batches(1, columns=[column]), None)
            first = row.column(0)[0].as_py() if row is not None and row.num_rows else None
            count = len(first or ())
            check_columns(path, len(places) + count)
            named = list(names.get(column, ()))
            for k in range(count):
                if len(named) == count:
                    places[f"{column}.{named[k]}"] = (column, k, False)
                places.setdefault(f"{column}.{k}", (column, k, len(named) == count))
            if count == 1:
                places.setdefault(column, (column, 0, True))

    _with_file(parquet, path, look)
    return places


def _read(
    parquet: Any, path: Path, columns: Sequence[str], single: Sequence[str]
) -> dict[str, Values]:
    """Columns of one file, (T,) or, where they are not `single` but hold lists, (T, d)."""

    def load(file: Any) -> dict[str, Values]:
        table = file.read(columns=list(columns))
        return {name: _values(table.column(name), path, name) for name in columns}

    found: dict[str, Values] = _with_file(parquet, path, load, single)
    return found


def _check_size(parquet: Any, files: Sequence[Path], columns: Sequence[str]) -> None:
    """Bound what columns take, all files together, before any is read."""
    starts = tuple(f"{column}." for column in columns)
    taken = 0

    def look(file: Any) -> None:
        nonlocal taken
        metadata = file.metadata
        for group in map(metadata.row_group, range(metadata.num_row_groups)):
            for chunk in map(group.column, range(group.num_columns)):
                if f"{chunk.path_in_schema}.".startswith(starts):
                    taken += max(8 * chunk.num_values, chunk.total_uncompressed_size)
        if taken > MOST_ARRAYS:
            raise UntrustedError(f"columns of {taken} bytes, more than {MOST_ARRAYS}")

    for path in files:
        _with_file(parquet, path, look)


def _values(column: Any, path: Path, name: str) -> Values:
    """A column of Arrow as numpy has it; what is null is NaN, or None in texts."""
    column = column.unify_dictionaries().combine_chunks()
    if str(column.type).startswith("dictionary<"):  # texts that are alike are kept once
        known = np.array([*column.dictionary.to_pylist(), None], object)
        return np.asarray(known[column.indices.fill_null(len(known) - 1).to_numpy()])
    if not _is_list(column.type):
        if column.null_count and str(column.type).startswith(("int", "uint")):
            return np.array([None if v is None else str(v) for v in column.to_pylist()], object)
        return np.asarray(column.to_numpy(zero_copy_only=False))
    flat = np.asarray(column.flatten().to_numpy(zero_copy_only=False))
    size = flat.size // max(1, len(column))
    lengths = column.value_lengths().to_pylist() if hasattr(column, "value_lengths") else [size]
    if column.null_count or len(set(lengths)) > 1:
        got = ", ".join(sorted(map(str, set(lengths))))
        raise unusable(path, f"lists of one length in {name}", got, "Leave that column out.")
    return flat.reshape(len(column), size)


def _is_list(kind: Any) -> bool:
    return str(kind).startswith(("list<", "fixed_size_list<", "large_list<"))


def _is_nested(kind: Any) -> bool:
    return str(kind).startswith(("struct<", "map<", "extension<", "binary"))


def _with_file(
    parquet: Any, path: Path, action: Callable[[Any], Any], single: Sequence[str] = ()
) -> Any:
    """What `action` makes of an open file; whatever is wrong with it is a BagError.

    Texts in the columns `single` come as dictionaries: one that is repeated is kept once.
    """
    try:
        check_regular(path)
        with parquet.ParquetFile(path, read_dictionary=list(single)) as file:
            return action(file)
    except (BagError, MemoryError):
        raise
    except Exception as error:  # pyarrow raises what its parts raise
        cure = "Write or download it again."
        raise unusable(path, "a Parquet file", one_line(error), cure) from error
