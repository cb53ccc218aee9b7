# SPDX-License-Identifier: Apache-2.0
"""A whole library through via points of the controlled agent; what it recognises stays the same.

The operator is that of `combining.via_point` (Paraschos et al. 2013, Section 2.2; Paraschos et al.
2018), for primitives that are filtered online: the point conditions what the controlled agent does
given the observed one, whose weights keep their distribution.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian, cholesky, solve_lower, symmetrize
from intent_recognition.promp.combining import condition_controlled
from intent_recognition.promp.library import TaskLibrary


class ControlPoint(NamedTuple):
    """Where the controlled agent shall be at a phase: M q = y, as exactly as R says.

    Attributes:
        phase: of the task, in [0, 1].
        matrix: M, (m, Q): rows of the identity for DOFs, a Jacobian for a hand.
        values: y, (m,).
        covariance: R, (m, m), positive definite.
    """

    phase: float
    matrix: NDArray[np.float64]
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]


def controlled_at(library: TaskLibrary, task: int, phase: float) -> Gaussian:
    """Distribution of a task's controlled positions at a phase, over all people, (Q,), (Q, Q)."""
    row, size = library.basis.design_matrix(np.array([phase]))[0], library.n_observed_weights
    mean = library.weight_mean[task, size:].reshape(library.n_controlled, -1) @ row
    shape = (library.n_controlled, len(row), library.n_controlled, len(row))
    weights = library.weight_covariance[task, size:, size:].reshape(shape)
    return Gaussian(mean, symmetrize(np.einsum("k,dkel,l->de", row, weights, row)))


def distance_to(library: TaskLibrary, task: int, point: ControlPoint) -> float:
    """Mahalanobis distance of a point from where the task is at its phase, over all people.

    In standard deviations of M q and of the wish together: sqrt(r^T (M S M^T + R)^-1 r) with
    r = y - M m.
    """
    mean, covariance = controlled_at(library, task, point.phase)
    spread = symmetrize(point.matrix @ covariance @ point.matrix.T) + point.covariance
    factor = cholesky(spread, name="spread at the point")
    return float(np.linalg.norm(solve_lower(factor, point.values - point.matrix @ mean)))


def through(library: TaskLibrary, points: Mapping[int, Sequence[ControlPoint]]) -> TaskLibrary:
    """The library whose tasks pass through points; without any, itself.

    The distribution of the observed weights stays what it is, so that what is recognised does.

    Args:
        library: the learned tasks.
        points: by number of the task, in any order.
    """
    if not any(points.values()):
        return library
    mean, covariance = library.weight_mean.copy(), library.weight_covariance.copy()
    size = library.n_observed_weights
    for task, asked in points.items():
        for phase, matrix, values, spread in asked:
            row = library.basis.design_matrix(np.array([phase]))
            design = np.asarray(np.kron(matrix, row), dtype=np.float64)
            joint = Gaussian(mean[task], covariance[task])
            joint = condition_controlled(joint, size, design, values, spread)
            mean[task], covariance[task, :, size:] = joint.mean, joint.covariance[:, size:]
            covariance[task, size:, :size] = joint.covariance[size:, :size]
            mean[task, :size] = library.weight_mean[task, :size]
    return replace(library, weight_mean=mean, weight_covariance=covariance)
