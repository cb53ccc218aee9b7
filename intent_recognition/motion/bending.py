# SPDX-License-Identifier: Apache-2.0
"""Bending a path away from what it would touch, by the spread of its task.

The least change of the weights, measured by the covariance of the task's primitive, that takes
every touching link away from the box it touches, straight or beyond one of its faces:

    minimise d^T C^-1 d   subject to   G d >= b.

It is the primitive's mean conditioned exactly on the via points of the active rows (Paraschos et
al. 2018, "Using Probabilistic Movement Primitives in Robotics", modulation by conditioning). Rows
are distances linearised in the joints; a few rounds follow their curvature. The root of
d^T C^-1 d counts standard deviations, and is bounded.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from intent_recognition.gaussian import Gaussian, covariance_root, regression
from intent_recognition.kinematics import Arm, Bodies, Contact
from intent_recognition.promp import InteractionProMP, NormalizedRBFBasis, via_point
from intent_recognition.signals import right_jacobian, to_tangent

_BEYOND_M = 0.004
"""Paths are bent so much farther than the clearance [m]. Convention: more than splines and
linearised rows leave."""
_N_ROUNDS = 6
"""Rounds of measuring and bending in all. Convention: two or three are the rule."""
_N_ROWS = 4
"""Samples of one pair that become rows in one round, its nearest among them. Convention."""
_WAYS: tuple[int | None, ...] = (None, *range(6))
"""Past a box: straight away from it, or beyond one of its faces."""
_INFEASIBLE = 1e-6
"""Residual below which inequalities contradict one another: weights a million deviations off would
be needed."""


@dataclass(frozen=True, eq=False)
class Spread:
    """How a task's motion may vary.

    Attributes:
        basis: the N basis functions of each controlled DOF.
        covariance: of the controlled weights, (Q N, Q N); the position at the start is fixed, and
            that at the end where the motion may only be bent.
        arm: whose hand the controlled DOFs are; None where they are the joints.
        reference: quaternion xyzw from which the hand's rotation vectors start; empty where its
            orientation is free.
    """

    basis: NormalizedRBFBasis
    covariance: NDArray[np.float64]
    arm: Arm | None = None
    reference: tuple[float, ...] = ()

    @cached_property
    def root(self) -> NDArray[np.float64]:
        """A root L of the covariance, L L^T (Q N, Q N); that has no full rank."""
        return covariance_root(self.covariance)

    @classmethod
    def of(
        cls,
        primitive: InteractionProMP,
        arm: Arm | None = None,
        reference: tuple[float, ...] = (),
    ) -> "Spread":
        """Of an interaction primitive: whatever the person does, both ends fixed."""
        n_observed, n_basis = primitive.n_observed, primitive.basis.n_basis
        still = np.zeros(primitive.n_dofs - n_observed)
        for time_s in (0.0, primitive.duration_s):
            primitive = via_point(primitive, time_s, still, keep_observed=False)
        own = slice(n_observed * n_basis, None)
        return cls(primitive.basis, primitive.weights.covariance[own, own], arm, reference)

    @classmethod
    def given_person(
        cls,
        primitive: InteractionProMP,
        arm: Arm | None = None,
        reference: tuple[float, ...] = (),
    ) -> "Spread":
        """Of an interaction primitive for what the person does; only the start is fixed."""
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

    def design(
        self, phase: NDArray[np.float64], positions: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Joints by weights, (T, n, Q N), at phases (T,) of a path through positions (T, n).

        For a hand, the least motion of the joints that moves it (the pseudo-inverse Jacobian).
        """
        table = self.basis.design_matrix(phase)
        if self.arm is None:
            n = positions.shape[1]
            rows = np.einsum("jd,tk->tjdk", np.eye(n), table)
        else:
            rows = np.einsum("tjd,tk->tjdk", self._inverse(self.arm, positions), table)
        return rows.reshape(*rows.shape[:2], -1)

    def _inverse(self, arm: Arm, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joints by DOFs of the hand, (T, n, 3) or (T, n, 6)."""
        jacobians = np.array([arm.jacobian(q) for q in positions])
        if not self.reference:
            return np.asarray(np.linalg.pinv(jacobians[:, :3]))
        turns = arm.forward_kinematics(positions)[:, :3, :3]
        quaternions = Rotation.from_matrix(turns).as_quat()
        change = turns @ right_jacobian(to_tangent(quaternions, self.reference))
        inverse = np.linalg.pinv(jacobians)
        inverse[:, :, 3:] = inverse[:, :, 3:] @ change
        return np.asarray(inverse)


def least_change(
    root: NDArray[np.float64], rows: NDArray[np.float64], needs: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float]:
    """The most probable weights d ~ N(0, C) with G d >= b, and how many standard deviations off.

    Least distance programming by nonnegative least squares (Lawson and Hanson 1974, Chapter 23).
    Where no weights will do, zeros, infinitely far off.

    Args:
        root: L with C = L L^T (m, m).
        rows: G (k, m).
        needs: b (k,).
    """
    system = np.vstack([(rows @ root).T, needs])
    wanted = np.zeros(len(system))
    wanted[-1] = 1.0
    multipliers, distance = nnls(system, wanted, maxiter=100 * len(needs))
    if distance < _INFEASIBLE:
        return np.zeros(len(root)), np.inf
    residual = system @ multipliers - wanted
    whitened = -residual[:-1] / residual[-1]
    return root @ whitened, float(np.linalg.norm(whitened))


def bend(
    bodies: Bodies,
    spread: Spread,
    positions: NDArray[np.float64],
    design: NDArray[np.float64],
    contacts: Sequence[Contact],
    largest: float,
) -> NDArray[np.float64] | None:
    """Weights (m,) to add, that clear a path of all contacts; None if none were found.

    Each box is passed in the way that is cheapest for what touches it first: straight away from it,
    or beyond one of its faces; where that leads farther than `largest`, in the next.

    Args:
        bodies: the arm among boxes.
        spread: of the task.
        positions: samples of the path (T, n) [rad].
        design: joints by weights at the samples (T, n, m).
        contacts: of the path.
        largest: standard deviations that the path may be moved at most.
    """
    rounds = 0
    ways: dict[int, list[int | None]] = {}
    while rounds < _N_ROUNDS:
        sides: dict[int | None, int | None] = {}
        newest: int | None = None
        weights, found, q = np.zeros(design.shape[2]), contacts, positions
        rows, needs = np.empty((0, design.shape[2])), np.empty(0)
        while rounds < _N_ROUNDS:
            rounds += 1
            for box in {bodies.box_of(c.pair) for c in found}:
                if box is None or box in sides:
                    continue
                newest = box
                if box not in ways:
                    own = [c for c in found if bodies.box_of(c.pair) == box]
                    ways[box] = _ways(bodies, spread, q, design, own, largest)
                if not ways[box]:
                    return None
                sides[box] = ways[box][0]
            more = _linearised(bodies, q, design, _thinned(found, _N_ROWS), sides)
            rows = np.vstack([rows, more[0]])
            needs = np.append(needs, more[1] + more[0] @ weights)
            weights, deviations = least_change(spread.root, rows, needs)
            if deviations > largest:
                break
            q = positions + design @ weights
            found = bodies.contacts(q)
            if not found:
                return weights
        if newest is None:
            return None
        del ways[newest][0]
    return None


def _ways(
    bodies: Bodies,
    spread: Spread,
    q: NDArray[np.float64],
    design: NDArray[np.float64],
    contacts: Sequence[Contact],
    largest: float,
) -> list[int | None]:
    """Ways past a box that its nearest contacts can be moved, the cheapest first."""
    box, nearest = bodies.box_of(contacts[0].pair), _thinned(contacts, 1)
    costs = {
        side: least_change(spread.root, *_linearised(bodies, q, design, nearest, {box: side}))[1]
        for side in _WAYS
    }
    return sorted((way for way in costs if costs[way] <= largest), key=costs.__getitem__)


def _linearised(
    bodies: Bodies,
    q: NDArray[np.float64],
    design: NDArray[np.float64],
    contacts: Sequence[Contact],
    sides: Mapping[int | None, int | None],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rows (k, m) by which weights move each contact apart, and what is needed (k,) [m]."""
    rows, needs = [], []
    for contact in contacts:
        side = sides.get(bodies.box_of(contact.pair))
        gap, gradient = bodies.gap(q[contact.sample], contact.pair, side)
        rows.append(gradient @ design[contact.sample])
        needs.append(bodies.clearance_m + _BEYOND_M - gap)
    return np.array(rows), np.array(needs)


def _thinned(contacts: Sequence[Contact], most: int) -> list[Contact]:
    """At most so many contacts of each pair: its nearest, and others evenly along the motion."""
    chosen = []
    for pair in sorted({contact.pair for contact in contacts}):
        own = [contact for contact in contacts if contact.pair == pair]
        nearest = min(own, key=lambda contact: contact.distance_m)
        evenly = np.linspace(0, len(own) - 1, min(len(own), most) - 1).astype(int)
        chosen += [nearest, *(own[k] for k in evenly if own[k] is not nearest)]
    return chosen
