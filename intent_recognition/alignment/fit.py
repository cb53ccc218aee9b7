# SPDX-License-Identifier: Apache-2.0
"""Fit of the warps that bring demonstrations onto a reference: cost, derivatives, descent.

Maeda et al. 2014, Eq. 16, minimise the L1 distance between reference and warped demonstration. Here
the cost is a negative log posterior: Laplace distributed deviations of given scale per DOF, and a
Gaussian prior on the log rate (`prior_precision`) and on both ends. The corner of the absolute
value is rounded. The mean deviation of each DOF is subtracted: an offset in space is no difference
in timing, but the plain distance would bend the warp to reduce it.

All demonstrations descend at once by damped Gauss-Newton steps, independently of each other. A
deviation depends on the weights through one recorded phase, so the normal equations of a
demonstration are (K + 1, K + 1) sums over samples of a scalar curvature.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.alignment.warp import MAX_LOG_RATE
from intent_recognition.array_types import Floats

ROUNDING = 0.3
"""Rounding of |x|: sqrt(x^2 + ROUNDING^2), x in units of the deviations' scale (docs/alignment.md).
"""


class Curves(NamedTuple):
    """Piecewise cubic demonstrations on an even grid of recorded phases."""

    # coefficients of 1, f, f^2 and f^3 with f from 0 to 1 in each interval, (4, n, T - 1, D)
    coefficients: Floats

    @classmethod
    def through(cls, samples: Floats) -> "Curves":
        """Hermite cubics through samples (n, T, D) with central differences as slopes."""
        slope = np.gradient(samples, axis=1)
        y0, m0, m1 = samples[:, :-1], slope[:, :-1], slope[:, 1:]
        rise = samples[:, 1:] - y0
        return cls(np.stack([y0, m0, 3 * rise - 2 * m0 - m1, m0 + m1 - 2 * rise]))

    def of(self, which: NDArray[np.intp]) -> "Curves":
        """Curves of some of the demonstrations."""
        return Curves(self.coefficients.take(which, axis=1))

    def at(self, phase: Floats) -> tuple[Floats, Floats]:
        """Values and d value / d phase, (n, T', D), at phases (n, T'); constant outside [0, 1]."""
        _, n, intervals, n_dofs = self.coefficients.shape
        position = np.clip(phase, 0.0, 1.0) * intervals
        index = np.minimum(position.astype(np.intp), intervals - 1)
        f = np.repeat(position - index, n_dofs).reshape(*phase.shape, n_dofs)
        inside = (phase >= 0.0) & (phase <= 1.0)
        index += intervals * np.arange(n)[:, None]
        c0, c1, c2, c3 = (
            table.take(index, axis=0)
            for table in self.coefficients.reshape(4, n * intervals, n_dofs)
        )
        slope = (c1 + f * (2.0 * c2 + f * (3.0 * c3))) * (intervals * inside)[..., None]
        return c0 + f * (c1 + f * (c2 + f * c3)), slope


class WarpProblem(NamedTuple):
    """Data and priors of the warps of n demonstrations."""

    curves: Curves  # the demonstrations, each DOF in units of its typical deviation after alignment
    reference: Floats  # reference at even phases, in the same units, (T, D)
    basis: Floats  # basis functions of the log rate between the reference phases, (T - 1, K)
    prior_precision: Floats  # prior precision of the K weights of the log rate, (K, K)
    end_std: float  # prior standard deviation of h(0) and of h(1) - 1
    n_independent: float  # samples of a demonstration that count as independent


class LocalCost(NamedTuple):
    """Cost, gradient and curvature at some parameters: (n,), (n, K + 1), (n, K + 1, K + 1)."""

    cost: Floats
    gradient: Floats
    curvature: Floats


def recorded_phase(basis: Floats, parameters: Floats) -> tuple[Floats, Floats]:
    """Recorded phases h at the reference phases, (n, T), and rates between them, (n, T - 1).

    Eq. 15, for a basis (T - 1, K) and parameters (n, K + 1): shift, then weights of the log rate.
    """
    log_rate = (basis @ parameters[:, 1:, None])[..., 0]
    rate = np.exp(np.clip(log_rate, -MAX_LOG_RATE, MAX_LOG_RATE))
    phase = np.empty((len(parameters), len(basis) + 1))
    phase[:, 0] = 0.0
    np.cumsum(rate, axis=1, out=phase[:, 1:])
    phase /= len(basis)
    phase += parameters[:, :1]
    return phase, rate


def local_cost(problem: WarpProblem, parameters: Floats) -> LocalCost:
    """Cost, its exact gradient, and the Gauss-Newton curvature (Eq. 16 with priors).

    Parameters (n, K + 1) are the shift, then the weights of the log rate.
    """
    phase, rate = recorded_phase(problem.basis, parameters)
    slope, residual, distance = _deviations(problem, phase)
    n, n_grid = phase.shape
    share = problem.n_independent / n_grid
    mean = np.full((1, n_grid), 1.0 / n_grid)
    weight = share / distance
    force = residual * weight
    force -= mean @ force

    jacobian = np.empty((n, parameters.shape[1], n_grid))
    jacobian[:, 0] = 1.0
    jacobian[:, 1:, 0] = 0.0
    gains = rate[:, None] * (problem.basis.T / len(problem.basis))
    np.cumsum(gains, axis=2, out=jacobian[:, 1:, 1:])
    pulled = weight * slope
    pull = np.einsum("ntd,ntd->nt", force, slope)
    stiffness = np.einsum("ntd,ntd->nt", pulled, slope)
    gradient = (jacobian @ pull[..., None])[..., 0]
    curvature = (stiffness[:, None] * jacobian) @ np.swapaxes(jacobian, 1, 2)
    level = (jacobian @ pulled) / np.sqrt(n_grid * (mean @ weight))
    curvature -= level @ np.swapaxes(level, 1, 2)

    precision, end_jacobian = problem.end_std**-2, jacobian[:, :, -1]
    gradient[:, 0] += precision * parameters[:, 0]
    gradient[:, 1:] += (problem.prior_precision @ parameters[:, 1:, None])[..., 0]
    gradient += precision * (phase[:, -1:] - 1.0) * end_jacobian
    curvature[:, 0, 0] += precision
    curvature[:, 1:, 1:] += problem.prior_precision
    curvature += precision * end_jacobian[:, :, None] * end_jacobian[:, None, :]
    return LocalCost(_cost(problem, parameters, phase, distance), gradient, curvature)


def total_cost(problem: WarpProblem, parameters: Floats) -> Floats:
    """Cost alone, (n,); the arguments are those of `local_cost`."""
    phase, _ = recorded_phase(problem.basis, parameters)
    return _cost(problem, parameters, phase, _deviations(problem, phase)[2])


def _deviations(problem: WarpProblem, phase: Floats) -> tuple[Floats, Floats, Floats]:
    """d value / d phase, centred deviations, and their rounded absolute values, (n, T, D) each."""
    values, slope = problem.curves.at(phase)
    values -= problem.reference
    values -= np.full((1, phase.shape[1]), 1.0 / phase.shape[1]) @ values
    return slope, values, np.sqrt(values**2 + ROUNDING**2)


def _cost(problem: WarpProblem, parameters: Floats, phase: Floats, distance: Floats) -> Floats:
    """Sum of the costs of deviations and priors, (n,)."""
    weights = parameters[:, 1:]
    ends = parameters[:, 0] ** 2 + (phase[:, -1] - 1.0) ** 2
    rates = np.sum((problem.prior_precision @ weights[..., None])[..., 0] * weights, axis=1)
    share = problem.n_independent / phase.shape[1]
    deviations = share * np.sum(distance - ROUNDING, axis=(1, 2))
    return deviations + 0.5 * (rates + ends / problem.end_std**2)


def descend(problem: WarpProblem, start: Floats, n_iterations: int) -> tuple[Floats, Floats]:
    """Parameters (n, K + 1) and costs (n,) after damped Gauss-Newton steps from a start (n, K + 1).

    A step that would increase a cost is not taken.
    """
    parameters = np.array(start)
    local = local_cost(problem, parameters)
    cost = local.cost.copy()
    damping = np.full(len(start), 1e-3)
    active = np.arange(len(start))
    for _ in range(n_iterations):
        step = _step(local, damping[active])
        going = -0.5 * np.sum(step * local.gradient, axis=1) > 0.05  # expected decrease [nats]
        active, step, local = (
            active[going],
            step[going],
            LocalCost(*(part[going] for part in local)),
        )
        if not active.size:
            break
        part = problem
        if len(active) < len(start):
            part = problem._replace(curves=problem.curves.of(active))
        tried = local_cost(part, parameters[active] + step)
        better = tried.cost < local.cost
        parameters[active[better]] += step[better]
        cost[active[better]] = tried.cost[better]
        damping[active] *= np.where(better, 0.2, 10.0)
        row = better[:, None]
        local = LocalCost(
            np.where(better, tried.cost, local.cost),
            np.where(row, tried.gradient, local.gradient),
            np.where(row[..., None], tried.curvature, local.curvature),
        )
    return parameters, cost


def _step(local: LocalCost, damping: Floats) -> Floats:
    """Levenberg-Marquardt steps, (n, K + 1)."""
    diagonal = np.einsum("nkk->nk", local.curvature)
    damped = local.curvature + np.eye(diagonal.shape[1]) * (damping[:, None] * diagonal)[:, None]
    return -np.linalg.solve(damped, local.gradient[..., None])[..., 0]
