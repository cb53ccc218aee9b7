# SPDX-License-Identifier: Apache-2.0
"""The file that keeps the trials: one table per experiment, and what made them."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.constraints.trials import COLUMNS
from intent_recognition.array_types import Floats
from intent_recognition.errors import ModelError

TRIALS_FILE = "config/pouring_trials.npz"
"""The shipped trials, below the share folder."""
FORMAT = 1
"""Version of the file; another one is not read."""


@dataclass(frozen=True)
class Trials:
    """All trials.

    Attributes:
        tables: per experiment its columns by name (`COLUMNS`), each (N,).
        origin: how they were made: seed, version, blocks.
    """

    tables: Mapping[str, Mapping[str, Floats]]
    origin: Mapping[str, object]


def write_trials(path: Path, rows: Mapping[str, Floats], origin: Mapping[str, object]) -> None:
    """Write tables (N, columns) at once: the file is either complete or not there.

    Equal tables give equal bytes.
    """
    arrays = {name: np.asarray(table, dtype=np.float32) for name, table in rows.items()}
    note = json.dumps({"format": FORMAT, **origin}, sort_keys=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    half = path.with_name(path.name + ".half.npz")
    with half.open("wb") as stream:
        np.savez_compressed(stream, origin=np.array(note), **arrays)  # type: ignore[arg-type]  # numpy 2.2 stubs: names of arrays meet the name `allow_pickle`
        stream.flush()
        os.fsync(stream.fileno())
    half.replace(path)


def read_trials(path: Path) -> Trials:
    """Read the file.

    Raises:
        ModelError: it is missing, of another format, or a table has the wrong shape.
    """
    cure = "Install the package again, or run `python -m experiments.constraints.dataset`."
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        origin = json.loads(str(arrays.pop("origin")))
    except (OSError, ValueError, KeyError) as error:
        raise ModelError.about(str(path), "a file of trials", error, cure) from error
    if origin.get("format") != FORMAT:
        raise ModelError.about(str(path), f"format {FORMAT}", origin.get("format"), cure)
    tables = {}
    for name, columns in COLUMNS.items():
        table = arrays.get(name, np.zeros(0))
        if table.ndim != 2 or table.shape[1] != len(columns) or not np.isfinite(table).all():
            expected = f"finite numbers in {len(columns)} columns"
            raise ModelError.about(f"{path}: {name}", expected, table.shape, cure)
        tables[name] = dict(zip(columns, table.T.astype(np.float64), strict=True))
    return Trials(tables, origin)
