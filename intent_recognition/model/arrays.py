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


def require(sound: bool, place: str, expected: str, got: object, cure: str = RETRAIN) -> None:
    """Make sure that a part of a model file is as expected; the error names its place if not."""
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
    """Make sure that arrays are there, real, of their shape and finite."""
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
    """Make sure that matrices (..., n, n) are symmetric and not negative, up to rounding."""
    place = f"{path}: {name}"
    scale = np.abs(matrices).max(initial=0.0)
    difference = np.abs(matrices - matrices.swapaxes(-1, -2)).max(initial=0.0)
    got = f"entries that differ from their mirror image by {difference:g}"
    require(difference <= ROUNDING * scale, place, "symmetric matrices", got)
    least = np.linalg.eigvalsh(matrices).min(initial=0.0)
    require(least >= -ROUNDING * scale, place, "no negative variance", f"{least:g}")


def check_positive(path: str | Path, arrays: Mapping[str, NDArray[Any]], *names: str) -> None:
    """Make sure that all numbers of some arrays are above zero."""
    for name in names:
        positive = bool(np.all(arrays[name] > 0.0))
        require(positive, f"{path}: {name}", "above zero", arrays[name])


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
