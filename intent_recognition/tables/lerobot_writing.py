# SPDX-License-Identifier: Apache-2.0
"""Demonstrations as a LeRobot data set of version 3, that `intent import` makes bags of again."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.demonstrations import DofSpec
from intent_recognition.errors import BagError, optional
from intent_recognition.tables.exporting import METADATA, NAME, STAMP, TASK, Columns, export_map

HUMAN, ROBOT = "observation.human", "observation.state"
"""Features of the observed and of the controlled DOFs."""
VERSION = "v3.0"
CHUNK = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
INDEX = "__index_level_0__"
"""What pandas calls an index without a name: that of tasks.parquet."""
OWN = {"timestamp": "float32", "frame_index": "int64", "episode_index": "int64", "index": "int64",
       "task_index": "int64"}  # fmt: skip
"""Features that every data set has."""


def write_lerobot(folder: Path, columns: Columns, dofs: DofSpec) -> dict[str, object]:
    """Write exported columns as a data set; returns the map that imports it again.

    An episode is a demonstration, a row a stamp: `stamp_ns` has it to the nanosecond, and
    `timestamp` counts frames at the median rate, as LeRobot expects. Values are of 64 bits, NaN
    where a DOF was not measured then.

    Args:
        folder: to make.
        columns: of `export_columns`.
        dofs: of the demonstrations.

    Raises:
        BagError: the folder is there already.
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
    groups = {HUMAN: _names(dofs, ("observed", "context")), ROBOT: _names(dofs, ("controlled",))}
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
    return _map(dofs, columns, groups)


def _names(dofs: DofSpec, sides: Sequence[str]) -> list[str]:
    return [name for side in sides for entry in getattr(dofs, side) for name in entry.names]


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
    """Numbers of the tasks, with their texts as pandas stores an index."""
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
    """Of each column, without what was not measured."""
    table = values.reshape(len(values), -1).astype(np.float64)
    table[~np.isfinite(table)] = np.nan
    table[:, np.isnan(table).all(axis=0)] = 0.0
    kinds = ("min", "max", "mean", "std")
    found = {kind: getattr(np, f"nan{kind}")(table, axis=0).tolist() for kind in kinds}
    return found | {"count": [len(table)]}


def _map(dofs: DofSpec, columns: Columns, groups: Mapping[str, Sequence[str]]) -> dict[str, object]:
    """The map of a table, its columns as the data set calls them."""
    content = export_map(dofs, columns)
    called = {name: f"{key}.{name}" for key, group in groups.items() for name in group}
    for side in ("observed", "controlled"):
        entries: Any = content[side]
        for entry in entries:
            entry["columns"] = [called[name] for name in entry["columns"]]
    return content
