# SPDX-License-Identifier: Apache-2.0
"""Statistics of the demonstrations inside a model file, so that a later session can add to it.

Beside the library's arrays stand those of `TaskStatistics`, one row per task, with of each scatter
the upper triangle; and those of the examples kept whole, task after task. Names, reference and
hyperparameters are in the header under `statistics`. Readers that do not know of them pass by.
"""

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import NamedTuple

import numpy as np

from intent_recognition.alignment.onset import OnsetSettings
from intent_recognition.errors import ArgumentError, ModelError, describe
from intent_recognition.promp.examples import Example, sample_phases, scored_phases
from intent_recognition.promp.gathering import Reference, SignalNames
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.selection import Candidate
from intent_recognition.promp.statistics import TaskStatistics
from intent_recognition.promp.training import Trained
from intent_recognition.promp.training_settings import TrainingSettings

SUMS = tuple(field.name for field in fields(TaskStatistics) if field.name != "examples")
PARTS = tuple(name for name in Example._fields if name not in ("name", "task"))
COUNT = "examples_count"
ARRAYS = (*(f"statistics_{name}" for name in SUMS), *(f"examples_{name}" for name in PARTS), COUNT)
"""Names of the arrays in the file."""
RETRAIN = "Train it again with `intent train`."


class Packed(NamedTuple):
    """What goes into the file: an entry of the JSON header, and arrays by name."""

    header: dict[str, object]
    arrays: dict[str, np.ndarray]


def pack_statistics(trained: Trained) -> Packed:
    """Statistics, reference and hyperparameters as they are written."""
    tasks = list(trained.tasks.values())
    arrays = {f"statistics_{name}": np.array([getattr(t, name) for t in tasks]) for name in SUMS}
    rows, columns = np.triu_indices(tasks[0].mean.size)
    arrays["statistics_scatter"] = arrays["statistics_scatter"][:, rows, columns]
    examples = [example for task in tasks for example in task.examples]
    for name in PARTS:
        arrays[f"examples_{name}"] = np.array([getattr(example, name) for example in examples])
    arrays[COUNT] = np.array([len(task.examples) for task in tasks])
    header = {
        "reference": asdict(trained.reference),
        "chosen": trained.chosen._asdict(),
        "labels": list(trained.tasks),
        "examples": [example.name for example in examples],
    }
    return Packed(header, arrays)


def unpack_statistics(
    path: str, library: TaskLibrary, header: Mapping, arrays: Mapping[str, np.ndarray]
) -> Trained:
    """The same read back and checked against the library they belong to.

    Args:
        path: of the file, for messages.
        library: the model's.
        header: what stands under `statistics`.
        arrays: those of `ARRAYS` that the file holds.

    Raises:
        ModelError: something is missing, of another shape, not finite, or of other tasks.
    """
    try:
        reference = _reference(header["reference"])
        chosen = Candidate(**header["chosen"])
        labels, names = tuple(header["labels"]), tuple(header["examples"])
    except (KeyError, TypeError, AttributeError, ArgumentError) as error:
        raise ModelError(
            describe(f"{path}: statistics", "a complete header", error, RETRAIN)
        ) from error
    if labels != library.labels:
        raise ModelError(
            describe(f"{path}: statistics", f"the tasks {library.labels}", labels, RETRAIN)
        )
    _check(path, arrays, _shapes(library, len(names)))
    if arrays[COUNT].sum() != len(names) or np.any(arrays["statistics_n"] < arrays[COUNT]):
        raise ModelError(
            describe(f"{path}: {COUNT}", f"{len(names)} in all", arrays[COUNT], RETRAIN)
        )
    edges = np.r_[0, np.cumsum(arrays[COUNT])]
    tasks = {}
    for row, label in enumerate(labels):
        parts = {name: arrays[f"examples_{name}"] for name in PARTS}
        examples = tuple(
            _example(names[k], label, {name: part[k] for name, part in parts.items()})
            for k in range(edges[row], edges[row + 1])
        )
        tasks[label] = _task({n: arrays[f"statistics_{n}"][row] for n in SUMS}, examples)
    return Trained(library, reference, tasks, chosen)


def _task(sums: dict[str, np.ndarray], examples: tuple[Example, ...]) -> TaskStatistics:
    size = sums["mean"].size
    scatter = np.zeros((size, size))
    scatter[np.triu_indices(size)] = sums["scatter"]
    sums["scatter"] = np.triu(scatter) + np.triu(scatter, 1).T
    plain = {name: v.item() if np.ndim(v) == 0 else v for name, v in sums.items()}
    return TaskStatistics(**plain, examples=examples)


def _example(name: str, task: str, parts: dict[str, np.ndarray]) -> Example:
    plain = {key: v.item() if np.ndim(v) == 0 else v for key, v in parts.items()}
    return Example(name=name, task=task, **plain)


def _reference(content: Mapping) -> Reference:
    def signals(entries: list) -> tuple[SignalNames, ...]:
        return tuple(SignalNames(tuple(names), unit) for names, unit in entries)

    return Reference(
        settings=TrainingSettings(**content["settings"]),
        observed=signals(content["observed"]),
        controlled=signals(content["controlled"]),
        onset=tuple(OnsetSettings(**entry) for entry in content["onset"]),
        controlled_onset=tuple(OnsetSettings(**entry) for entry in content["controlled_onset"]),
        source=content["source"],
    )


def _shapes(library: TaskLibrary, n_examples: int) -> dict[str, tuple[int, ...]]:
    n_basis, n_tasks = library.basis.n_basis, library.n_tasks
    n_dofs = library.n_observed + library.n_controlled
    size = n_dofs * n_basis
    shapes = {
        "statistics_mean": (n_tasks, n_dofs, n_basis),
        "statistics_scatter": (n_tasks, size * (size + 1) // 2),
        "examples_weights": (n_examples, n_dofs, n_basis),
        "examples_observed": (n_examples, len(sample_phases()), library.n_observed),
        "examples_controlled": (n_examples, len(scored_phases()), library.n_controlled),
        "examples_residual_variance": (n_examples, n_dofs),
        "examples_duration_s": (n_examples,),
    }
    for name in ("lowest", "highest", "residual_sum"):
        shapes[f"statistics_{name}"] = (n_tasks, n_dofs)
    for name in ("n", "log_duration_mean", "log_duration_scatter", "duration_sum_s"):
        shapes[f"statistics_{name}"] = (n_tasks,)
    return shapes | {COUNT: (n_tasks,)}


def _check(
    path: str, arrays: Mapping[str, np.ndarray], shapes: Mapping[str, tuple[int, ...]]
) -> None:
    for name, shape in shapes.items():
        place = f"{path}: {name}"
        if name not in arrays:
            raise ModelError(describe(place, "an array", "none", RETRAIN))
        array = arrays[name]
        kinds = "iu" if name in (COUNT, "statistics_n") else "iuf"
        if array.dtype.kind not in kinds or array.shape != shape:
            got = f"{array.dtype} of shape {array.shape}"
            raise ModelError(describe(place, f"numbers of shape {shape}", got, RETRAIN))
        if not np.all(np.isfinite(array)):
            raise ModelError(describe(place, "finite numbers", "NaN or inf", RETRAIN))
