# SPDX-License-Identifier: Apache-2.0
"""What a library of tasks is by its files, before a `TaskFolder` is made of it."""

from pathlib import Path

from intent_recognition.demonstrations import DofSpec, load_dofs
from intent_recognition.model.executions import OUTCOMES
from intent_recognition.model.file import load_model
from intent_recognition.model.history import HISTORY

LIBRARY_MODEL = "model.npz"
"""Its present model, which the nodes load."""


def is_task_folder(path: Path) -> bool:
    """Whether something was learned in a folder, or executed."""
    return (path / HISTORY).is_file() or (path / OUTCOMES).is_file()


def library_dofs(library: str | Path, model: str | Path = "", dofs: str | Path = "") -> DofSpec:
    """The DOFs of a library: as given, else those of its model, else the shipped ones."""
    if dofs:
        return load_dofs(dofs)
    present = Path(library) / LIBRARY_MODEL
    if present.exists() or model:
        return load_model(present if present.exists() else model).dofs
    return load_dofs()
