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
    SCALARS,
    SHAPES,
    USUAL,
    check_groups,
    check_values,
    evidence_freedom,
    labels_of,
    left_out_odds,
    optional_arrays,
    phase_deviation,
    read_context,
    read_coupling,
    read_usual,
    shapes_of,
)
from intent_recognition.model.statistics import ARRAYS, pack_statistics, unpack_statistics
from intent_recognition.promp import NormalizedRBFBasis, TaskLibrary
from intent_recognition.signals import OnsetSettings
from intent_recognition.untrusted import UntrustedError, load_json, read_arrays

FORMAT_VERSION = 3
"""Of the file; others are not read."""
MODEL_FILE = "a model file written by `intent train`"


@dataclass(frozen=True)
class Model:
    """A library together with the DOF file it was trained with.

    Attributes:
        library: the learned tasks.
        dofs: where its DOFs come from.
    """

    library: TaskLibrary
    dofs: DofSpec

    def __repr__(self) -> str:
        """Tasks, and the topics of both agents."""
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
    """Write the model; the file appears whole or not at all.

    Args:
        path: the file, such as `tasks.npz`.
        model: what to write. A library alone, learned from arrays, is written with each of its
            signals as a named vector (JointState) on the topics `human`, `robot` and `context`.
        trained: statistics of its demonstrations; without them nothing can be added to it later.

    Raises:
        ArgumentError: it is neither a model nor a library.
        ModelError: the folder cannot be written to.
        DofError: an orientation has no reference, see `settle_orientations`; or two DOFs of a
            library alone have the same name.
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
        ArgumentError: the path is none.
        ModelError: no such file, not a model, unknown version, missing array, wrong shape, or a
            value that is not finite or makes no sense; names the file and the array.
    """
    path = as_path("path", path)
    content = _read(path)
    return _model(path, content, _header(path, content))


def _model(path: Path, content: dict[str, NDArray[Any]], header: dict) -> Model:
    """The model of what a file holds, which is checked."""
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
    check_arrays(path, content, shapes_of(len(labels), dofs, basis.n_basis), ("observed_groups",))
    numbers: dict[str, Any] = {name: content[name] for name in SHAPES}
    check_values(path, numbers)
    deviation = phase_deviation(path, header, content)
    n_dofs = len(dofs.controlled_names), len(dofs.observed_names)
    check_groups(path, numbers["observed_groups"], len(dofs.observed_names), len(onset))
    for name in SCALARS:
        numbers[name] = float(numbers[name])
    numbers["observed_groups"] = tuple(numbers["observed_groups"].tolist())
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
        context=read_context(path, content, dofs, numbers),
        coupling=read_coupling(path, content, len(labels), *n_dofs),
        usual_log_duration=read_usual(path, content, len(labels)),
        **numbers,
    )
    return Model(library, dofs)


def load_trained(path: str | Path) -> tuple[Model, Trained]:
    """Read a model with the statistics that it takes to add demonstrations to it.

    Raises:
        ModelError: as `load_model`, or the file holds no statistics.
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
    """Make sure that a DOF file is the one the model was trained with.

    Returns:
        The same DOFs with the references of the model's orientations, and its extrinsics, where
        they have none.

    Raises:
        DofError: they differ; both sides are named.
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
    """Entries with the references of others, where they are the same but for that."""
    pairs = zip_longest(entries, settled[: len(entries)])
    return tuple(
        other if other is not None and entry == replace(other, reference=()) else entry
        for entry, other in pairs
    )


def _read(path: Path, more: Sequence[str] = ()) -> dict[str, NDArray[Any]]:
    """Header, arrays of a model, and more arrays, as far as the file holds them."""
    wanted = ("header", *SHAPES, DEVIATION_STD, *CONTEXT, *COUPLING, USUAL, *more)
    try:
        return read_arrays(path, wanted)
    except FileNotFoundError as error:
        cure = "Check the path, or write one with `intent train`."
        raise ModelError.about(str(path), "a model file", "nothing there", cure) from error
    except (OSError, MemoryError, UntrustedError) as error:
        raise ModelError.about(str(path), MODEL_FILE, error, RETRAIN) from error


def _header(path: str | Path, content: dict[str, NDArray[Any]]) -> dict:
    if "header" not in content:  # such as a skill of pouring
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
