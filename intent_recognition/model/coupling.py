# SPDX-License-Identifier: Apache-2.0
"""The coupling of residuals in a model file: arrays that only models with one have."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ModelError
from intent_recognition.model.arrays import RETRAIN, check_arrays, check_positive
from intent_recognition.promp import ResidualCoupling

COUPLING = tuple(f"coupling_{name}" for name in ResidualCoupling._fields)
"""Names of the arrays."""


def coupling_arrays(coupling: ResidualCoupling | None) -> dict[str, NDArray[np.float64]]:
    """What is written; nothing without a coupling."""
    return {} if coupling is None else dict(zip(COUPLING, coupling, strict=True))


def read_coupling(
    path: str | Path,
    content: Mapping[str, NDArray[Any]],
    n_tasks: int,
    n_controlled: int,
    n_observed: int,
) -> ResidualCoupling | None:
    """The coupling, checked; None without one.

    Raises:
        ModelError: an array is missing, of another shape, not finite or out of range.
    """
    if not any(name in content for name in COUPLING):
        return None
    shapes = [part.shape for part in ResidualCoupling.none(n_tasks, n_controlled, n_observed)]
    check_arrays(path, content, dict(zip(COUPLING, shapes, strict=True)))
    found = ResidualCoupling(*(content[name] for name in COUPLING))
    check_positive(path, content, COUPLING[2])
    if np.any(found.explained < 0.0) or np.any(found.explained >= 1.0):
        raise ModelError.about(
            f"{path}: {COUPLING[1]}", "at least 0 and below 1", found.explained, RETRAIN
        )
    return found
