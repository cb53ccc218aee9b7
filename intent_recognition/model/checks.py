# SPDX-License-Identifier: Apache-2.0
"""What the arrays and the header of a model file must be like."""

from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.demonstrations import DofSpec
from intent_recognition.errors import ArgumentError, ModelError
from intent_recognition.model.arrays import (
    LARGEST,
    RETRAIN,
    check_arrays,
    check_covariances,
    check_positive,
    require,
)
from intent_recognition.promp import NONE, LeftOutOdds, PhaseDeviation

DEVIATION_STD = "phase_deviation_std"
MAX_EXPONENT = 10.0
"""Largest size of an exponent of the duration. Convention: with 1 a movement begins at one speed,
however long it takes."""
LONGEST_LOG_S = 20.0
"""Logarithm of a duration [log s]. Convention: neither nanoseconds nor years."""
LARGEST_LOG_STD = 10.0
"""Standard deviation of such a logarithm. Convention: from milliseconds to days."""
SCALARS = (
    "noise_scale",
    "correlation_time_s",
    "none_prior",
    "none_margin",
    "switch_margin",
    "duration_evidence",
    "task_evidence",
    "regression_variance",
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
"""Axes of each array of a model: k tasks, l one more; d DOFs, the observed ones in g groups; w
weights, o of them observed."""


def shapes_of(n_tasks: int, dofs: DofSpec, n_basis: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays of a model of so many tasks."""
    observed = len(dofs.observed_names)
    n_dofs = observed + len(dofs.controlled_names)
    size = {"k": n_tasks, "l": n_tasks + 1, "d": n_dofs, "g": len(dofs.observed), "2": 2}
    size |= {"w": n_dofs * n_basis, "o": observed * n_basis}
    return {name: tuple(size[axis] for axis in axes) for name, axes in SHAPES.items()}


def check_values(path: str | Path, numbers: dict[str, NDArray[Any]]) -> None:
    """Make sure that variances are positive and probabilities are some."""
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


def check_plausible(path: str | Path, numbers: dict[str, NDArray[Any]]) -> None:
    """Durations that a movement can have, and covariances."""
    for name, largest in (
        ("log_duration_mean", LONGEST_LOG_S),
        ("none_log_duration", LONGEST_LOG_S),
        ("log_duration_std", LARGEST_LOG_STD),
    ):
        within = bool(np.all(np.abs(numbers[name]) <= largest))
        require(within, f"{path}: {name}", f"at most {largest:g}", numbers[name])
    for name in ("weight_covariance", "none_covariance", "observed_weight_covariance"):
        check_covariances(path, name, numbers[name])


def check_groups(path: str | Path, groups: NDArray[Any], n_observed: int, n_onset: int) -> None:
    """Make sure that signals divide the observed DOFs among them."""
    divided = (groups.sum(), n_onset) == (n_observed, len(groups)) and np.all(groups >= 1)
    expected = f"groups of {n_observed} DOFs, one onset setting each"
    got = f"{groups.tolist()} and {n_onset} settings"
    require(bool(divided), f"{path}: observed_groups", expected, got)


def labels_of(labels: list) -> tuple[str, ...]:
    """Names of the tasks, checked."""
    named = isinstance(labels, list) and all(isinstance(label, str) for label in labels)
    if not named or len({*labels, NONE}) != len(labels) + 1 or not labels:
        raise ArgumentError.about("labels", f"different names other than {NONE!r}", labels, RETRAIN)
    return tuple(labels)


def evidence_freedom(path: str | Path, header: dict) -> float:
    """Degrees of freedom of the evidence; null stands for the normal density."""
    found = header.get("evidence_freedom")
    if found is None:
        return inf
    number = isinstance(found, (int, float)) and not isinstance(found, bool)
    expected = f"above zero and up to {LARGEST:g}, or null"
    require(number and 0.0 < found <= LARGEST, f"{path}: evidence_freedom", expected, found)
    return float(found)


def left_out_odds(path: str | Path, header: dict) -> LeftOutOdds:
    """What is known of the risk of acting; nothing in models that were written without."""
    try:
        entry = header.get("left_out_odds", {"odds": [], "groups": []})
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
    """The prior of the phase deviation, checked."""
    n_phases = max(np.size(content.get(DEVIATION_STD, ())), 2)
    check_arrays(path, content, {DEVIATION_STD: (n_phases,)})
    try:
        entry = header["phase_deviation"]
        correlation, evidence = float(entry["correlation"]), float(entry["evidence"])
        follows, exponent = entry["controlled_follows"], entry.get("duration_exponent", 0.0)
        exponent = float(exponent)
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
