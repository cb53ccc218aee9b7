# SPDX-License-Identifier: Apache-2.0
"""Via points of the controlled agent that leave the observed agent unchanged.

As in `combining.via_point` (Paraschos et al. 2013, Section 2.2; Paraschos et al. 2018), a point
conditions the controlled weights given the observed ones. The distribution of the observed weights
stays the same. A whole library can thus pass through points and recognise tasks as before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import (
    Gaussian,
    cholesky,
    condition,
    marginal,
    regression,
    solve_lower,
    symmetrize,
)
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.ridge import with_slopes


class ControlPoint(NamedTuple):
    """Desired position of the controlled agent at a phase: M q = y with covariance R."""

    phase: float  # phase of the task, in [0, 1]
    matrix: Floats  # M, (m, Q): rows of the identity for DOFs, a Jacobian for a hand
    values: Floats  # y, (m,)
    covariance: Floats  # R, (m, m), positive definite


def condition_controlled(
    joint: Gaussian, n_observed: int, matrix: Floats, point: Floats, spread: Floats
) -> Gaussian:
    """Condition the controlled weights on a point; the observed weights keep their distribution.

    For w_c | w_o = b + A w_o + e, with C the covariance of e, the gain K = C H^T (H C H^T + R)^-1
    does not depend on w_o. Hence A becomes (1 - K H) A, b becomes b + K (y - H b), and C becomes
    C - K H C (Paraschos et al. 2013, "modulation of via-points", given the person). The result is
    the same whether the person is observed before or after.

    Args:
        joint: joint distribution of (w_o, w_c).
        n_observed: number of observed weights.
        matrix: H of the controlled weights, (m, n_c).
        point: y, (m,).
        spread: R, (m, m).
    """
    rule, observed = regression(joint, n_observed), marginal(joint, np.arange(n_observed))
    own, _ = condition(Gaussian(rule.offset, rule.covariance), matrix, point, spread)
    gained = matrix @ rule.covariance
    gain = np.linalg.solve(gained @ matrix.T + spread, gained).T
    slopes = rule.matrix - gain @ (matrix @ rule.matrix)
    mean = np.concatenate([observed.mean, slopes @ observed.mean + own.mean])
    return Gaussian(mean, with_slopes(observed.covariance, slopes, own.covariance))


def controlled_at(library: TaskLibrary, task: int, phase: float) -> Gaussian:
    """Prior distribution of a task's controlled positions at a phase, (Q,) and (Q, Q)."""
    row, size = library.basis.design_matrix(np.array([phase]))[0], library.n_observed_weights
    mean = library.weight_mean[task, size:].reshape(library.n_controlled, -1) @ row
    shape = (library.n_controlled, len(row), library.n_controlled, len(row))
    weights = library.weight_covariance[task, size:, size:].reshape(shape)
    return Gaussian(mean, symmetrize(np.einsum("k,dkel,l->de", row, weights, row)))


def distance_to(library: TaskLibrary, task: int, point: ControlPoint) -> float:
    """Mahalanobis distance of a point from the prior of the task at the point's phase.

    The covariances of M q and of the point add up: sqrt(r^T (M S M^T + R)^-1 r) with r = y - M m.
    """
    mean, covariance = controlled_at(library, task, point.phase)
    spread = symmetrize(point.matrix @ covariance @ point.matrix.T) + point.covariance
    factor = cholesky(spread, name="spread at the point")
    return float(np.linalg.norm(solve_lower(factor, point.values - point.matrix @ mean)))


def through(library: TaskLibrary, points: Mapping[int, Sequence[ControlPoint]]) -> TaskLibrary:
    """Make tasks of a library pass through points; without points, return the library itself.

    The distribution of the observed weights stays the same, and so does recognition. The residuals'
    coupling, the scaling of displacements with the duration and the fixed delay are dropped: they
    would move the controlled agent away from the points.
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
    return replace(
        library,
        weight_mean=mean,
        weight_covariance=covariance,
        coupling=None,
        pose_regression=None,
        displacement_exponent=0.0,
        delay_s=0.0,
    )
