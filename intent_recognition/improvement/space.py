# SPDX-License-Identifier: Apache-2.0
"""Where practice may look: the ellipsoid of a primitive's own weights, in whitened coordinates.

A primitive's weights w are N(mean, S S'). Practice looks at w = mean + A z, where the columns of A
are the leading principal axes of the paths, so that z ~ N(0, I) is the primitive itself. With
|z| <= b no linear function of the weights, such as a DOF at any phase, leaves its own b standard
deviations: |f'A z| <= |f'A| |z|. Where A holds all of the covariance, |z| is the Mahalanobis
distance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError

NEGLIGIBLE = 1e-10
"""Singular values below this share of the largest one are numerical zeros."""


@dataclass(frozen=True)
class SearchSpace:
    """The weights that practice may try: mean + axes z with |z| at most `bound`."""

    mean: Floats  # weights of the primitive as it was shown, (d,)
    axes: Floats  # principal axes, each as long as its standard deviation, (d, k)
    bound: float = 2.0

    @property
    def n_axes(self) -> int:
        """Number of coordinates k."""
        return self.axes.shape[1]

    def weights(self, point: ArrayLike) -> Floats:
        """Weights (d,) of a point (k,)."""
        return self.mean + self.axes @ np.asarray(point, dtype=np.float64)

    def within(self, point: ArrayLike) -> Floats:
        """The point (k,) itself, or drawn toward the mean until it is inside the bound."""
        inside = np.asarray(point, dtype=np.float64)
        length = float(np.linalg.norm(inside))
        return inside * (self.bound / length) if length > self.bound else inside


def search_space(
    mean: ArrayLike,
    spread: ArrayLike,
    design: ArrayLike,
    *,
    bound: float = 2.0,
    share: float = 0.95,
) -> SearchSpace:
    """The search space of a primitive.

    It depends on the paths alone: another basis of the weights (w -> M w, design -> design M^-1)
    or another unit of a DOF gives the same points the same paths, but for the signs of axes.

    Its weights have a mean (d,) and a spread (d, r), a factor of their covariance, S S'; the design
    (Q, m, d) gives Q DOFs at m phases. The share is of the paths' variance, each DOF counted alike.

    Raises:
        ShapeError: the arrays do not fit each other.
        ArgumentError: the primitive has no spread, or a number is out of range.
    """
    mean, spread, design = (np.asarray(a, dtype=np.float64) for a in (mean, spread, design))
    size = len(mean)
    if spread.ndim != 2 or design.ndim != 3 or {len(spread), design.shape[2]} != {size}:
        got = (mean.shape, spread.shape, design.shape)
        expected, cure = "shapes (d,), (d, r), (Q, m, d)", "Take all three from one primitive."
        raise ShapeError.about("mean, spread, design", expected, got, cure)
    if not (bound > 0.0 and 0.0 < share <= 1.0):
        expected, cure = "above 0, share up to 1", "Give such numbers."
        raise ArgumentError.about("bound, share", expected, (bound, share), cure)
    paths = design @ spread
    scale = np.sqrt(np.mean(np.sum(paths**2, axis=2), axis=1))
    moving = scale > NEGLIGIBLE * np.max(np.abs(design), initial=0.0) * np.max(
        np.abs(mean), initial=0.0
    )
    if not moving.any():
        cure = "Demonstrate more than once, and not always alike."
        raise ArgumentError.about("spread", "a primitive that varies", "none at all", cure)
    stacked = (paths[moving] / scale[moving, None, None]).reshape(-1, spread.shape[1])
    _, lengths, turned = np.linalg.svd(stacked, full_matrices=False)
    held = np.cumsum(lengths**2) / np.sum(lengths**2)
    real = int(np.sum(lengths > NEGLIGIBLE * lengths[0]))
    n_axes = min(int(np.searchsorted(held, share - NEGLIGIBLE)) + 1, real)
    return SearchSpace(mean, spread @ turned[:n_axes].T, bound)
