# SPDX-License-Identifier: Apache-2.0
"""The model file: one `.npz` without pickled objects, checked on reading."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import zip_longest
from math import isinf
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.demonstrations import DofEntry, DofSpec, reference_of
from intent_recognition.durable import write_arrays
from intent_recognition.errors import (
    DofError,
    IntentError,
    ModelError,
    as_path,
    check_type,
    first_of,
)
from intent_recognition.learning import Trained
from intent_recognition.model.array_dofs import dofs_of_arrays
from intent_recognition.model.arrays import RETRAIN, check_arrays
from intent_recognition.model.checks import (
    CONTEXT,
    COUPLING,
    DEVIATION_STD,
    OF_DEVIATION,
    POSE,
    SCALARS,
    SHAPES,
    STOP,
    USUAL,
    check_groups,
    check_values,
    context_of,
    couplings_of,
    evidence_freedom,
    labels_of,
    left_out_odds,
    optional_arrays,
    phase_deviation,
    shapes_of,
)
from intent_recognition.model.statistics import ARRAYS, pack_statistics, unpack_statistics
from intent_recognition.promp import NormalizedRBFBasis, TaskLibrary
from intent_recognition.signals import OnsetSettings
from intent_recognition.untrusted import UntrustedError, load_json, read_arrays

FORMAT_VERSION = 3
"""Version of the file format; other versions are rejected."""
MODEL_FILE = "a model file written by `intent train`"


@dataclass(frozen=True)
class Model:
    """A library together with the DOF file it was trained with.

    Attributes:
        library: learned tasks.
        dofs: source of each DOF.
    """

    library: TaskLibrary
    dofs: DofSpec

    def __repr__(self) -> str:
        """Tasks and the topics of both agents."""
        human, robot = (
            ", ".join(dict.fromkeys(entry.topic for entry in side)) or "nothing"
            for side in (self.dofs.observed, self.dofs.controlled)
        )
        return f"<Model of {first_of(self.labels)}: observes {human}, controls {robot}>"

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the tasks."""
        return self.library.labels

    @property
    def controlled_names(self) -> tuple[str, ...]:
        """Names of the controlled DOFs."""
        return self.library.controlled_names


def save_model(
    path: str | Path, model: Model | TaskLibrary, trained: Trained | None = None
) -> None:
    """Write a model file atomically.

    Args:
        path: path of the file, such as `tasks.npz`.
        model: model, or a library that was learned from arrays. Each signal of such a library is
            stored as a named vector (JointState) on the topics `human`, `robot` and `context`.
        trained: statistics of the demonstrations; later additions to the model need them.

    Raises:
        ArgumentError: `model` is neither a model nor a library.
        ModelError: the folder cannot be written to.
        DofError: an orientation has no reference, see `settle_orientations`; or two DOFs of a
            library from arrays have the same name.
    """
    if isinstance(model, TaskLibrary):
        model = Model(model, dofs_of_arrays(model))
    check_type("model", model, Model, "Pass a Model or a TaskLibrary, after the path.")
    library = model.library
    for entry in model.dofs.recorded:
        if entry.orientation:
            reference_of(entry)
    deviation = library.phase_deviation
    arrays = {
        "observed_weight_covariance": library.observed_covariance[:-1],
        DEVIATION_STD: deviation.deviation_std,
    }
    arrays |= {n: np.asarray(getattr(library, n)) for n in SHAPES if n not in arrays}
    arrays |= optional_arrays(library)
    header = {
        "format_version": FORMAT_VERSION,
        "labels": library.labels,
        "basis": asdict(library.basis),
        "onset": [asdict(settings) for settings in library.onset],
        "dofs": model.dofs.to_dict(),
        "phase_deviation": {key: getattr(deviation, key) for key in OF_DEVIATION},
        "evidence_freedom": None if isinf(library.evidence_freedom) else library.evidence_freedom,
        "left_out_odds": library.left_out_odds._asdict(),
        "provenance": dict(library.provenance),
    }
    if trained is not None:
        header["statistics"], statistics = pack_statistics(trained)
        arrays |= statistics
    try:
        write_arrays(as_path("path", path), {"header": np.array(json.dumps(header)), **arrays})
    except OSError as error:
        cure = "Choose another --output."
        raise ModelError.about(str(path), "a file that can be written", error, cure) from error


def load_model(path: str | Path) -> Model:
    """Read and check a model file.

    Raises:
        ArgumentError: `path` is not a path.
        ModelError: there is no such file, it is not a model, has an unknown version, or an array is
            missing, misshaped or has invalid values; names the file and the array.
    """
    path = as_path("path", path)
    content = _read(path)
    return _model(path, content, _header(path, content))


def _model(path: Path, content: dict[str, NDArray[Any]], header: dict) -> Model:
    """Build the model from a file's content, and check it."""
    try:
        dofs = DofSpec.from_dict(header["dofs"], f"{path}: dofs")
        labels = labels_of(header["labels"])
        basis = NormalizedRBFBasis(**header["basis"])
        onset = tuple(OnsetSettings(**settings) for settings in header["onset"])
        provenance = dict(header["provenance"])
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError, DofError) as error:
        if isinstance(error, IntentError):
            raise ModelError(f"{path}: {error}") from error
        raise ModelError.about(f"{path}: header", "a complete one", error, RETRAIN) from error
    shapes = shapes_of(content, len(labels), dofs, basis.n_basis)
    check_arrays(path, content, shapes, ("observed_groups",))
    numbers: dict[str, Any] = {name: content[name] for name in shapes}
    check_values(path, numbers)
    deviation = phase_deviation(path, header, content)
    check_groups(path, numbers["observed_groups"], len(dofs.observed_names), len(onset))
    for name in (*SCALARS, *(STOP.keys() & shapes.keys())):
        numbers[name] = float(numbers[name])
    numbers["observed_groups"] = tuple(numbers["observed_groups"].tolist())
    context, couplings = context_of(dofs, numbers), couplings_of(numbers)
    library = TaskLibrary(
        labels=labels,
        basis=basis,
        observed_names=dofs.observed_names,
        controlled_names=dofs.controlled_names,
        observed_units=tuple(entry.unit for entry in dofs.observed for _ in entry.names),
        controlled_units=tuple(entry.unit for entry in dofs.controlled for _ in entry.names),
        onset=onset,
        phase_deviation=deviation,
        evidence_freedom=evidence_freedom(path, header),
        left_out_odds=left_out_odds(path, header),
        provenance=provenance,
        context=context,
        **couplings,
        **numbers,
    )
    return Model(library, dofs)


def load_trained(path: str | Path) -> tuple[Model, Trained]:
    """Read a model and the statistics that are needed to add demonstrations to it.

    Raises:
        ModelError: as for `load_model`, or the file has no statistics.
    """
    path = as_path("path", path)
    content = _read(path, ARRAYS)
    header = _header(path, content)
    model = _model(path, content, header)
    if "statistics" not in header:
        expected = "statistics to add demonstrations to"
        raise ModelError.about(str(path), expected, "a model without them", RETRAIN)
    return model, unpack_statistics(str(path), model.library, header["statistics"], content)


def check_dofs(model: Model, dofs: DofSpec, source: str) -> DofSpec:
    """Require that a DOF file agrees with the one the model was trained with.

    Returns:
        The DOFs, in which missing references of orientations and missing extrinsics are taken
        from the model.

    Raises:
        DofError: they differ; names both sides.
    """
    found = replace(
        dofs,
        observed=_with_references(dofs.observed, model.dofs.observed),
        controlled=_with_references(dofs.controlled, model.dofs.controlled),
        context=_with_references(dofs.context, model.dofs.context),
        extrinsics=model.dofs.extrinsics if dofs.extrinsics is None else dofs.extrinsics,
    )
    ours, theirs = model.dofs.to_dict(), found.to_dict()
    for side in ("observed", "controlled"):
        if ours[side] != theirs[side]:
            expected = f"the DOFs of the model, {json.dumps(ours[side])}"
            cure = "Use the DOF file the model was trained with, or train again."
            raise DofError.about(f"{source}: {side}", expected, json.dumps(theirs[side]), cure)
    return found


def _with_references(
    entries: tuple[DofEntry, ...], settled: tuple[DofEntry, ...]
) -> tuple[DofEntry, ...]:
    """Entries with the references of `settled` if they agree in everything else."""
    pairs = zip_longest(entries, settled[: len(entries)])
    return tuple(
        other if other is not None and entry == replace(other, reference=()) else entry
        for entry, other in pairs
    )


def _read(path: Path, more: Sequence[str] = ()) -> dict[str, NDArray[Any]]:
    """Header, arrays of a model, and further arrays, as far as the file has them."""
    wanted = ("header", *SHAPES, DEVIATION_STD, *CONTEXT, *COUPLING, *USUAL, *STOP, *POSE, *more)
    try:
        return read_arrays(path, wanted)
    except FileNotFoundError as error:
        cure = "Check the path, or write one with `intent train`."
        raise ModelError.about(str(path), "a model file", "nothing there", cure) from error
    except (OSError, MemoryError, UntrustedError) as error:
        raise ModelError.about(str(path), MODEL_FILE, error, RETRAIN) from error


def _header(path: str | Path, content: dict[str, NDArray[Any]]) -> dict:
    if "header" not in content:  # such as a pouring skill
        raise ModelError.about(str(path), MODEL_FILE, "another file, without a header", RETRAIN)
    try:
        header = load_json(str(content["header"]))
        version = header["format_version"]
    except (KeyError, TypeError, ValueError) as error:
        expected = "JSON with a format_version"
        raise ModelError.about(f"{path}: header", expected, error, RETRAIN) from error
    if version != FORMAT_VERSION:
        cure = "Install the package version that wrote it, or train again."
        raise ModelError.about(f"{path}: format_version", str(FORMAT_VERSION), version, cure)
    return header
