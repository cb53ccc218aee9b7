# SPDX-License-Identifier: Apache-2.0
"""Arrays of a model file: what each must be like, and symmetric matrices by half."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ModelError

LARGEST = 1e15
"""Largest magnitude of a number in a model [any unit]. Convention: squares and sums of them are
finite."""
ROUNDING = 1e-9
"""Share of the largest entry by which a covariance may miss. Convention: a million times the
rounding of doubles."""
RETRAIN = "Train it again with `intent train`."


def check_arrays(
    path: str | Path,
    arrays: Mapping[str, NDArray[Any]],
    shapes: Mapping[str, tuple[int, ...]],
    whole: Collection[str] = (),
    *,
    largest: float = LARGEST,
    cure: str = RETRAIN,
) -> None:
    """Make sure that arrays are there, real, of their shape and finite."""
    for name, shape in shapes.items():
        place = f"{path}: {name}"
        if name not in arrays:
            raise ModelError.about(place, "an array", "none", cure)
        array = arrays[name]
        if array.dtype.kind not in ("iu" if name in whole else "iuf"):
            kind = "whole numbers" if name in whole else "real numbers"
            raise ModelError.about(place, kind, f"type {array.dtype}", cure)
        if array.shape != shape:
            raise ModelError.about(place, f"shape {shape}", array.shape, cure)
        if not np.all(np.isfinite(array)):
            raise ModelError.about(place, "finite numbers", "NaN or inf", cure)
        if array.dtype.kind == "f" and np.any(np.abs(array) > largest):
            raise ModelError.about(place, f"numbers up to {largest:g}", np.abs(array).max(), cure)


def check_covariances(path: str | Path, name: str, matrices: NDArray[Any]) -> None:
    """Make sure that matrices (..., n, n) are symmetric and not negative, up to rounding."""
    place = f"{path}: {name}"
    scale = np.abs(matrices).max(initial=0.0)
    difference = np.abs(matrices - matrices.swapaxes(-1, -2)).max(initial=0.0)
    if difference > ROUNDING * scale:
        got = f"entries that differ from their mirror image by {difference:g}"
        raise ModelError.about(place, "symmetric matrices", got, RETRAIN)
    least = np.linalg.eigvalsh(matrices).min(initial=0.0)
    if least < -ROUNDING * scale:
        raise ModelError.about(place, "no negative variance", f"{least:g}", RETRAIN)


def check_positive(path: str | Path, arrays: Mapping[str, NDArray[Any]], *names: str) -> None:
    """Make sure that all numbers of some arrays are above zero."""
    for name in names:
        if not np.all(arrays[name] > 0.0):
            raise ModelError.about(f"{path}: {name}", "above zero", arrays[name], RETRAIN)


def upper(matrices: NDArray[Any]) -> NDArray[Any]:
    """Upper triangles of symmetric matrices (..., n, n), row after row, (..., n (n + 1) / 2)."""
    rows, columns = np.triu_indices(matrices.shape[-1])
    return matrices[..., rows, columns]


def from_upper(triangles: NDArray[Any], size: int) -> NDArray[Any]:
    """The symmetric matrices (..., size, size) of such triangles."""
    rows, columns = np.triu_indices(size)
    matrices = np.zeros((*triangles.shape[:-1], size, size))
    matrices[..., rows, columns] = matrices[..., columns, rows] = triangles
    return matrices
