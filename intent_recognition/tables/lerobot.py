# SPDX-License-Identifier: Apache-2.0
"""LeRobot data sets, of version 2 or 3."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from intent_recognition.errors import one_line
from intent_recognition.tables.cells import Values, numbers
from intent_recognition.tables.parquet import open_parquet, parquet_table
from intent_recognition.tables.table import Table, unusable
from intent_recognition.untrusted import UntrustedError, load_json, read_text

MOST_LINES = 2**26
"""Bytes of a `.jsonl` file. Convention: a million tasks take 60 MB."""


def open_lerobot(folder: Path) -> Table:
    """All episodes of a LeRobot data set of version 2 or 3, as its `meta` describes them.

    Elements of a feature have the names that `info.json` gives them, and `FEATURE.0`, `FEATURE.1`,
    ... The column `task` holds the text of each row's task.
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
    except (ValueError, IndexError):  # no pattern at all
        files = []
    if not files:
        raise unusable(folder, f"files {pattern}", "none", "Download the folder data as well.")
    table = parquet_table(folder, files, names)

    tasks_at = table.find("task_index")

    def read(wanted: Sequence[int]) -> list[Values]:
        stored = [k for k in wanted if k < len(table.names)]
        if len(stored) == len(wanted) or tasks_at is None:
            return list(table.read(stored))
        *found, numbered = table.read([*stored, tasks_at])
        tasks = _tasks(folder)
        indices = numbers(numbered, folder, "task_index").tolist()
        text = np.array([tasks.get(k, "") for k in indices], object)
        return [text if k == len(table.names) else found[stored.index(k)] for k in wanted]

    defaults: dict[str, object] = {
        "time": {"column": "timestamp", "unit": "s"},
        "segments": {"column": "episode_index"},
    }
    if not any(path.is_file() for path in _task_files(folder)):
        notes = ("there is no meta/tasks.jsonl or .parquet: give the tasks in the map",)
        return replace(table, defaults=defaults, notes=notes)
    defaults["task"] = {"column": "task"}
    return Table(folder, (*table.names, "task"), read, aliases=table.aliases, defaults=defaults)


def _feature_names(feature: Mapping) -> list[str]:
    """What `info.json` calls the elements of a feature; [] where it does not, or not all."""
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
        columns = open_parquet(table)  # the text is an index of pandas, under several names
        texts = next(name for name in columns.names if name != "task_index")
        found = columns.columns(["task_index", texts])
        indices = numbers(found["task_index"], table, "task_index").tolist()
        return {k: str(text) for k, text in zip(indices, found[texts], strict=True)}
    except (OSError, UntrustedError, KeyError, TypeError, ValueError, StopIteration) as error:
        cure = "Name the tasks in the map: task."
        raise unusable(folder, "meta/tasks.jsonl or .parquet", one_line(error), cure) from error
