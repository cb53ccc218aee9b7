# SPDX-License-Identifier: Apache-2.0
"""Demonstrations as one table, CSV or Parquet, and the map that imports it again."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.demonstrations import DofSpec
from intent_recognition.errors import BagError, optional
from intent_recognition.signals import Demonstration

NAME, TASK, STAMP = "demonstration", "task", "stamp_ns"
"""Columns that every exported table has."""
METADATA = "metadata."
"""Before the key of a further text of the recording, in the name of its column."""
WRITTEN = (".csv", ".parquet")

Columns = dict[str, NDArray[Any]]


def export_columns(demonstrations: Sequence[Demonstration]) -> Columns:
    """One row for each stamp of each demonstration, NaN where a DOF was not measured then.

    Columns are `demonstration`, `task`, `stamp_ns`, the DOFs, in the order of the DOF file, and
    `metadata.KEY` for every text that a recording has. Samples are those that passed the checks of
    reading. Two demonstrations of the same name are told apart by a number.

    Args:
        demonstrations: with the same signals.
    """
    names: dict[str, int] = {}
    parts: dict[str, list[NDArray[Any]]] = {}
    keys = sorted({key for one in demonstrations for key in one.metadata})
    for one in demonstrations:
        names[one.name] = names.get(one.name, 0) + 1
        count = names[one.name]
        signals = (*one.observed, *one.controlled, *one.context)
        stamps = np.unique(np.concatenate([signal.stamps_ns for signal in signals]))
        name = one.name if count == 1 else f"{one.name}_{count}"
        texts = {NAME: name, TASK: one.task or ""}
        texts |= {METADATA + key: one.metadata.get(key, "") for key in keys}
        parts.setdefault(STAMP, []).append(stamps)
        for signal in signals:
            values = np.full((stamps.size, len(signal.names)), np.nan)
            values[np.searchsorted(stamps, signal.stamps_ns)] = signal.values
            for dof, column in zip(signal.names, values.T, strict=True):
                parts.setdefault(dof, []).append(column)
        for key, text in texts.items():
            parts.setdefault(key, []).append(np.full(stamps.size, text, object))
    ends = {NAME, TASK, STAMP}
    dofs = [key for key in parts if key not in ends and not key.startswith(METADATA)]
    order = [NAME, TASK, STAMP, *dofs, *(METADATA + key for key in keys)]
    return {key: np.concatenate(parts[key]) for key in order}


def export_map(dofs: DofSpec, columns: Mapping[str, object]) -> dict[str, object]:
    """The map with which `intent import` makes bags of an exported table again."""
    content: dict[str, object] = {}
    observed = (*dofs.observed, *dofs.context)
    for side, entries in (("observed", observed), ("controlled", dofs.controlled)):
        content[side] = [{**entry.to_dict(), "columns": list(entry.names)} for entry in entries]
    texts = [key for key in columns if key.startswith(METADATA)]
    content |= {
        "time": {"column": STAMP, "unit": "ns", "since": 0},
        "segments": {"column": NAME},
        "task": {"column": TASK},
        "metadata": {key.removeprefix(METADATA): {"column": key} for key in texts},
    }
    return content


def write_table(path: Path, columns: Columns) -> None:
    """Write columns as `.csv` or `.parquet`, by the suffix: numbers to the last bit.

    In a CSV what is missing is an empty cell, in Parquet it is null.

    Raises:
        BagError: another suffix.
        MissingPackageError: pyarrow is not installed.
    """
    suffix = path.suffix.lower()
    if suffix == ".parquet":
        _write_parquet(path, columns)
    elif suffix == ".csv":
        _write_csv(path, columns)
    else:
        expected = f"a file ending in {' or '.join(WRITTEN)}, or a name without ending"
        raise BagError.about("--output", expected, path.name, "Name the file so.")


def _write_csv(path: Path, columns: Columns) -> None:
    cells = [_cells(values) for values in columns.values()]
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*cells, strict=True))


def _cells(values: NDArray[Any]) -> list[object]:
    """Values as Python prints them: the shortest text that reads as the same number."""
    if values.dtype.kind == "f":
        return ["" if value != value else value for value in values.tolist()]
    return list(values.tolist())


def _write_parquet(path: Path, columns: Columns) -> None:
    arrow, parquet = (optional(m) for m in ("pyarrow", "pyarrow.parquet"))
    arrays = {}
    for name, values in columns.items():
        array = arrow.array(values, mask=np.isnan(values) if values.dtype.kind == "f" else None)
        arrays[name] = array.dictionary_encode() if values.dtype.kind == "O" else array
    parquet.write_table(arrow.table(arrays), path, compression="zstd")
