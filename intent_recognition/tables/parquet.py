# SPDX-License-Identifier: Apache-2.0
"""Columns of Parquet files, by pyarrow."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from intent_recognition.errors import BagError, one_line, optional
from intent_recognition.tables.cells import Values
from intent_recognition.tables.table import Table, check_columns, unusable
from intent_recognition.untrusted import MOST_ARRAYS, UntrustedError, check_regular


def open_parquet(path: Path) -> Table:
    """A Parquet file; elements of lists are `NAME.0`, ..., fields of structs `NAME.FIELD`."""
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
        for column, kind in _leaves(file.schema_arrow):
            if not _is_list(kind):
                if not _is_nested(kind):
                    places[column] = (column, None, False)
                continue
            _check_size(parquet, [path], [column])
            elements = _elements(_first_list(file, column))
            count = len(elements)
            check_columns(path, len(places) + count)
            named = list(names.get(column, ()))
            for k, element in enumerate(elements):
                if len(named) == count:
                    places[f"{column}.{named[k]}"] = (column, k, False)
                places.setdefault(f"{column}.{element}", (column, k, len(named) == count))
            if count == 1:
                places.setdefault(column, (column, 0, True))

    _with_file(parquet, path, look)
    return places


def _leaves(schema: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """Columns and their types, fields of structs by their paths."""
    for field in map(schema.field, range(_size(schema))):
        name = f"{before}{field.name}"
        if str(field.type).startswith("struct<"):
            yield from _leaves(field.type, f"{name}.")
        else:
            yield name, field.type


def _size(fields: Any) -> int:
    """Fields of a schema, or of a struct."""
    return int(getattr(fields, "num_fields", 0)) or len(fields)


def _leaf(table: Any, name: str) -> Any:
    """The column of a name, which may be the path of a field of a struct."""
    if name in table.column_names:
        return table.column(name)
    compute = optional("pyarrow.compute")
    top = max((own for own in table.column_names if name.startswith(f"{own}.")), key=len)
    column, rest = table.column(top), name.removeprefix(f"{top}.")
    while rest:
        fields = [column.type.field(k).name for k in range(column.type.num_fields)]
        field = max((one for one in fields if f"{rest}.".startswith(f"{one}.")), key=len)
        column, rest = compute.struct_field(column, [fields.index(field)]), rest[len(field) + 1 :]
    return column


def _first_list(file: Any, column: str) -> Any:
    """The first list of a column that is there; [] where none is."""
    for batch in file.iter_batches(64, columns=[column]):
        table = optional("pyarrow").Table.from_batches([batch])
        found = next(filter(None, _leaf(table, column).to_pylist()), None)
        if found is not None:
            return found
    return []


def _elements(content: Any) -> list[str]:
    """Names of the numbers in lists and structs within one another: `0`, `1.x`, `0.2`."""
    if not isinstance(content, list | dict):
        return [""]
    items = content.items() if isinstance(content, dict) else enumerate(content)
    return [".".join(filter(None, (str(key), e))) for key, one in items for e in _elements(one)]


def _flat(content: Any) -> list[Any]:
    """The numbers of `_elements`."""
    if not isinstance(content, list | dict):
        return [content]
    items = content.values() if isinstance(content, dict) else content
    return [number for one in items for number in _flat(one)]


def _read(
    parquet: Any, path: Path, columns: Sequence[str], single: Sequence[str]
) -> dict[str, Values]:
    """Columns of one file, (T,) or, where they are not `single` but hold lists, (T, d)."""

    def load(file: Any) -> dict[str, Values]:
        table = file.read(columns=list(columns))
        return {name: _values(_leaf(table, name), path, name) for name in columns}

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
    there = column.drop_null()
    if _is_nested(column.type.value_type) or _is_list(column.type.value_type):
        listed = [_flat(row) for row in there.to_pylist()]
        lengths, flat = [len(row) for row in listed], [number for row in listed for number in row]
    else:
        lengths = optional("pyarrow.compute").list_value_length(there).to_numpy()
        flat = there.flatten().to_numpy(zero_copy_only=False)
    if len(kinds := np.unique(lengths)) > 1:
        got = ", ".join(map(str, kinds))
        raise unusable(path, f"lists of one length in {name}", got, "Leave that column out.")
    rows = np.asarray(flat).reshape(len(there), *kinds)
    if not column.null_count:
        return rows
    found = np.full((len(column), *kinds), np.nan)
    found[column.is_valid().to_numpy(zero_copy_only=False)] = rows
    return found


def _is_list(kind: Any) -> bool:
    return str(kind).startswith(("list<", "fixed_size_list<", "large_list<"))


def _is_nested(kind: Any) -> bool:
    return str(kind).startswith(("struct<", "map<", "extension<", "binary", "large_binary"))


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
