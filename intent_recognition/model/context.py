# SPDX-License-Identifier: Apache-2.0
"""The context in a model file: arrays that only models with context entries have."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.demonstrations import DofSpec
from intent_recognition.model.arrays import check_arrays, check_covariances, check_positive
from intent_recognition.promp import CONTEXT_STRENGTH, ContextModel

CONTEXT = ("context_mean", "context_covariance", "context_gain")
"""Names of the arrays."""


def context_arrays(context: ContextModel | None) -> dict[str, NDArray[np.float64]]:
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
    """How the weights depend on the context, checked; None without one.

    Raises:
        ModelError: an array is missing, of another shape, not finite or no covariance.
    """
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
