# SPDX-License-Identifier: Apache-2.0
"""Read columns of Parquet files and LeRobot data sets by pyarrow."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from intent_recognition.errors import BagError, one_line, optional
from intent_recognition.tables.by_body import by_body, flat
from intent_recognition.tables.cells import Values, numbers
from intent_recognition.tables.table import Table, check_columns, unusable
from intent_recognition.untrusted import (
    MOST_ARRAYS,
    UntrustedError,
    check_regular,
    load_json,
    read_text,
)


def open_parquet(path: Path) -> Table:
    """Open a Parquet file, with list elements `NAME.0`, ... and struct fields `NAME.FIELD`."""
    return by_body(parquet_table(path, [path], {}))


def parquet_table(source: Path, files: Sequence[Path], names: Mapping[str, Sequence[str]]) -> Table:
    """Join files with one schema, in order, to one table of `source`, a file or folder.

    `names` holds the names of the elements of list columns, if they have any.
    """
    places = _places(files[0], names)
    own = [name for name, (_, element, alias) in places.items() if not alias]
    numbers = {places[name][:2]: k for k, name in enumerate(own)}
    aliases = {name: numbers[place[:2]] for name, place in places.items() if place[2]}
    # pyarrow reads no fields of structs as dictionaries if there are several row groups
    whole = set(_with_file(files[0], lambda file: file.schema_arrow.names))

    def read(wanted: Sequence[int]) -> list[Values]:
        chosen = [places[own[k]] for k in wanted]
        stored = list(dict.fromkeys(column for column, _, _ in chosen))
        _check_size(files, stored)
        single = [column for column, element, _ in chosen if element is None and column in whole]
        parts = [_read(file, stored, single) for file in files]
        columns = {name: np.concatenate([part[name] for part in parts]) for name in stored}
        return [
            columns[column] if element is None else columns[column][:, element]
            for column, element, _ in chosen
        ]

    units = _with_file(files[0], _units)
    said = {k: units.get(places[name][0], "") for k, name in enumerate(own)}
    return Table(source, tuple(own), read, aliases=aliases, units=said)


def _units(file: Any) -> dict[str, str]:
    """Units of stored columns, from the metadata of their fields, "" for none."""
    fields = _flattened(file.schema_arrow.empty_table()).schema
    said = {field.name: field.metadata or {} for field in fields}
    found = {name: about.get(b"unit", about.get(b"units", b"")) for name, about in said.items()}
    return {name: unit.decode(errors="replace") for name, unit in found.items()}


def _places(
    path: Path, names: Mapping[str, Sequence[str]]
) -> dict[str, tuple[str, int | None, bool]]:
    """Stored column and element for each name, and whether the name is an alias."""
    places: dict[str, tuple[str, int | None, bool]] = {}

    def look(file: Any) -> None:
        for field in _flattened(file.schema_arrow.empty_table()).schema:
            column, kind = field.name, field.type
            if not _is_list(kind):
                if not _is_nested(kind):
                    levels = re.findall(r"'([^']*)'", column) if column[:2] == "('" else [column]
                    places[".".join(levels)] = (column, None, False)
                continue
            _check_size([path], [column])
            elements = [name for name, _ in flat(_first_list(file, column))]
            elements = sorted(elements) if _is_nested(kind.value_type) else elements
            count = len(elements)
            check_columns(path, len(places) + count)
            named = list(names.get(column, ()))
            for k, element in enumerate(elements):
                if len(named) == count:
                    places[f"{column}.{named[k]}"] = (column, k, False)
                places.setdefault(f"{column}.{element}", (column, k, len(named) == count))
            if count == 1:
                places.setdefault(column, (column, 0, True))

    _with_file(path, look)
    return places


def _flattened(table: Any) -> Any:
    """A table with a column for each field of its structs, named by the field's path."""
    while any(str(kind).startswith("struct<") for kind in table.schema.types):
        table = table.flatten()
    return table


def _first_list(file: Any, column: str) -> Any:
    """The first non-empty list of a column; [] if there is none."""
    for batch in file.iter_batches(64, columns=[column]):
        table = _flattened(optional("pyarrow").Table.from_batches([batch]))
        found = next(filter(None, table.column(column).to_pylist()), None)
        if found is not None:
            return found
    return []


def _read(path: Path, columns: Sequence[str], single: Sequence[str]) -> dict[str, Values]:
    """Columns of one file, (T,) for single values or (T, d) for lists."""

    def load(file: Any) -> dict[str, Values]:
        table = _flattened(file.read(columns=list(columns)))
        return {name: _values(table.column(name), path, name) for name in columns}

    found: dict[str, Values] = _with_file(path, load, single)
    return found


def _check_size(files: Sequence[Path], columns: Sequence[str]) -> None:
    """Bound the memory of columns, over all files, before any is read."""
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
        _with_file(path, look)


def _values(column: Any, path: Path, name: str) -> Values:
    """Convert a column from Arrow to numpy; nulls become NaN, or None in texts."""
    column = column.unify_dictionaries().combine_chunks()
    if str(column.type).startswith("dictionary<"):  # equal texts are stored once
        known = np.array([*column.dictionary.to_pylist(), None], object)
        return np.asarray(known[column.indices.fill_null(len(known) - 1).to_numpy()])
    if not _is_list(column.type):
        if column.null_count and str(column.type).startswith(("int", "uint")):
            return np.array([None if v is None else str(v) for v in column.to_pylist()], object)
        return np.asarray(column.to_numpy(zero_copy_only=False))
    there = column.drop_null()
    if _is_nested(column.type.value_type) or _is_list(column.type.value_type):
        listed = [[*flat(row)] for row in there.to_pylist()]
        if _is_nested(column.type.value_type):  # the order of named elements may differ
            listed = [sorted(row, key=itemgetter(0)) for row in listed]
            named = {tuple(key for key, _ in row) for row in listed}
            if len(named) > len({*map(len, named)}):
                cure = "Leave that column out."
                raise unusable(path, f"lists of the same names in {name}", "others", cure)
        lengths = [len(row) for row in listed]
        every = [number for row in listed for _, number in row]
    else:
        lengths = optional("pyarrow.compute").list_value_length(there).to_numpy()
        every = there.flatten().to_numpy(zero_copy_only=False)
    if len(kinds := np.unique(lengths)) > 1:
        got = ", ".join(map(str, kinds))
        raise unusable(path, f"lists of one length in {name}", got, "Leave that column out.")
    rows = np.asarray(every).reshape(len(there), *kinds)
    if not column.null_count:
        return rows
    found = np.full((len(column), *kinds), np.nan)
    found[column.is_valid().to_numpy(zero_copy_only=False)] = rows
    return found


def _is_list(kind: Any) -> bool:
    return str(kind).startswith(("list<", "fixed_size_list<", "large_list<"))


def _is_nested(kind: Any) -> bool:
    return str(kind).startswith(("struct<", "map<", "extension<", "binary", "large_binary"))


def _with_file(path: Path, action: Callable[[Any], Any], single: Sequence[str] = ()) -> Any:
    """Apply `action` to an open file, storing equal texts of columns `single` once; or BagError."""
    parquet = optional("pyarrow.parquet")
    try:
        check_regular(path)
        with parquet.ParquetFile(path, read_dictionary=list(single)) as file:
            return action(file)
    except (BagError, MemoryError):
        raise
    except Exception as error:  # pyarrow may raise anything
        cure = "Write or download it again."
        raise unusable(path, "a Parquet file", one_line(error), cure) from error


MOST_LINES = 2**26
"""Largest accepted `.jsonl` file [bytes]; a million tasks take 60 MB."""


def open_lerobot(folder: Path) -> Table:
    """Open all episodes of a LeRobot data set of version 2 or 3, described by its `meta`.

    Elements of a feature are named as in `info.json`, and also `FEATURE.0`, `FEATURE.1`, ... The
    column `task` holds the text of each row's task.
    """
    path = folder / "meta" / "info.json"
    try:
        info = load_json(read_text(path))
        version, features = str(info["codebase_version"]), dict(info["features"])
        pattern = re.sub(r"\{[^}]*\}", "*", str(info["data_path"]))
        names = {key: _feature_names(feature) for key, feature in features.items()}
    except (OSError, UntrustedError, KeyError, TypeError, ValueError, AttributeError) as error:
        expected = "codebase_version, features and data_path of a LeRobot data set"
        raise unusable(path, expected, one_line(error), "Download it again.") from error
    if not version.startswith(("v2.", "v3.")):
        raise unusable(path, "version 2 or 3", version, "Convert it with LeRobot's own script.")
    if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
        raise unusable(path, "a data_path inside of the folder", pattern, "Correct it.")
    try:
        files = sorted(folder.glob(pattern))
    except (ValueError, IndexError):  # not a valid pattern
        files = []
    if not files:
        raise unusable(folder, f"files {pattern}", "none", "Download the folder data as well.")
    table = parquet_table(folder, files, names)

    tasks_at = table.find("task_index")
    has_tasks = any(path.is_file() for path in _task_files(folder))

    def read(wanted: Sequence[int]) -> list[Values]:
        stored = [k for k in wanted if k < len(table.names)]
        if len(stored) == len(wanted) or tasks_at is None:
            return list(table.read(stored))
        *found, numbered = table.read([*stored, tasks_at])
        tasks = _tasks(folder) if has_tasks else {}
        indices = numbers(numbered, folder, "task_index").tolist()
        if any(tasks.values()) or not has_tasks:  # else there are no labels
            tasks |= {k: f"task_index {k:g}" for k in indices if not tasks.get(k)}
        text = np.array([tasks.get(k, "") for k in indices], object)
        return [text if k == len(table.names) else found[stored.index(k)] for k in wanted]

    defaults: dict[str, object] = {
        "time": {"column": "timestamp", "unit": "s"},
        "segments": {"column": "episode_index"},
    }
    if table.find("timestamp") is None:
        defaults["time"] = {"rate": info.get("fps")}
    missing = "column task_index" if tasks_at is None else "meta/tasks.jsonl or .parquet"
    notes = [f"there is no {missing}: give the tasks in the map"]
    notes = notes if tasks_at is None or not has_tasks else []
    there = sum(_with_file(file, lambda one: one.metadata.num_rows) for file in files)
    if isinstance(total := info.get("total_frames"), int) and there < total:
        notes.append(f"there are {there} of {total} frames: download the rest of the folder data")
    table = replace(table, defaults=defaults, notes=tuple(notes))
    if tasks_at is None or not (has_tasks or len(set(table.read([tasks_at])[0].tolist())) > 1):
        return table
    defaults["task"] = {"column": "task"}
    return replace(table, names=(*table.names, "task"), read=read)


def _feature_names(feature: Mapping) -> list[str]:
    """Names of a feature's elements in `info.json`; [] unless all elements have one."""
    names = feature.get("names")
    if isinstance(names, Mapping):  # {"motors": [...]}, or {"x": 0, "y": 1}
        inner = list(names.values())
        names = inner[0] if len(inner) == 1 and isinstance(inner[0], list) else list(names)
    shape = list(feature.get("shape") or [])
    named = [str(name) for name in names] if isinstance(names, list) else []
    return named if shape == [len(named)] and len(set(named)) == len(named) else []


def _task_files(folder: Path) -> tuple[Path, Path]:
    return folder / "meta" / "tasks.jsonl", folder / "meta" / "tasks.parquet"


def _tasks(folder: Path) -> dict[float, str]:
    """Text of each task by its index: `tasks.jsonl` of version 2, `tasks.parquet` of version 3."""
    lines, table = _task_files(folder)
    try:
        if lines.is_file():
            rows = [load_json(line) for line in read_text(lines, MOST_LINES).splitlines() if line]
            return {float(row["task_index"]): str(row["task"]) for row in rows}
        columns = open_parquet(table)  # the text is an index of pandas, whose name varies
        texts = next(name for name in columns.names if name != "task_index")
        found = columns.columns(["task_index", texts])
        indices = numbers(found["task_index"], table, "task_index").tolist()
        return {k: str(text) for k, text in zip(indices, found[texts], strict=True)}
    except (OSError, UntrustedError, KeyError, TypeError, ValueError, StopIteration) as error:
        cure = "Name the tasks in the map: task."
        raise unusable(folder, "meta/tasks.jsonl or .parquet", one_line(error), cure) from error
