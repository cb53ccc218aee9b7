# SPDX-License-Identifier: Apache-2.0
"""Checks of a model file's arrays, and storage of symmetric matrices by their upper half."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ModelError

LARGEST = 1e15
"""Largest magnitude of a number in a model [any unit]; sums of its squares are finite."""
ROUNDING = 1e-9
"""Tolerance of covariances as a share of the largest entry: far above the rounding of doubles."""
RETRAIN = "Train it again with `intent train`."


def require(sound: bool, place: str, expected: str, got: object, cure: str = RETRAIN) -> None:
    """Require that a part of a model file is sound; the error names its place."""
    if not sound:
        raise ModelError.about(place, expected, got, cure)


def check_arrays(
    path: str | Path,
    arrays: Mapping[str, NDArray[Any]],
    shapes: Mapping[str, tuple[int, ...]],
    whole: Collection[str] = (),
    *,
    largest: float = LARGEST,
    cure: str = RETRAIN,
) -> None:
    """Require that arrays are present, real, finite and of the right shape."""
    for name, shape in shapes.items():
        place = f"{path}: {name}"
        require(name in arrays, place, "an array", "none", cure)
        array = arrays[name]
        kinds, numbers = ("iu", "whole numbers") if name in whole else ("iuf", "real numbers")
        require(array.dtype.kind in kinds, place, numbers, f"type {array.dtype}", cure)
        require(array.shape == shape, place, f"shape {shape}", array.shape, cure)
        require(bool(np.all(np.isfinite(array))), place, "finite numbers", "NaN or inf", cure)
        if array.dtype.kind == "f":
            size = np.abs(array).max(initial=0.0)
            require(size <= largest, place, f"numbers up to {largest:g}", size, cure)


def check_covariances(path: str | Path, name: str, matrices: NDArray[Any]) -> None:
    """Require that matrices (..., n, n) are symmetric positive semidefinite up to rounding."""
    place = f"{path}: {name}"
    scale = np.abs(matrices).max(initial=0.0)
    difference = np.abs(matrices - matrices.swapaxes(-1, -2)).max(initial=0.0)
    got = f"entries that differ from their mirror image by {difference:g}"
    require(difference <= ROUNDING * scale, place, "symmetric matrices", got)
    least = np.linalg.eigvalsh(matrices).min(initial=0.0)
    require(least >= -ROUNDING * scale, place, "no negative variance", f"{least:g}")


def check_positive(path: str | Path, arrays: Mapping[str, NDArray[Any]], *names: str) -> None:
    """Require that all numbers of the named arrays are above zero."""
    for name in names:
        positive = bool(np.all(arrays[name] > 0.0))
        require(positive, f"{path}: {name}", "above zero", arrays[name])


def upper(matrices: NDArray[Any]) -> NDArray[Any]:
    """Upper triangles of symmetric matrices (..., n, n), row by row, (..., n (n + 1) / 2)."""
    rows, columns = np.triu_indices(matrices.shape[-1])
    return matrices[..., rows, columns]


def from_upper(triangles: NDArray[Any], size: int) -> NDArray[Any]:
    """Symmetric matrices (..., size, size) from their upper triangles, the inverse of `upper`."""
    rows, columns = np.triu_indices(size)
    matrices = np.zeros((*triangles.shape[:-1], size, size))
    matrices[..., rows, columns] = matrices[..., columns, rows] = triangles
    return matrices
