# SPDX-License-Identifier: Apache-2.0
"""Orthonormal coordinates in the affine span of a few long vectors."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

RANK_TOLERANCE = 1e-10
"""Singular values below this part of the largest one count as zero. Convention: rounding."""


class Span(NamedTuple):
    """n vectors of length d as coordinates in the at most n - 1 dimensions they span.

    `vectors = mean + coordinates @ axes`; distances and inner products of deviations are kept.

    Attributes:
        mean: of the vectors, (d,).
        axes: orthonormal principal axes, (r, d), that of the largest variance first.
        coordinates: (n, r), zero on average.
    """

    mean: NDArray[np.float64]
    axes: NDArray[np.float64]
    coordinates: NDArray[np.float64]


def affine_span(vectors: NDArray[np.float64]) -> Span:
    """Coordinates of vectors (n, d) along their principal axes; r is their rank, 0 if all equal."""
    mean = vectors.mean(axis=0)
    left, values, axes = np.linalg.svd(vectors - mean, full_matrices=False)
    scale = max(float(values[0]) if values.size else 0.0, float(np.abs(mean).max(initial=0.0)))
    rank = int(np.sum(values > RANK_TOLERANCE * scale)) if scale > 0 else 0
    rank = min(rank, len(vectors) - 1)
    return Span(mean, axes[:rank], left[:, :rank] * values[:rank])
