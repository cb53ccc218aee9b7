# SPDX-License-Identifier: Apache-2.0
"""The model file: one `.npz` without pickled objects, checked on reading."""

import json
import os
import tempfile
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from intent_recognition.alignment.onset import OnsetSettings
from intent_recognition.errors import DofError, IntentError, ModelError, describe
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.storage.dofs import DofSpec

FORMAT_VERSION = 1
RETRAIN = "Train it again with `intent train`."
NUMBERS = (
    "weight_mean",
    "weight_covariance",
    "noise_variance",
    "noise_scale",
    "correlation_time_s",
    "log_duration_mean",
    "log_duration_std",
    "task_prior",
    "transition_prior",
    "none_mean",
    "none_covariance",
    "none_log_duration",
    "none_prior",
    "n_demonstrations",
    "observed_groups",
)
SCALARS = ("noise_scale", "correlation_time_s", "none_prior")


@dataclass(frozen=True)
class Model:
    """A library together with the DOF file it was trained with.

    Attributes:
        library: the learned tasks.
        dofs: where its DOFs come from.
    """

    library: TaskLibrary
    dofs: DofSpec

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the tasks."""
        return self.library.labels

    @property
    def controlled_names(self) -> tuple[str, ...]:
        """Names of the controlled DOFs: the robot's joints."""
        return self.library.controlled_names


def save_model(path: str | Path, model: Model) -> None:
    """Write the model; the file appears whole or not at all.

    Raises:
        ModelError: the folder cannot be written to.
    """
    library = model.library
    arrays = {name: np.asarray(getattr(library, name)) for name in NUMBERS}
    header = {
        "format_version": FORMAT_VERSION,
        "labels": library.labels,
        "basis": asdict(library.basis),
        "onset": [asdict(settings) for settings in library.onset],
        "dofs": model.dofs.to_dict(),
        "provenance": dict(library.provenance),
    }
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".npz.part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez_compressed(file, header=np.array(json.dumps(header)), **arrays)
            Path(temporary).chmod(0o644)
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise ModelError(
            describe(str(path), "a file that can be written", error, "Choose another --output.")
        ) from error


def load_model(path: str | Path) -> Model:
    """Read and check a model file.

    Raises:
        ModelError: no such file, not a model, unknown version, missing array, wrong shape, or a
            value that is not finite.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            content = {name: file[name] for name in file.files}
    except (OSError, ValueError, zipfile.BadZipFile, EOFError, KeyError) as error:
        raise ModelError(
            describe(str(path), "a model file written by `intent train`", error, RETRAIN)
        ) from error
    header = _header(path, content)
    for name in NUMBERS:
        if name not in content:
            raise ModelError(describe(f"{path}: {name}", "an array", "none", RETRAIN))
    try:
        dofs = DofSpec.from_dict(header["dofs"], f"{path}: dofs")
        library = _library(header, content, dofs)
    except (KeyError, TypeError, ValueError, DofError) as error:
        if isinstance(error, IntentError):
            raise ModelError(f"{path}: {error}") from error
        raise ModelError(describe(f"{path}: header", "a complete one", error, RETRAIN)) from error
    _check(path, library)
    return Model(library, dofs)


def check_dofs(model: Model, dofs: DofSpec, source: str) -> None:
    """Make sure that a DOF file is the one the model was trained with.

    Raises:
        DofError: they differ; both sides are named.
    """
    ours, theirs = model.dofs.to_dict(), dofs.to_dict()
    for side in ("observed", "controlled"):
        if ours[side] != theirs[side]:
            raise DofError(
                describe(
                    f"{source}: {side}",
                    f"the DOFs of the model, {json.dumps(ours[side])}",
                    json.dumps(theirs[side]),
                    "Use the DOF file the model was trained with, or train again.",
                )
            )


def _header(path: str | Path, content: dict[str, np.ndarray]) -> dict:
    try:
        header = json.loads(str(content["header"]))
        version = header["format_version"]
    except (KeyError, TypeError, ValueError) as error:
        raise ModelError(
            describe(f"{path}: header", "JSON with a format_version", error, RETRAIN)
        ) from error
    if version != FORMAT_VERSION:
        raise ModelError(
            describe(
                f"{path}: format_version",
                str(FORMAT_VERSION),
                version,
                "Install the package version that wrote it, or train again.",
            )
        )
    return header


def _library(header: dict, content: dict[str, np.ndarray], dofs: DofSpec) -> TaskLibrary:
    numbers = {name: content[name] for name in NUMBERS}
    for name in SCALARS:
        numbers[name] = float(numbers[name])
    numbers["observed_groups"] = tuple(int(n) for n in numbers["observed_groups"])
    return TaskLibrary(
        labels=tuple(header["labels"]),
        basis=NormalizedRBFBasis(**header["basis"]),
        observed_names=dofs.observed_names,
        controlled_names=dofs.controlled_names,
        observed_units=tuple(entry.unit for entry in dofs.observed for _ in entry.names),
        controlled_units=tuple(entry.unit for entry in dofs.controlled for _ in entry.names),
        onset=tuple(OnsetSettings(**settings) for settings in header["onset"]),
        provenance=header["provenance"],
        **numbers,
    )


def _check(path: str | Path, library: TaskLibrary) -> None:
    tasks, size = library.n_tasks, library.n_observed_weights
    total = size + library.n_controlled * library.basis.n_basis
    shapes = {
        "weight_mean": (tasks, total),
        "weight_covariance": (tasks, total, total),
        "noise_variance": (library.n_observed + library.n_controlled,),
        "log_duration_mean": (tasks,),
        "log_duration_std": (tasks,),
        "task_prior": (tasks,),
        "transition_prior": (tasks + 1, tasks),
        "none_mean": (size,),
        "none_covariance": (size, size),
        "none_log_duration": (2,),
        "n_demonstrations": (tasks,),
    }
    for name, shape in shapes.items():
        array = np.asarray(getattr(library, name))
        if array.shape != shape:
            raise ModelError(describe(f"{path}: {name}", f"shape {shape}", array.shape, RETRAIN))
        if not np.all(np.isfinite(array)):
            raise ModelError(describe(f"{path}: {name}", "finite numbers", "NaN or inf", RETRAIN))
    if not np.all(np.isfinite([getattr(library, name) for name in SCALARS])):
        raise ModelError(describe(f"{path}: {SCALARS}", "finite numbers", "NaN or inf", RETRAIN))
    groups = (sum(library.observed_groups), len(library.onset))
    if groups != (library.n_observed, len(library.observed_groups)):
        raise ModelError(
            describe(
                f"{path}: observed_groups",
                f"groups of {library.n_observed} DOFs, one onset setting each",
                f"{library.observed_groups} and {len(library.onset)} settings",
                RETRAIN,
            )
        )
