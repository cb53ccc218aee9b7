# SPDX-License-Identifier: Apache-2.0
"""What only some model files have: context, and the coupling of residuals."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import DofSpec
from intent_recognition.model.arrays import check_arrays, check_covariances, check_positive, require
from intent_recognition.promp import CONTEXT_STRENGTH, ContextModel, ResidualCoupling

CONTEXT = ("context_mean", "context_covariance", "context_gain")
"""Names of the arrays."""


COUPLING = tuple(f"coupling_{name}" for name in ResidualCoupling._fields)
"""Likewise."""


def context_arrays(context: ContextModel | None) -> dict[str, Floats]:
    """What is written; nothing without a context."""
    if context is None:
        return {}
    return dict(zip(CONTEXT, (context.mean, context.covariance, context.gain), strict=True))


def read_context(
    path: str | Path,
    content: Mapping[str, NDArray[Any]],
    dofs: DofSpec,
    numbers: Mapping[str, NDArray[Any]],
) -> ContextModel | None:
    """How the weights depend on the context, checked; None without one."""
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


def coupling_arrays(coupling: ResidualCoupling | None) -> dict[str, Floats]:
    """What is written; nothing without a coupling."""
    return {} if coupling is None else dict(zip(COUPLING, coupling, strict=True))


def read_coupling(
    path: str | Path,
    content: Mapping[str, NDArray[Any]],
    n_tasks: int,
    n_controlled: int,
    n_observed: int,
) -> ResidualCoupling | None:
    """The coupling, checked; None without one."""
    if not any(name in content for name in COUPLING):
        return None
    shapes = [part.shape for part in ResidualCoupling.none(n_tasks, n_controlled, n_observed)]
    check_arrays(path, content, dict(zip(COUPLING, shapes, strict=True)))
    found = ResidualCoupling(*(content[name] for name in COUPLING))
    check_positive(path, content, COUPLING[2])
    share = bool(np.all((found.explained >= 0.0) & (found.explained < 1.0)))
    require(share, f"{path}: {COUPLING[1]}", "at least 0 and below 1", found.explained)
    return found
