# SPDX-License-Identifier: Apache-2.0
"""Contents of a task folder: its DOFs, its model, and the state of its recordings."""

from pathlib import Path

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import CORRECTED, DofSpec, load_dofs
from intent_recognition.errors import BagError, TrainingError
from intent_recognition.model.executions import OUTCOMES
from intent_recognition.model.file import load_model
from intent_recognition.model.from_bags import FromBags
from intent_recognition.model.history import HISTORY

LIBRARY_MODEL = "model.npz"
"""Name of the present model, which the nodes load."""


def is_task_folder(path: Path) -> bool:
    """Whether tasks were learned or executed in a folder."""
    return (path / HISTORY).is_file() or (path / OUTCOMES).is_file()


def library_dofs(library: str | Path, model: str | Path = "", dofs: str | Path = "") -> DofSpec:
    """DOFs of a library: the given ones, or else those of its model, or else the shipped ones."""
    if dofs:
        return load_dofs(dofs)
    present = Path(library) / LIBRARY_MODEL
    if present.exists() or model:
        return load_model(present if present.exists() else model).dofs
    return load_dofs()


def is_correction(bag: Path) -> bool:
    """Whether a recording is a corrected execution."""
    return CORRECTED in BagReader(bag, tolerant=True).custom_data


def is_finished(bag: Path) -> bool:
    """Whether a recording was closed properly."""
    try:
        return BagReader(bag, tolerant=True).is_finished
    except BagError:
        return False


def check_usable(found: FromBags, bag: Path) -> None:
    """Raise an error with the reasons if nothing of a recording can be used."""
    if found.accumulated.n_used:
        return
    reasons = [str(r) for r in found.rejections] + [r for _, r in found.accumulated.rejected]
    expected = "a recording of one movement, at rest before and after"
    cure = "Record it again; this one is kept in `undone`."
    raise TrainingError.about(bag.name, expected, "; ".join(reasons[:3]) or "nothing", cure)
