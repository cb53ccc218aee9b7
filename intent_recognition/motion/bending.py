# SPDX-License-Identifier: Apache-2.0
"""Bending a path away from what it would touch, within the spread of its task or along detours.

Independent standard normal variables z move a path: within the spread of its task, or along wider
detours (`replan`). The most probable z that takes every touching link away from what it touches is

    minimise z^T z   subject to   G z >= b.

Within the spread this is the primitive's mean conditioned exactly on the via points of the active
rows (Paraschos et al. 2018, "Using Probabilistic Movement Primitives in Robotics", modulation by
conditioning). Rows are distances linearised in the joints; a few rounds follow their curvature
(sequential convex optimisation: Schulman et al. 2014, "Motion planning with sequential convex
optimization and convex collision checking"). The norm of z counts standard deviations.

Where no bend within the spread is clear, the path is planned anew: it may move by the spread and,
at a higher cost, by any smooth detour between its ends, a Gaussian process that is fixed there (as
in Mukadam et al. 2018, "Continuous-time Gaussian process motion planning via probabilistic
inference"). `bend` descends from the path itself, then from the random detours that enter what is
in the way least deeply. Draws and numbers of steps are fixed, so the same path and things give the
same plan, unless the time for detours runs out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian, covariance_root, regression
from intent_recognition.kinematics import Arm, Bodies, Contact, JointLimits
from intent_recognition.motion.plan import POSITION_MARGIN_RAD
from intent_recognition.promp import InteractionProMP, NormalizedRBFBasis, via_point
from intent_recognition.signals import right_jacobian, to_tangent

BEYOND_M = 0.004
"""Distance beyond the clearance to which paths are bent [m]: more than splines and linearised rows
fall short."""


@dataclass(frozen=True, eq=False)
class Spread:
    """How a task's motion may vary."""

    basis: NormalizedRBFBasis  # the N basis functions of each controlled DOF
    # of the controlled weights, (Q N, Q N), with the start fixed, and the end too for bending
    covariance: Floats
    arm: Arm | None = None  # its hand is what the controlled DOFs are; None: they are joints
    # quaternion xyzw from which the hand's rotation vectors start; empty for a free orientation
    reference: tuple[float, ...] = ()

    @cached_property
    def root(self) -> Floats:
        """A root L of the covariance L L^T, (Q N, Q N), which is singular."""
        return covariance_root(self.covariance)

    @classmethod
    def of(
        cls, primitive: InteractionProMP, arm: Arm | None = None, reference: tuple[float, ...] = ()
    ) -> "Spread":
        """The spread of a primitive over all movements of the person, both ends fixed."""
        n_observed, n_basis = primitive.n_observed, primitive.basis.n_basis
        still = np.zeros(primitive.n_dofs - n_observed)
        for time_s in (0.0, primitive.duration_s):
            primitive = via_point(primitive, time_s, still, keep_observed=False)
        own = slice(n_observed * n_basis, None)
        return cls(primitive.basis, primitive.weights.covariance[own, own], arm, reference)

    @classmethod
    def given_person(
        cls, primitive: InteractionProMP, arm: Arm | None = None, reference: tuple[float, ...] = ()
    ) -> "Spread":
        """The spread of a primitive given the person's movement, with only the start fixed."""
        n_own = primitive.n_observed * primitive.basis.n_basis
        rule = regression(primitive.weights, n_own)
        controlled = InteractionProMP(
            primitive.basis,
            Gaussian(rule.offset, rule.covariance),
            0,
            primitive.noise_variance[primitive.n_observed :],
            primitive.duration_s,
        )
        still = np.zeros(controlled.n_dofs)
        weights = via_point(controlled, 0.0, still).weights
        return cls(primitive.basis, weights.covariance, arm, reference)

    def design(self, phase: Floats, positions: Floats) -> Floats:
        """Derivative of joints by weights, (T, n, Q N), at phases (T,) of a path, positions (T, n).

        For a hand it gives the least motion of the joints (pseudo-inverse of the Jacobian).
        """
        table = self.basis.design_matrix(phase)
        if self.arm is None:
            n = positions.shape[1]
            rows = np.einsum("jd,tk->tjdk", np.eye(n), table)
        else:
            rows = np.einsum("tjd,tk->tjdk", self._inverse(self.arm, positions), table)
        return rows.reshape(*rows.shape[:2], -1)

    def moves(self, phase: Floats, positions: Floats) -> Floats:
        """Derivative of joints by standard normal variables, (T, n, m); see `design`."""
        return self.design(phase, positions) @ self.root

    def _inverse(self, arm: Arm, positions: Floats) -> Floats:
        """Derivative of joints by DOFs of the hand, (T, n, 3) or (T, n, 6)."""
        jacobians = np.array([arm.jacobian(q) for q in positions])
        if not self.reference:
            return np.asarray(np.linalg.pinv(jacobians[:, :3]))
        turns = arm.forward_kinematics(positions)[:, :3, :3]
        quaternions = Rotation.from_matrix(turns).as_quat()
        change = turns @ right_jacobian(to_tangent(quaternions, self.reference))
        inverse = np.linalg.pinv(jacobians)
        inverse[:, :, 3:] = inverse[:, :, 3:] @ change
        return np.asarray(inverse)


def least_change(rows: Floats, needs: Floats) -> Floats | None:
    """The most probable z ~ N(0, I) with G z >= b, (m,); None if no z satisfies this.

    `rows` is G (k, m), `needs` is b (k,). Solved as least distance programming by non-negative
    least squares (Lawson and Hanson 1974, Chapter 23).
    """
    system = np.vstack([rows.T, needs])
    wanted = np.zeros(len(system))
    wanted[-1] = 1.0
    multipliers, distance = nnls(system, wanted, maxiter=100 * len(needs))
    if distance < 1e-6:  # a million deviations
        return None
    residual = system @ multipliers - wanted
    return np.asarray(-residual[:-1] / residual[-1])


class TouchingPath(NamedTuple):
    """A path that comes too near to something, and how it may move."""

    bodies: Bodies
    positions: Floats  # samples of the path (T, n) [rad]
    moves: Floats  # derivative of joints by z at the samples (T, n, m)
    contacts: Sequence[Contact]
    limits: JointLimits  # only its position limits count


def bend(path: TouchingPath, largest: float = np.inf, start: Floats | None = None) -> Floats | None:
    """The z (m,) that moves a path clear of all contacts; None if none was found.

    The norm of z is at most `largest`; the search begins at `start`, by default at zero.
    """
    bodies, positions, moves, contacts, limits = path
    z = np.zeros(moves.shape[2]) if start is None else start
    watched = {(one.sample, one.pair) for one in _thinned(contacts)}
    for k in range(12):  # two or three mostly suffice
        q = positions + moves @ z
        rows, needs = _position_rows(q, moves, z, limits)
        found = contacts if k == 0 and start is None else bodies.contacts(q)
        if k and not found and not rows:
            return z
        watched |= {(one.sample, one.pair) for one in _thinned(found)}
        for sample, pair in sorted(watched):
            gap, gradient = bodies.gap(q[sample], pair)
            rows.append(gradient @ moves[sample])
            needs.append(bodies.clearance_m + BEYOND_M - gap + float(rows[-1] @ z))
        newer = least_change(np.array(rows), np.array(needs))
        if newer is None or np.linalg.norm(newer) > largest:
            return None
        step = float(np.abs(moves @ (newer - z)).max())
        z = z + min(1.0, 0.5 / max(step, 1e-9)) * (newer - z)  # distances are only linear nearby
    return None


def _position_rows(
    q: Floats, moves: Floats, z: Floats, limits: JointLimits
) -> tuple[list[Floats], list[float]]:
    """Rows of G that take joints back inside their limits, and their elements of b [rad]."""
    rows, needs = [], []
    lower, upper = limits.lower + POSITION_MARGIN_RAD, limits.upper - POSITION_MARGIN_RAD
    for sign, outside in ((-1.0, q - upper), (1.0, lower - q)):
        for sample, joint in np.argwhere(outside > 0.0):
            rows.append(sign * moves[sample, joint])
            # 0.005 rad more than needed, as a spline strays between samples
            needs.append(float(outside[sample, joint] + 0.005 + rows[-1] @ z))
    return rows, needs


def _thinned(contacts: Sequence[Contact]) -> list[Contact]:
    """At most four contacts of each pair: the nearest, and others spread along the motion."""
    chosen = []
    for pair in sorted({contact.pair for contact in contacts}):
        own = [contact for contact in contacts if contact.pair == pair]
        nearest = min(own, key=lambda contact: contact.distance_m)
        evenly = np.linspace(0, len(own) - 1, min(len(own), 4) - 1).astype(int)
        chosen += [nearest, *(own[k] for k in evenly if own[k] is not nearest)]
    return chosen


def detours(phases: Floats, n_joints: int, first: float) -> Floats:
    """Derivative of joints by standard normal variables, (T, n, m): smooth, zero at both ends.

    It belongs to the path's phases (T,), and is zero up to the phase `first`.
    """
    share = np.clip((phases - first) / max(1.0 - first, 1e-9), 0.0, 1.0)
    waves = np.arange(1, 6)
    # 10 cm at the hand, more than demonstrations vary
    table = 0.15 * np.sin(np.pi * np.outer(share, waves)) / waves**1.5
    rows = np.einsum("jd,tk->tjdk", np.eye(n_joints), table)
    return rows.reshape(*rows.shape[:2], -1)


def replan(
    path: TouchingPath, tries: int | None, out_of_time: Callable[[], bool]
) -> tuple[Floats | None, bool]:
    """The z (m,) that moves a path clear of all contacts, or None, and whether detours were drawn.

    `tries` seeds the detours; with None, none are drawn. No descent begins once it is out of time.
    """
    if path.contacts[-1].sample == len(path.positions) - 1:
        return None, False  # its end touches
    found = bend(path)
    if found is not None or tries is None:
        return found, False
    # Measuring the depths of 24 detours takes as long as two descents.
    draws = np.random.default_rng([7, tries]).normal(size=(24, path.moves.shape[2]))
    depths = [_depth(path, z) for z in draws]
    for k in np.argsort(depths, kind="stable")[:4]:  # measured: docs/decisions/replanning.md
        if out_of_time():
            break
        found = bend(path, start=draws[k])
        if found is not None:
            return found, True
    return None, True


def _depth(path: TouchingPath, z: Floats) -> float:
    """Sum of depths of a moved path where the path itself was nearest to each thing [m]."""
    depth = 0.0
    nearest = {c.pair: c for c in sorted(path.contacts, key=lambda c: -c.distance_m)}
    for one in nearest.values():
        moved = path.positions[one.sample] + path.moves[one.sample] @ z
        gap = path.bodies.distance_m(moved, one.pair)
        depth += max(0.0, path.bodies.clearance_m - gap)
    return depth
