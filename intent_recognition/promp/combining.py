# SPDX-License-Identifier: Apache-2.0
"""Modulation and combination of primitives: via points, co-activation, blending over time.

The operators of Paraschos et al. 2013, "Probabilistic Movement Primitives", Section 2.2, and
Paraschos et al. 2018, "Using Probabilistic Movement Primitives in Robotics" (modulation by
conditioning; combination and blending), on the joint primitive of both agents.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, Integers, brief
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian import condition, product, symmetrize
from intent_recognition.promp.control_points import condition_controlled
from intent_recognition.promp.interaction import InteractionProMP
from intent_recognition.signals import as_numbers


@brief
class Blend(NamedTuple):
    """Blended trajectory of m DOFs.

    Attributes:
        times_s: times, (T,).
        positions: mean positions, (T, m).
        velocities: derivatives of the mean positions, per second, (T, m).
        covariance: covariance of the positions at each time with measurement noise, (T, m, m).
    """

    times_s: Floats
    positions: Floats
    velocities: Floats
    covariance: Floats

    @property
    def std(self) -> Floats:
        """Standard deviation of each position, (T, m)."""
        return np.sqrt(np.einsum("tdd->td", self.covariance))


def via_point(
    primitive: InteractionProMP,
    time_s: float,
    values: ArrayLike,
    *,
    dofs: Sequence[int] | None = None,
    covariance: ArrayLike | None = None,
    velocity: bool = False,
    keep_observed: bool = True,
) -> InteractionProMP:
    """Make a primitive pass through a point of any DOFs, at any time, with a given covariance.

    The weights are conditioned on the point with this covariance, without measurement noise
    (Paraschos et al. 2013, "modulation of via-points"): w' = w + L (y - H w) with
    L = P H^T (R + H P H^T)^-1. Without a covariance, the mean passes through the point exactly.
    DOFs of infinite variance are ignored. Other DOFs and times of the robot follow by correlation.

    A point for the robot is no evidence about the person. If all its DOFs are controlled, the
    distribution of the observed weights stays the same, and w, P are those of the robot's weights
    given the person's. The point and observations of the person may be conditioned on in any order.

    Args:
        primitive: primitive to modulate; it is not changed.
        time_s: time of the point, from 0 to `duration_s` [s].
        values: the point, (m,), in the units of the DOFs, per second with `velocity`.
        dofs: m indices, counted from 0 over the observed, then the controlled DOFs; None for all
            controlled DOFs.
        covariance: covariance (m, m), or variances (m,), of which some may be infinite; None for 0.
        velocity: whether the point is a velocity.
        keep_observed: False takes the point as evidence about the person too, as
            `InteractionProMP.condition` does; so does a point with an observed DOF.

    Raises:
        ShapeError: the arrays do not fit each other.
        ArgumentError: a number is not finite, there is no such DOF or time, or the primitive has no
            variance left there, for example since it was conditioned exactly before.
    """
    index = _index(primitive, dofs)
    if not 0.0 <= time_s <= primitive.duration_s:
        expected = f"a time from 0 to {primitive.duration_s:g} s"
        raise ArgumentError.about("time_s", expected, time_s, "Give a time of the movement.")
    point = as_numbers("values", values)
    wish = np.zeros(index.size) if covariance is None else as_numbers("covariance", covariance)
    if point.shape != index.shape or wish.shape not in (index.shape, 2 * index.shape):
        expected = f"values ({index.size},) and a covariance ({index.size}, {index.size})"
        got = f"{point.shape} and {wish.shape}"
        raise ShapeError.about("values, covariance", expected, got, "Give one for each DOF.")
    wish = np.array(np.diag(wish) if wish.ndim == 1 else wish, dtype=np.float64)
    wanted = ~np.isinf(np.diag(wish))
    cure = "Name only the DOFs that shall pass there as `dofs`."
    if not (np.all(np.isfinite(point[wanted])) and np.all(np.isfinite(wish[wanted][:, wanted]))):
        raise ArgumentError.about("values", "finite numbers", "NaN or infinity", cure)
    if not wanted.any():
        return primitive
    rows = index[wanted]
    phase = np.array([time_s / primitive.duration_s])
    if velocity:
        design = primitive.basis.derivative_matrix(phase) / primitive.duration_s
        matrix = np.asarray(np.kron(np.eye(primitive.n_dofs)[rows], design), np.float64)
    else:
        matrix = primitive.observation_matrix(phase, rows.tolist())
    spread, n_own = wish[wanted][:, wanted], primitive.n_observed * primitive.basis.n_basis
    if keep_observed and n_own and np.all(rows >= primitive.n_observed):
        weights = condition_controlled(
            primitive.weights, n_own, matrix[:, n_own:], point[wanted], spread
        )
    else:
        weights, _ = condition(primitive.weights, matrix, point[wanted], spread)
    return replace(primitive, weights=weights)


def co_activate(
    primitives: Sequence[InteractionProMP], activations: Sequence[float]
) -> InteractionProMP:
    """Combine primitives into one: the product of their distributions.

    p(w) is proportional to prod_i p_i(w)^a_i (Paraschos et al. 2013, "combination"), so that the
    primitive of the smallest variance dominates. A primitive combined with itself stays the same if
    the activations sum to 1. The result can be conditioned like any primitive. Its duration and
    measurement noise are averages weighted by the activations.

    Args:
        primitives: primitives of the same DOFs and basis functions.
        activations: a_i, one per primitive, not negative and not all zero.

    Raises:
        ArgumentError: the primitives do not fit each other, or no activation is above zero.
    """
    _check_same(primitives)
    powers = _activations(activations, (len(primitives),))
    share = powers / powers.sum()
    return replace(
        primitives[0],
        weights=product([one.weights for one in primitives], powers.tolist()),
        noise_variance=share @ np.array([one.noise_variance for one in primitives]),
        duration_s=float(share @ [one.duration_s for one in primitives]),
    )


def blend(
    primitives: Sequence[InteractionProMP],
    times_s: ArrayLike,
    activations: ArrayLike,
    *,
    rates: ArrayLike | None = None,
    starts_s: Sequence[float] | None = None,
    dofs: Sequence[int] | None = None,
) -> Blend:
    """Blend primitives by activations that change during the movement.

    The distribution of positions at each time is proportional to prod_i p_i(y_t)^a_i(t) (Paraschos
    et al. 2013, "blending"): precisions add up, weighted by the activations. A primitive of much
    smaller variance than the others dominates even at a small activation. The paper multiplies the
    joint distributions of positions and velocities for a feedback controller; here the velocity is
    the derivative of the blended mean, so that a position controller can follow both. Position and
    velocity are continuous if the rates of the activations are (`smooth_switch`).

    Args:
        primitives: K primitives of the same DOFs. Before its start and after its end, a primitive
            rests at its first and last position.
        times_s: increasing times, (T,) [s].
        activations: activations, (T, K), not negative, not all zero at any time.
        rates: derivatives of the activations, (T, K) [1/s]; None differentiates numerically.
        starts_s: time at which each primitive begins [s]; None for all at 0.
        dofs: m indices, counted from 0 over the observed, then the controlled DOFs; None for all
            controlled DOFs.

    Raises:
        ShapeError: the arrays do not fit each other.
        ArgumentError: the primitives do not fit each other, times do not increase, or an
            activation is negative, not finite, or none is above zero.
    """
    if len({(one.n_observed, one.n_dofs) for one in primitives}) != 1:
        got = [(one.n_observed, one.n_dofs) for one in primitives]
        raise ArgumentError.about("primitives", "the same DOFs", got, "Learn them together.")
    times = np.asarray(times_s, dtype=np.float64)
    if times.ndim != 1 or times.size < 2 or not np.all(np.diff(times) > 0.0):
        raise ArgumentError.about("times_s", "increasing times (T,)", times, "Sort them.")
    shares = _activations(activations, (times.size, len(primitives)))
    if rates is None:
        edge: Literal[1, 2] = 2 if times.size > 2 else 1
        slopes = np.asarray(np.gradient(shares, times, axis=0, edge_order=edge), np.float64)
    else:
        slopes = np.asarray(rates, dtype=np.float64)
    if slopes.shape != shares.shape:
        expected = f"shape {shares.shape}"
        raise ShapeError.about("rates", expected, slopes.shape, "One for each activation.")
    starts = [0.0] * len(primitives) if starts_s is None else starts_s
    index = _index(primitives[0], dofs)
    precision, precision_rate = np.zeros((2, times.size, index.size, index.size))
    pull, pull_rate = np.zeros((2, times.size, index.size))
    for one, start, share, slope in zip(primitives, starts, shares.T, slopes.T, strict=True):
        mean, mean_rate, covariance, covariance_rate = _moments(one, times - start, index)
        inverse = np.linalg.inv(covariance)
        own = share[:, None, None] * inverse
        own_rate = slope[:, None, None] * inverse - own @ covariance_rate @ inverse
        precision += own
        precision_rate += own_rate
        pull += _times(own, mean)
        pull_rate += _times(own_rate, mean) + _times(own, mean_rate)
    covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
    positions = _times(covariance, pull)
    velocities = _times(covariance, pull_rate - _times(precision_rate, positions))
    return Blend(times, positions, velocities, symmetrize(covariance))


def minimum_jerk(share: ArrayLike) -> Floats:
    """Minimum-jerk progress 10 s^3 - 15 s^4 + 6 s^5 (Flash and Hogan 1985) at shares s of time.

    It is 0 below s = 0 and 1 above s = 1, with zero velocity and acceleration at both ends.
    """
    s = np.clip(np.asarray(share, dtype=np.float64), 0.0, 1.0)
    return np.minimum(s**3 * (10.0 + s * (-15.0 + 6.0 * s)), 1.0)  # rounding may exceed 1


def smooth_switch(times_s: ArrayLike, at_s: float, over_s: float) -> tuple[Floats, Floats]:
    """Activations of two primitives, of which the second takes over from the first.

    The second activation is `minimum_jerk` over the duration of the change, the first is one minus
    it: both are continuous up to the second derivative.

    Args:
        times_s: times, (T,) [s].
        at_s: middle of the change [s].
        over_s: duration of the change, above zero [s].

    Returns:
        Activations (T, 2) and their rates (T, 2) [1/s], for `blend`.

    Raises:
        ArgumentError: `over_s` is not above zero.
    """
    if not over_s > 0.0:
        raise ArgumentError.about("over_s", "a time above zero", over_s, "Give a longer one.")
    share = (np.asarray(times_s, dtype=np.float64) - at_s) / over_s + 0.5
    share = np.clip(share, 0.0, 1.0)
    second = minimum_jerk(share)
    rate = 30.0 * share**2 * (1.0 - share) ** 2 / over_s
    return np.column_stack([1.0 - second, second]), np.column_stack([-rate, rate])


def _moments(primitive: InteractionProMP, times_s: Floats, dofs: Integers) -> tuple[Floats, ...]:
    """Mean (T, m) and covariance (T, m, m) of positions, and their derivatives per second."""
    basis, n_dofs = primitive.basis, primitive.n_dofs
    phase = np.clip(times_s / primitive.duration_s, 0.0, 1.0)
    moving = (times_s >= 0.0) & (times_s <= primitive.duration_s)
    design = basis.design_matrix(phase)
    slope = basis.derivative_matrix(phase) * (moving / primitive.duration_s)[:, None]
    means = primitive.weights.mean.reshape(n_dofs, -1)[dofs].T
    blocks = primitive.weights.covariance.reshape(n_dofs, basis.n_basis, n_dofs, basis.n_basis)
    blocks = blocks[dofs][:, :, dofs]
    half = np.einsum("dkel,tl->tdke", blocks, design)
    covariance = np.einsum("tk,tdke->tde", design, half) + np.diag(primitive.noise_variance[dofs])
    rate = np.einsum("tk,tdke->tde", slope, half)
    return design @ means, slope @ means, covariance, rate + rate.transpose(0, 2, 1)


def _times(matrices: Floats, vectors: Floats) -> Floats:
    """Product of each of T matrices with its vector, (T, D)."""
    return np.asarray(np.einsum("tij,tj->ti", matrices, vectors))


def _index(primitive: InteractionProMP, dofs: Sequence[int] | None) -> Integers:
    """Checked indices of DOFs; those of the controlled DOFs for None."""
    index = np.array(range(primitive.n_observed, primitive.n_dofs) if dofs is None else dofs, int)
    if not index.size or index.min() < 0 or index.max() >= primitive.n_dofs:
        expected = f"numbers from 0 to {primitive.n_dofs - 1}"
        raise ArgumentError.about("dofs", expected, dofs, "Observed DOFs come first.")
    return index


def _activations(values: ArrayLike, shape: tuple[int, ...]) -> Floats:
    found = as_numbers("activations", values)
    if found.shape != shape:
        cure = "Give one for each primitive, at each time where they change."
        raise ShapeError.about("activations", f"shape {shape}", found.shape, cure)
    if not np.all(np.isfinite(found)) or np.any(found < 0.0) or np.any(found.sum(axis=-1) == 0.0):
        expected = "finite numbers from 0 on, one above 0 at each time"
        wrong = found[~np.isfinite(found) | (found < 0.0)]
        got = wrong[0] if wrong.size else "0 for all primitives at one time"
        cure = "Let the activations say which primitive counts at each time."
        raise ArgumentError.about("activations", expected, got, cure)
    return found


def _check_same(primitives: Sequence[InteractionProMP]) -> None:
    """Refuse primitives of different basis functions or DOFs."""
    first = primitives[0] if primitives else None
    if first is None or any(
        one.basis != first.basis or one.n_dofs != first.n_dofs or one.n_observed != first.n_observed
        for one in primitives
    ):
        got = [(one.basis, one.n_observed, one.n_dofs) for one in primitives]
        cure = "Learn them with the same DOFs and settings."
        raise ArgumentError.about("primitives", "the same basis and DOFs", got, cure)
