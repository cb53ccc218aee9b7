# SPDX-License-Identifier: Apache-2.0
"""Export demonstrations as a table or LeRobot data set, with the map that imports it again."""

import csv
import json
from collections.abc import Mapping, Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.demonstrations import DofSpec
from intent_recognition.errors import BagError, optional
from intent_recognition.signals import Demonstration

NAME, TASK, STAMP = "demonstration", "task", "stamp_ns"
"""Columns of every exported table."""
METADATA = "metadata."
"""Prefix of the columns for further texts of the recording, before the key."""
WRITTEN = (".csv", ".parquet")

Columns = dict[str, NDArray[Any]]


def export_columns(demonstrations: Sequence[Demonstration]) -> Columns:
    """Columns with one row for each stamp of each demonstration, NaN for unmeasured DOFs.

    The columns are `demonstration`, `task`, `stamp_ns`, the DOFs in the order of the DOF file, and
    `metadata.KEY` for every text of a recording. Only samples that passed the checks of reading are
    exported. All demonstrations must have the same signals; equal names are numbered.
    """
    names: set[str] = set()
    parts: dict[str, list[NDArray[Any]]] = {}
    keys = sorted({key for one in demonstrations for key in one.metadata})
    for one in demonstrations:
        numbered = (f"{one.name}_{k}" for k in count(2))
        name = next(name for name in chain([one.name], numbered) if name not in names)
        names.add(name)
        signals = (*one.observed, *one.controlled, *one.context)
        stamps = np.unique(np.concatenate([signal.stamps_ns for signal in signals]))
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


def export_map(
    dofs: DofSpec, columns: Mapping[str, object], lerobot: bool = False
) -> dict[str, object]:
    """The map with which `intent import` converts an exported table or data set back to bags."""
    called = {name: f"{key}.{name}" if lerobot else name
              for key, group in _groups(dofs).items() for name in group}  # fmt: skip
    content: dict[str, object] = {}
    observed = (*dofs.observed, *dofs.context)
    for side, entries in (("observed", observed), ("controlled", dofs.controlled)):
        content[side] = [
            {**entry.to_dict(), "columns": [called[name] for name in entry.names]}
            for entry in entries
        ]
    texts = [key for key in columns if key.startswith(METADATA)]
    content |= {
        "time": {"column": STAMP, "unit": "ns", "since": 0},
        "segments": {"column": NAME},
        "task": {"column": TASK},
        "metadata": {key.removeprefix(METADATA): {"column": key} for key in texts},
    }
    return content


def write_table(path: Path, columns: Columns) -> None:
    """Write columns as `.csv` or `.parquet`, by the suffix, with all bits of the numbers.

    Missing values are empty cells in CSV and null in Parquet.

    Raises:
        BagError: the suffix is another.
        MissingPackageError: pyarrow is not installed.
    """
    suffix = path.suffix.lower()
    if suffix == ".parquet":
        arrow, parquet = (optional(m) for m in ("pyarrow", "pyarrow.parquet"))
        arrays = {}
        for name, values in columns.items():
            array = arrow.array(values, mask=np.isnan(values) if values.dtype.kind == "f" else None)
            arrays[name] = array.dictionary_encode() if values.dtype.kind == "O" else array
        parquet.write_table(arrow.table(arrays), path, compression="zstd")
    elif suffix == ".csv":  # csv prints the shortest text that reads as the same number
        cells = [["" if v != v else v for v in values.tolist()] for values in columns.values()]
        with path.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(zip(*cells, strict=True))
    else:
        expected = f"a file ending in {' or '.join(WRITTEN)}, or a name without ending"
        raise BagError.about("--output", expected, path.name, "Name the file so.")


HUMAN, ROBOT = "observation.human", "observation.state"
"""LeRobot features of the observed and of the controlled DOFs."""
VERSION = "v3.0"
CHUNK = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
INDEX = "__index_level_0__"
"""Pandas' name for an index without a name, such as that of tasks.parquet."""
OWN = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64",
       "task_index": "int64"}  # fmt: skip
"""Features of every LeRobot data set, with their types."""


def write_lerobot(folder: Path, columns: Columns, dofs: DofSpec) -> None:
    """Write exported columns as a LeRobot data set in a new folder.

    Each demonstration is an episode with one row per stamp. `stamp_ns` is exact, and `timestamp`
    counts frames at the median rate, as LeRobot expects. Values have 64 bits, and are NaN for
    unmeasured DOFs.

    Raises:
        BagError: the folder exists already.
        MissingPackageError: pyarrow is not installed.
    """
    arrow, parquet = (optional(m) for m in ("pyarrow", "pyarrow.parquet"))
    if folder.exists():
        raise BagError.about(str(folder), "a folder to make", "one that exists", "Name another.")
    names = columns[NAME].tolist()
    starts = [k for k, name in enumerate(names) if k == 0 or name != names[k - 1]]
    lengths = np.diff([*starts, len(names)])
    frames = np.concatenate([np.arange(length) for length in lengths])
    steps_ns = np.diff(columns[STAMP])[frames[1:] > 0]
    fps = max(1, round(1e9 / float(np.median(steps_ns)))) if steps_ns.size else 1
    tasks = list(dict.fromkeys(columns[TASK].tolist()))
    own = {
        "timestamp": (frames / fps).astype(np.float32),
        "frame_index": frames,
        "episode_index": np.repeat(np.arange(len(lengths)), lengths),
        "index": np.arange(len(names)),
        "task_index": np.array([tasks.index(task) for task in columns[TASK].tolist()]),
    }
    groups = _groups(dofs)
    values = {
        key: np.column_stack([columns[name] for name in group])
        for key, group in groups.items()
        if group
    }
    texts = [NAME, *(key for key in columns if key.startswith(METADATA))]
    data = {
        **{key: arrow.FixedSizeListArray.from_arrays(array.ravel(), array.shape[1])
           for key, array in values.items()},
        STAMP: columns[STAMP],
        **{key: arrow.array(columns[key].tolist(), arrow.string()) for key in texts},
        **own,
    }  # fmt: skip
    features = {
        **{key: _feature("float64", len(groups[key]), groups[key]) for key in values},
        STAMP: _feature("int64"),
        **{key: _feature("string") for key in texts},
        **{key: _feature(kind) for key, kind in OWN.items()},
    }
    info = {
        "codebase_version": VERSION, "robot_type": None, "total_episodes": len(lengths),
        "total_frames": len(names), "total_tasks": len(tasks), "chunks_size": 1000,
        "data_files_size_in_mb": 100, "video_files_size_in_mb": 200, "fps": fps,
        "splits": {"train": f"0:{len(lengths)}"}, "data_path": f"data/{CHUNK}",
        "video_path": None, "features": features,
    }  # fmt: skip
    first = CHUNK.format(chunk_index=0, file_index=0)
    for path, table in (
        (f"data/{first}", arrow.table(data)),
        (f"meta/episodes/{first}", _episodes(arrow, starts, lengths, columns[TASK])),
        ("meta/tasks.parquet", _tasks(arrow, tasks)),
    ):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(table, folder / path)
    stats = {key: _statistics(array) for key, array in {**values, **own}.items()}
    for name, content in (("info", info), ("stats", stats)):
        (folder / f"meta/{name}.json").write_text(json.dumps(content, indent=2), encoding="utf-8")


def _feature(kind: str, size: int = 1, names: Sequence[str] | None = None) -> dict[str, object]:
    return {"dtype": kind, "shape": [size], "names": list(names) if names is not None else None}


def _episodes(arrow: Any, starts: Sequence[int], lengths: NDArray, tasks: NDArray) -> Any:
    count = len(starts)
    zeros = [0] * count
    return arrow.table(
        {
            "episode_index": list(range(count)),
            "tasks": [[tasks[start]] for start in starts],
            "length": lengths.tolist(),
            "data/chunk_index": zeros,
            "data/file_index": zeros,
            "dataset_from_index": list(starts),
            "dataset_to_index": (np.array(starts) + lengths).tolist(),
            "meta/episodes/chunk_index": zeros,
            "meta/episodes/file_index": zeros,
        }
    )


def _tasks(arrow: Any, tasks: Sequence[str]) -> Any:
    """Table of task numbers, with the texts stored like a pandas index."""
    table = arrow.table({"task_index": list(range(len(tasks))), INDEX: list(tasks)})
    about = {
        "index_columns": [INDEX],
        "column_indexes": [],
        "columns": [
            {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy_type,
             "metadata": None}
            for name, field, kind, numpy_type in (
                ("task_index", "task_index", "int64", "int64"), (None, INDEX, "unicode", "object")
            )
        ],
        "pandas_version": "2.0.0",
    }  # fmt: skip
    return table.replace_schema_metadata({b"pandas": json.dumps(about).encode()})


def _statistics(values: NDArray) -> dict[str, list]:
    """Statistics of each column, ignoring unmeasured values."""
    table = values.reshape(len(values), -1).astype(np.float64)
    table[~np.isfinite(table)] = np.nan
    table[:, np.isnan(table).all(axis=0)] = 0.0
    kinds = ("min", "max", "mean", "std")
    found = {kind: getattr(np, f"nan{kind}")(table, axis=0).tolist() for kind in kinds}
    return found | {"count": [len(table)]}


def _groups(dofs: DofSpec) -> dict[str, Sequence[str]]:
    """Names of the DOFs of each feature."""
    return {HUMAN: (*dofs.observed_names, *dofs.context_names), ROBOT: dofs.controlled_names}
