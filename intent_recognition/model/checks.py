# SPDX-License-Identifier: Apache-2.0
"""Checks of the arrays and the header of a model file."""

from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import DofSpec
from intent_recognition.errors import ArgumentError, ModelError, number
from intent_recognition.model.arrays import (
    LARGEST,
    RETRAIN,
    check_arrays,
    check_covariances,
    check_positive,
    require,
)
from intent_recognition.promp import (
    CONTEXT_STRENGTH,
    LEADS,
    NONE,
    ContextModel,
    LeftOutOdds,
    PhaseDeviation,
    PoseRegression,
    ResidualCoupling,
    TaskLibrary,
)

DEVIATION_STD = "phase_deviation_std"
OF_DEVIATION = ("correlation", "evidence", "controlled_follows", "duration_exponent")
"""Fields of the phase deviation that are stored in the header."""
MAX_EXPONENT = 10.0
"""Largest magnitude of a duration's exponent; with exponent 1 movements start at the same speed
whatever their duration."""
PLAUSIBLE = {
    "log_duration_mean": 20.0,
    "none_log_duration": 20.0,
    "log_duration_std": 10.0,
    "usual_log_duration": 20.0,
    "displacement_exponent": MAX_EXPONENT,
    "delay_s": 1e6,
}
"""Largest magnitude of logarithmic durations [log s], their standard deviations, exponents and the
delay; they span milliseconds to days, and exclude wrong units."""
SCALARS = (
    "noise_scale",
    "correlation_time_s",
    "none_prior",
    "none_margin",
    "switch_margin",
    "duration_evidence",
    "task_evidence",
    "regression_variance",
    "displacement_exponent",
    "delay_s",
)


def _prefixed(prefix: str, kind: type[NamedTuple], *axes: str) -> dict[str, str]:
    """Axes of the arrays of a type, by their names in the file."""
    return {f"{prefix}_{name}": one for name, one in zip(kind._fields, axes, strict=True)}


SHAPES = {
    "weight_mean": "kw",
    "weight_covariance": "kww",
    "noise_variance": "d",
    "log_duration_mean": "k",
    "log_duration_std": "k",
    "task_prior": "k",
    "transition_prior": "lk",
    "none_mean": "o",
    "none_covariance": "oo",
    "none_log_duration": "2",
    "n_demonstrations": "k",
    "observed_groups": "g",
    "observed_weight_covariance": "koo",
    **dict.fromkeys(SCALARS, ""),
}
"""Axes of each array of a model: k tasks, l one more; d DOFs, of which the p observed ones form g
groups, and q are controlled; w weights, of which o are observed; m numbers of the context."""
USUAL, STOP, POSE, COUPLING, CONTEXT = (
    {"usual_log_duration": "l"},
    {"stop_margin": ""},
    _prefixed("pose", PoseRegression, "ks", "ks", "kns", "k", "kntq", "kt"),
    _prefixed("coupling", ResidualCoupling, "kqp", "kq", "k"),
    {"context_mean": "km", "context_covariance": "kmm", "context_gain": "kwm"},
)
"""Axes of the arrays of usual durations, the margin after a stop, couplings and context, which not
every library has; n moments, t leads, s numbers of the present state."""


def shapes_of(
    content: Mapping[str, NDArray[Any]], n_tasks: int, dofs: DofSpec, n_basis: int
) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays of a model; of what not every library has, if `content` names it."""
    observed, controlled = len(dofs.observed_names), len(dofs.controlled_names)
    size = {"k": n_tasks, "l": n_tasks + 1, "p": observed, "q": controlled, "2": 2}
    size |= {"d": observed + controlled, "g": len(dofs.observed), "m": len(dofs.context_names)}
    size |= {"w": (observed + controlled) * n_basis, "o": observed * n_basis}
    wanted = SHAPES | (CONTEXT if dofs.context else {})
    moments = content["pose_states"].shape[1:2] if "pose_states" in content else ()
    size |= {"t": len(LEADS), "s": 2 * observed + controlled, "n": sum(moments)}
    for some in (USUAL, STOP, POSE, COUPLING):
        wanted |= some if some.keys() & content else {}
    return {name: tuple(size[axis] for axis in axes) for name, axes in wanted.items()}


def check_values(path: str | Path, numbers: dict[str, NDArray[Any]]) -> None:
    """Require valid variances, covariances, probabilities and durations."""
    scales = "noise_variance", "noise_scale", "correlation_time_s", "log_duration_std"
    check_positive(path, numbers, *scales, "task_evidence")
    for name in ("task_prior", "transition_prior"):
        prior = numbers[name]
        shares = np.all(prior >= 0.0) and np.all(np.abs(prior.sum(axis=-1) - 1.0) <= 1e-6)
        require(bool(shares), f"{path}: {name}", "sums of one", prior)
    variance = numbers["regression_variance"]
    require(bool(variance >= 0.0), f"{path}: regression_variance", "at least 0", variance)
    none_prior = numbers["none_prior"]
    require(bool(0.0 < none_prior < 1.0), f"{path}: none_prior", "between 0 and 1", none_prior)

    for name, largest in PLAUSIBLE.items():
        within = name not in numbers or bool(np.all(np.abs(numbers[name]) <= largest))
        require(within, f"{path}: {name}", f"at most {largest:g}", numbers.get(name))
    for name in (one for one in numbers if one.endswith("covariance")):
        check_covariances(path, name, numbers[name])
    if "context_covariance" in numbers:
        least = np.linalg.eigvalsh(numbers["context_covariance"])
        check_positive(path, {"context_covariance": least}, "context_covariance")
    if "coupling_explained" in numbers:
        check_positive(path, numbers, "coupling_decay_s")
        explained = numbers["coupling_explained"]
        share = bool(np.all((explained >= 0.0) & (explained < 1.0)))
        require(share, f"{path}: coupling_explained", "at least 0 and below 1", explained)
    if "pose_share" in numbers:
        check_positive(path, numbers, "pose_scale", "pose_length")
        share = bool(np.all(np.abs(numbers["pose_share"] - 0.5) <= 0.5))
        require(share, f"{path}: pose_share", "between 0 and 1", numbers["pose_share"])


def check_groups(path: str | Path, groups: NDArray[Any], n_observed: int, n_onset: int) -> None:
    """Require that the groups partition the observed DOFs, with one onset setting each."""
    divided = (groups.sum(), n_onset) == (n_observed, len(groups)) and np.all(groups >= 1)
    expected = f"groups of {n_observed} DOFs, one onset setting each"
    got = f"{groups.tolist()} and {n_onset} settings"
    require(bool(divided), f"{path}: observed_groups", expected, got)


def labels_of(labels: list) -> tuple[str, ...]:
    """Labels of the tasks, checked."""
    named = isinstance(labels, list) and all(isinstance(label, str) for label in labels)
    if not named or len({*labels, NONE}) != len(labels) + 1 or not labels:
        raise ArgumentError.about("labels", f"different names other than {NONE!r}", labels, RETRAIN)
    return tuple(labels)


def evidence_freedom(path: str | Path, header: dict) -> float:
    """Degrees of freedom of the evidence; null stands for a normal density."""
    found = header.get("evidence_freedom")
    if found is None:
        return inf
    expected = f"above zero and up to {LARGEST:g}, or null"
    require(0.0 < number(found) <= LARGEST, f"{path}: evidence_freedom", expected, found)
    return float(found)


def left_out_odds(path: str | Path, header: dict) -> LeftOutOdds:
    """Log odds of left-out demonstrations, from which the risk of acting is estimated, checked."""
    try:
        entry = header["left_out_odds"]
        odds, groups = tuple(map(float, entry["odds"])), tuple(map(str, entry["groups"]))
        if len(odds) != len(groups) or len(odds) == 1 or not np.all(np.isfinite(odds)):
            raise ValueError(f"{len(odds)} odds of {len(groups)} demonstrations")
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        expected = "finite odds, one for each of two demonstrations or more"
        raise ModelError.about(f"{path}: left_out_odds", expected, error, RETRAIN) from error
    return LeftOutOdds(odds, groups)


def phase_deviation(
    path: str | Path, header: dict, content: dict[str, NDArray[Any]]
) -> PhaseDeviation:
    """Prior of the phase deviation, checked."""
    n_phases = max(np.size(content.get(DEVIATION_STD, ())), 2)
    check_arrays(path, content, {DEVIATION_STD: (n_phases,)})
    try:
        entry = header["phase_deviation"]
        correlation, evidence = float(entry["correlation"]), float(entry["evidence"])
        follows, exponent = entry["controlled_follows"], float(entry["duration_exponent"])
        if not isinstance(follows, bool):
            raise TypeError(f"controlled_follows {follows!r}")
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        expected = "a complete header"
        raise ModelError.about(f"{path}: phase_deviation", expected, error, RETRAIN) from error
    std = content[DEVIATION_STD]
    sound = 0.0 < correlation < np.inf and 0.0 < evidence <= 1.0 and abs(exponent) <= MAX_EXPONENT
    expected = "correlation > 0, evidence in (0, 1], exponent within +-10, no std below zero"
    got = f"{correlation}, {evidence}, {exponent} and {std.min()}"
    require(sound and bool(np.all(std >= 0.0)), f"{path}: phase_deviation", expected, got)
    return PhaseDeviation(std, correlation, evidence, follows, exponent)


def optional_arrays(library: TaskLibrary) -> dict[str, Floats]:
    """Arrays that not every library has, as far as this one has them."""
    context = library.context
    arrays = dict(zip(COUPLING, library.coupling or ()))
    arrays |= zip(POSE, library.pose_regression or ())
    if context is not None:
        arrays |= zip(CONTEXT, (context.mean, context.covariance, context.gain))
    own = {name: getattr(library, name) for name in (*USUAL, *STOP)}
    return arrays | {n: np.asarray(one) for n, one in own.items() if one is not None}


def context_of(dofs: DofSpec, numbers: dict[str, NDArray[Any]]) -> ContextModel | None:
    """Dependence of the weights on the context, taken out of checked arrays; None without one."""
    if not dofs.context:
        return None
    mean, covariance, gain = (numbers.pop(name) for name in CONTEXT)
    return ContextModel(
        dofs.context_names,
        tuple(entry.unit for entry in dofs.context for _ in entry.names),
        mean,
        covariance,
        gain,
        numbers["n_demonstrations"] - 1 + CONTEXT_STRENGTH,
        tuple(len(entry.names) for entry in dofs.context),
    )


def couplings_of(numbers: dict[str, NDArray[Any]]) -> dict[str, Any]:
    """`coupling` and `pose_regression`, taken out of checked arrays; None without one."""
    parts = ("coupling", ResidualCoupling, COUPLING), ("pose_regression", PoseRegression, POSE)
    return {
        name: kind(*map(numbers.pop, names)) if names.keys() & numbers.keys() else None
        for name, kind, names in parts
    }
