# SPDX-License-Identifier: Apache-2.0
"""Checks of the arrays and the header of a model file."""

from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import Any

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
    NONE,
    ContextModel,
    LeftOutOdds,
    PhaseDeviation,
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
"""Axes of each array of a model: k tasks, l one more; d DOFs, of which the observed ones form g
groups; w weights, of which o are observed."""


def shapes_of(n_tasks: int, dofs: DofSpec, n_basis: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays of a model with `n_tasks` tasks."""
    observed = len(dofs.observed_names)
    n_dofs = observed + len(dofs.controlled_names)
    size = {"k": n_tasks, "l": n_tasks + 1, "d": n_dofs, "g": len(dofs.observed), "2": 2}
    size |= {"w": n_dofs * n_basis, "o": observed * n_basis}
    return {name: tuple(size[axis] for axis in axes) for name, axes in SHAPES.items()}


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
        within = bool(np.all(np.abs(numbers[name]) <= largest))
        require(within, f"{path}: {name}", f"at most {largest:g}", numbers[name])
    for name in ("weight_covariance", "none_covariance", "observed_weight_covariance"):
        check_covariances(path, name, numbers[name])


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


USUAL = "usual_log_duration"
CONTEXT = ("context_mean", "context_covariance", "context_gain")
COUPLING = tuple(f"coupling_{name}" for name in ResidualCoupling._fields)
"""Names of the arrays of the residual coupling, which not every library has."""


def optional_arrays(library: TaskLibrary) -> dict[str, Floats]:
    """Arrays of a library's context, coupling and usual durations, as far as it has them."""
    context, coupling, usual = library.context, library.coupling, library.usual_log_duration
    arrays = () if context is None else (context.mean, context.covariance, context.gain)
    durations = {} if usual is None else {USUAL: usual}
    return {**dict(zip(CONTEXT, arrays)), **dict(zip(COUPLING, coupling or ())), **durations}


def read_usual(
    path: str | Path, content: Mapping[str, NDArray[Any]], n_tasks: int
) -> Floats | None:
    """Usual log durations, checked; None: the means of the timing priors."""
    if USUAL not in content:
        return None
    check_arrays(path, content, {USUAL: (n_tasks + 1,)})
    found, largest = content[USUAL], PLAUSIBLE["log_duration_mean"]
    within = bool(np.all(np.abs(found) <= largest))
    require(within, f"{path}: {USUAL}", f"at most {largest:g}", found)
    return found


def read_context(
    path: str | Path,
    content: Mapping[str, NDArray[Any]],
    dofs: DofSpec,
    numbers: Mapping[str, NDArray[Any]],
) -> ContextModel | None:
    """Dependence of the weights on the context, checked; None without a context."""
    if not dofs.context:
        return None
    (n_tasks, n_weights), n = numbers["weight_mean"].shape, len(dofs.context_names)
    shapes = ((n_tasks, n), (n_tasks, n, n), (n_tasks, n_weights, n))
    check_arrays(path, content, dict(zip(CONTEXT, shapes, strict=True)))
    mean, covariance, gain = (content[name] for name in CONTEXT)
    check_covariances(path, CONTEXT[1], covariance)
    check_positive(path, {CONTEXT[1]: np.linalg.eigvalsh(covariance)}, CONTEXT[1])
    return ContextModel(
        dofs.context_names,
        tuple(entry.unit for entry in dofs.context for _ in entry.names),
        mean,
        covariance,
        gain,
        numbers["n_demonstrations"] - 1 + CONTEXT_STRENGTH,
        tuple(len(entry.names) for entry in dofs.context),
    )


def read_coupling(
    path: str | Path,
    content: Mapping[str, NDArray[Any]],
    n_tasks: int,
    n_controlled: int,
    n_observed: int,
) -> ResidualCoupling | None:
    """Residual coupling, checked; None without one."""
    if not any(name in content for name in COUPLING):
        return None
    shapes = [part.shape for part in ResidualCoupling.none(n_tasks, n_controlled, n_observed)]
    check_arrays(path, content, dict(zip(COUPLING, shapes, strict=True)))
    found = ResidualCoupling(*(content[name] for name in COUPLING))
    check_positive(path, content, COUPLING[2])
    share = bool(np.all((found.explained >= 0.0) & (found.explained < 1.0)))
    require(share, f"{path}: {COUPLING[1]}", "at least 0 and below 1", found.explained)
    return found
