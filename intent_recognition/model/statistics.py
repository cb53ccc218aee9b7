# SPDX-License-Identifier: Apache-2.0
"""Statistics of the demonstrations in a model file, to which later sessions can add.

The file holds the arrays of `TaskStatistics` with one row per task, scatter matrices as upper
triangles; the arrays of the examples that are kept whole, task by task; both again for the aligned
examples; and the templates of the alignment. Names, preprocessing and hyperparameters are stored in
the header under `statistics`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.alignment import Template
from intent_recognition.errors import ArgumentError, ModelError
from intent_recognition.learning import (
    PACES,
    Hyperparameters,
    Preprocessing,
    SignalNames,
    TaskStatistics,
    Timing,
    Trained,
    TrainingExample,
    TrainingSettings,
    pose_phases,
    sample_phases,
)
from intent_recognition.model.arrays import (
    RETRAIN,
    check_arrays,
    check_positive,
    from_upper,
    require,
    upper,
)
from intent_recognition.model.checks import MAX_EXPONENT
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import OnsetSettings

SUMS = tuple(f.name for f in fields(TaskStatistics) if f.name not in ("examples", "aligned"))
PARTS = tuple(
    name for name in TrainingExample._fields if name not in ("name", "task", "aligned", "group")
)
OF_CONTEXT = "context"
"""Part of the names of arrays that a file has only with a context."""
COUNT = "examples_count"
STEADY, ALIGNED = "", "aligned_"
"""Prefixes of the arrays of recorded and of aligned examples."""
EXPONENTS, DELAY = ("duration_exponent", "displacement_exponent"), "delay_s"
TIMING = ("timing_values", "timing_scale", "timing_deviation_std")
ARRAYS = (
    *(f"{kind}statistics_{name}" for kind in (STEADY, ALIGNED) for name in SUMS),
    *(f"{kind}examples_{name}" for kind in (STEADY, ALIGNED) for name in PARTS),
    *TIMING,
    COUNT,
)
"""Names of the arrays in the file."""


def pack_statistics(trained: Trained) -> tuple[dict[str, object], dict[str, NDArray[Any]]]:
    """Header entry and arrays with the statistics, preprocessing and hyperparameters."""
    preprocessing, tasks = trained.preprocessing, list(trained.tasks.values())
    templates = preprocessing.timing.templates.values()
    values, scales = [one.values for one in templates], [one.scale for one in templates]
    timing = np.array(values), np.array(scales), preprocessing.timing.deviation_std
    header: dict[str, object] = {
        "preprocessing": _plain(preprocessing),
        "chosen": trained.chosen._asdict(),
        "labels": list(trained.tasks),
        "examples": [example.name for task in tasks for example in task.examples],
        "groups": [example.group for task in tasks for example in task.examples],
    }
    arrays = {
        **_pack_tasks(tasks, STEADY),
        **_pack_tasks([task.aligned for task in tasks if task.aligned is not None], ALIGNED),
        **dict(zip(TIMING, timing, strict=True)),
        COUNT: np.array([len(task.examples) for task in tasks]),
    }
    if not trained.library.context_names:
        arrays = {name: array for name, array in arrays.items() if OF_CONTEXT not in name}
    return header, arrays


def unpack_statistics(
    path: str, library: TaskLibrary, header: Mapping, arrays: Mapping[str, NDArray[Any]]
) -> Trained:
    """Statistics from a model file, checked against its library."""
    try:
        n_dofs = library.n_observed + library.n_controlled
        timing = _timing(path, header["preprocessing"], arrays, n_dofs)
        preprocessing = _preprocessing(header["preprocessing"], timing)
        chosen = _hyperparameters(header["chosen"])
        labels, names = tuple(header["labels"]), tuple(header["examples"])
        groups = tuple(header["groups"])
    except (KeyError, TypeError, AttributeError, ArgumentError) as error:
        expected = "a complete header"
        raise ModelError.about(f"{path}: statistics", expected, error, RETRAIN) from error
    place, same = f"{path}: statistics", preprocessing.basis_of(chosen.aligned) == library.basis
    require(same, place, f"hyperparameters of {library.basis}", chosen)
    require(labels == library.labels, place, f"the tasks {library.labels}", labels)
    check_arrays(path, arrays, {COUNT: (len(labels),)}, (COUNT,))
    for kind in (STEADY, ALIGNED):
        n_basis = preprocessing.basis_of(kind == ALIGNED).n_basis
        shapes = _shapes(library, len(names), n_basis, kind)
        if not library.context_names:
            of_context = {name for name in shapes if OF_CONTEXT in name}
            arrays = {**arrays, **{name: np.empty(shapes[name]) for name in of_context}}
        check_arrays(path, arrays, shapes, (f"{kind}statistics_n",))
        counts, all_of = arrays[COUNT], arrays[f"{kind}statistics_n"]
        sound = np.all((counts >= 0) & (counts <= all_of)) and counts.sum() == len(names)
        require(bool(sound), f"{path}: {COUNT}", f"{len(names)} in all", counts)
    grouped = len(groups) == len(names) and all(isinstance(group, str) for group in groups)
    require(grouped, place, f"{len(names)} groups of demonstrations", groups)
    named = list(zip(names, groups, strict=True))
    aligned = _unpack_tasks(labels, named, arrays, ALIGNED)
    tasks = _unpack_tasks(labels, named, arrays, STEADY, aligned)
    return Trained(library, preprocessing, tasks, chosen)


def _hyperparameters(chosen: Mapping) -> Hyperparameters:
    """Hyperparameters from the header, checked."""
    if set(chosen) != set(Hyperparameters._fields):
        raise KeyError(f"chosen of {', '.join(Hyperparameters._fields)}")
    pace, numbers = chosen["pace"], [chosen[name] for name in Hyperparameters._fields[1:]]
    if pace not in PACES or not all(isinstance(n, (int, float)) for n in numbers):
        raise TypeError(f"chosen {chosen}")
    return Hyperparameters(pace, *(float(number) for number in numbers))


def _pack_tasks(tasks: Sequence[TaskStatistics], kind: str) -> dict[str, NDArray[Any]]:
    """Arrays of the statistics and of the examples kept whole, task by task."""
    sums = {name: np.array([getattr(task, name) for task in tasks]) for name in SUMS}
    sums["scatter"] = upper(sums["scatter"])
    examples = [example for task in tasks for example in task.examples]
    parts = {name: np.array([getattr(example, name) for example in examples]) for name in PARTS}
    return {f"{kind}statistics_{name}": array for name, array in sums.items()} | {
        f"{kind}examples_{name}": array for name, array in parts.items()
    }


def _unpack_tasks(
    labels: Sequence[str],
    named: Sequence[tuple[str, str]],
    arrays: Mapping[str, NDArray[Any]],
    kind: str,
    aligned: Mapping[str, TaskStatistics] | None = None,
) -> dict[str, TaskStatistics]:
    """Statistics of each label; `named` are names and groups of the examples."""
    edges = np.r_[0, np.cumsum(arrays[COUNT])]
    tasks = {}
    for row, label in enumerate(labels):
        over_reference = None if aligned is None else aligned[label]
        examples = []
        for place, k in enumerate(range(edges[row], edges[row + 1])):
            parts = {part: _plain_value(arrays[f"{kind}examples_{part}"][k]) for part in PARTS}
            own = None if over_reference is None else over_reference.examples[place]
            name, group = named[k]
            examples.append(TrainingExample(name, label, **parts, aligned=own, group=group))
        sums = {name: _plain_value(arrays[f"{kind}statistics_{name}"][row]) for name in SUMS}
        sums["scatter"] = from_upper(sums["scatter"], sums["mean"].size)
        tasks[label] = TaskStatistics(**sums, examples=tuple(examples), aligned=over_reference)
    return tasks


def _plain_value(value: NDArray[Any]) -> Any:
    """A row of an array, or a number if the array has one dimension."""
    return value.item() if np.ndim(value) == 0 else value


def _timing(path: str, header: Mapping, arrays: Mapping[str, NDArray[Any]], n_dofs: int) -> Timing:
    labels: Sequence[str] = header["templates"]
    values, scale, deviation_std = (arrays.get(name, np.zeros(0)) for name in TIMING)
    n_phases, n_deviations = np.shape(values)[1:2], max(len(np.atleast_1d(deviation_std)), 2)
    shapes: tuple[tuple[int, ...], ...] = ((0,), (0,), (n_deviations,))
    if labels:  # else no task has two recordings
        values_shape = (len(labels), *(n_phases or (2,)), n_dofs)
        shapes = (values_shape, (len(labels), n_dofs), (n_deviations,))
    bounded = {name: arrays[name] for name in TIMING if name in arrays}
    if "timing_scale" in bounded and scale.dtype.kind == "f":  # infinite for DOFs that never move
        bounded["timing_scale"] = np.where(np.isposinf(scale), 1.0, scale)
    check_arrays(path, bounded, dict(zip(TIMING, shapes, strict=True)))
    check_positive(path, bounded, "timing_scale", "timing_deviation_std")
    templates = {label: Template(values[k], scale[k]) for k, label in enumerate(labels)}
    exponents = [header[name] for name in EXPONENTS]
    usual_s, delay_s = header["usual_s"], header[DELAY]
    sound = all(isinstance(one, (int, float)) for one in (*exponents, delay_s, *usual_s.values()))
    sound = sound and all(abs(one) <= MAX_EXPONENT for one in exponents)
    sound = sound and 0 <= delay_s < inf and all(0 < s < inf for s in usual_s.values())
    expected = f"exponents within +-{MAX_EXPONENT:g}, a delay of 0 or more, and durations above 0"
    require(sound, f"{path}: timing", expected, f"{exponents}, {delay_s}, {usual_s}")
    return Timing(templates, deviation_std, exponents[0], usual_s, exponents[1], delay_s)


def _plain(preprocessing: Preprocessing) -> dict[str, object]:
    """A preprocessing as plain values, without the arrays of its timing."""
    plain = {
        f.name: getattr(preprocessing, f.name) for f in fields(preprocessing) if f.name != "timing"
    }
    for name in ("onset", "controlled_onset"):
        plain[name] = [asdict(settings) for settings in plain[name]]
    plain["settings"] = asdict(preprocessing.settings)
    timing = preprocessing.timing
    plain |= {"templates": [*timing.templates], "usual_s": timing.usual_s}
    return plain | {name: getattr(timing, name) for name in (*EXPONENTS, DELAY)}


def _preprocessing(content: Mapping, timing: Timing) -> Preprocessing:
    def signals(entries: list) -> tuple[SignalNames, ...]:
        return tuple(SignalNames(tuple(names), unit) for names, unit in entries)

    return Preprocessing(
        settings=TrainingSettings(**content["settings"]),
        observed=signals(content["observed"]),
        controlled=signals(content["controlled"]),
        onset=tuple(OnsetSettings(**entry) for entry in content["onset"]),
        controlled_onset=tuple(OnsetSettings(**entry) for entry in content["controlled_onset"]),
        timing=timing,
        source=content["source"],
        context=signals(content["context"]),
        angles=tuple(content["angles"]),
    )


def _shapes(
    library: TaskLibrary, n_examples: int, n_basis: int, kind: str
) -> dict[str, tuple[int, ...]]:
    n_tasks, n_dofs = library.n_tasks, library.n_observed + library.n_controlled
    size, n_context = n_dofs * n_basis, len(library.context_names)
    shapes = {
        "statistics_context_mean": (n_tasks, n_context),
        "statistics_context_scatter": (n_tasks, n_context, n_context),
        "statistics_context_cross": (n_tasks, size, n_context),
        "examples_context": (n_examples, n_context),
        "statistics_mean": (n_tasks, n_dofs, n_basis),
        "statistics_scatter": (n_tasks, size * (size + 1) // 2),
        "examples_weights": (n_examples, n_dofs, n_basis),
        "examples_observed": (n_examples, len(sample_phases()), library.n_observed),
        "examples_controlled": (n_examples, len(pose_phases()), library.n_controlled),
        "examples_residual_variance": (n_examples, n_dofs),
        "examples_duration_s": (n_examples,),
    }
    for name in ("lowest", "highest", "residual_sum"):
        shapes[f"statistics_{name}"] = (n_tasks, n_dofs)
    for name in ("n", "log_duration_mean", "log_duration_scatter", "duration_sum_s"):
        shapes[f"statistics_{name}"] = (n_tasks,)
    return {f"{kind}{name}": shape for name, shape in shapes.items()}
