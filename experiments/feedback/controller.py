# SPDX-License-Identifier: Apache-2.0
"""The stochastic feedback controller of a ProMP (Paraschos et al. 2013), as pure functions.

The joints q and their velocities make the state x = (q, v). Inverse dynamics leaves a double
integrator, dx = (A x + B u) dt with u the joint accelerations, disturbed by white noise of spectral
density S on the accelerations. The control law u = K_t x + k_t is chosen so that mean and
covariance of x follow those of the primitive at all times. With G = A + B K,

    mean:        d mu/dt    = G mu + B k
    covariance:  d Sigma/dt = G Sigma + Sigma G^T + B S B^T.

Let N = G Sigma. Its upper rows are given by A: Cov(v, x). For the lower rows the covariance's
derivative leaves, with a the accelerations of the primitive,

    N_vq = Cov(a, q),     N_vv = Cov(a, v) - S / 2,     K = [N_vq, N_vv] Sigma^-1,
    k    = mean of a - K mu.

That is the paper's K = B^+ (dPsi^T Sw Psi - A Sigma - B S B^T / 2) Sigma^-1 for this A and B.

**A state that can be controlled.** The weights' covariance alone is singular: at the start, and
whenever the demonstrations rest, it has no velocities, and no gain withstands a disturbance. So
the state gets two terms of its own, with which everything above stays exact:

- every direction of joint space has at least the variance S / (4 w^3), which is what is left of
  the disturbance S at the largest bandwidth w allowed;
- velocities get the variance F = (S / 4)^(2/3) C^(1/3), with C = Cov(q, q). At rest this makes
  each direction a critically damped oscillator of frequency (S / (4 C))^(1/3), which under the
  disturbance S has just the variance C: stiff where demonstrations agree, soft where they vary.
  It enters with Cov(a, q) -= F and Cov(a, v) += dF/dt / 2.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian, symmetrize
from intent_recognition.promp import NormalizedRBFBasis
from sim_bridge.arm import BANDWIDTH_RAD_S, DISTURBANCE


@dataclass(frozen=True)
class FeedbackSettings:
    """Assumptions that the controller is designed for.

    Attributes:
        disturbance: spectral density S of the disturbing accelerations per joint [rad^2/s^3], one
            for all joints or (Q,); after t seconds a free joint's velocity has variance S t.
        bandwidth_rad_s: largest natural frequency w of the closed loop.
        n_times: gains are computed at so many evenly spaced times.
    """

    disturbance: float | tuple[float, ...] = DISTURBANCE
    bandwidth_rad_s: float = BANDWIDTH_RAD_S
    n_times: int = 401

    def density(self, n_joints: int) -> Floats:
        """S per joint, (Q,)."""
        return np.broadcast_to(np.array(self.disturbance, dtype=np.float64), (n_joints,))


@dataclass(frozen=True, eq=False)
class FeedbackPolicy:
    """Time-varying gains of a double integrator, and the distribution they reproduce.

    Attributes:
        times_s: (T,), evenly spaced from 0 to the primitive's duration.
        gain: K, (T, Q, 2 Q); columns are positions, then velocities [1/s^2, 1/s].
        offset: k, (T, Q) [rad/s^2].
        mean: of the state, (T, 2 Q) [rad, rad/s].
        covariance: of the state, (T, 2 Q, 2 Q).
        disturbance: S, (Q,) [rad^2/s^3].
        rest: gain and offset after the end: hold the mean's last position.
    """

    times_s: Floats
    gain: Floats
    offset: Floats
    mean: Floats
    covariance: Floats
    disturbance: Floats
    rest: tuple[Floats, Floats]

    @property
    def n_joints(self) -> int:
        """Number of joints Q."""
        return len(self.disturbance)

    @property
    def std(self) -> Floats:
        """Standard deviation of each joint's position, (T, Q) [rad]."""
        diagonal = np.diagonal(self.covariance, axis1=1, axis2=2)
        return np.sqrt(diagonal[:, : self.n_joints])

    @property
    def stiffness(self) -> Floats:
        """Each joint's own restoring acceleration per deviation, (T, Q) [1/s^2].

        Negative where the primitive lets deviations grow.
        """
        return -np.diagonal(self.gain[:, :, : self.n_joints], axis1=1, axis2=2)

    def at(self, time_s: float) -> tuple[Floats, Floats]:
        """K (Q, 2 Q) and k (Q,) at a time since the start, between the grid's by a line."""
        if time_s >= self.times_s[-1]:
            return self.rest
        row = max(time_s, 0.0) / self.times_s[1]
        low = min(int(row), len(self.times_s) - 2)
        share = row - low
        gain = self.gain[low] + share * (self.gain[low + 1] - self.gain[low])
        return gain, self.offset[low] + share * (self.offset[low + 1] - self.offset[low])

    def acceleration(self, time_s: float, q: Floats, qd: Floats) -> Floats:
        """Commanded joint accelerations, u = K x + k, (Q,) [rad/s^2]."""
        gain, offset = self.at(time_s)
        return gain @ np.concatenate((q, qd)) + offset


def feedback_policy(
    basis: NormalizedRBFBasis,
    weights: Gaussian,
    duration_s: float,
    settings: FeedbackSettings | None = None,
) -> FeedbackPolicy:
    """The controller that reproduces a primitive's distribution.

    Args:
        basis: the basis functions, N.
        weights: of Q joints, grouped by joint, (Q N,): those of a primitive, or a prediction's.
        duration_s: time from phase 0 to 1.
        settings: what it is designed for.
    """
    settings = settings or FeedbackSettings()
    times = np.linspace(0.0, duration_s, settings.n_times)
    moments = _moments(basis, weights, times / duration_s, duration_s)
    density = settings.density(len(weights.mean) // basis.n_basis)
    mean, covariance = _controllable(moments, times, density, settings.bandwidth_rad_s)
    return _policy(times, mean, covariance, density)


def initial_state(policy: FeedbackPolicy, rng: np.random.Generator) -> Floats:
    """Draw a state (2 Q,) from the distribution at the start."""
    return rng.multivariate_normal(policy.mean[0], policy.covariance[0], method="eigh")


def propagate(
    policy: FeedbackPolicy, n_steps: int, start: Gaussian | None = None
) -> tuple[Floats, Gaussian]:
    """Mean and covariance of the controlled double integrator at the end of each step.

    Args:
        policy: the controller.
        n_steps: the primitive's duration is cut into so many steps, in each of which the gains
            are those of its middle.
        start: of the state; the policy's own by default.

    Returns:
        Times (n_steps + 1,) and moments: mean (n_steps + 1, 2 Q), covariance (.., 2 Q, 2 Q).
    """
    n = policy.n_joints
    step = policy.times_s[-1] / n_steps
    start = start or Gaussian(policy.mean[0], policy.covariance[0])
    mean, covariance = [start.mean], [start.covariance]
    noise = np.zeros((2 * n, 2 * n))
    noise[n:, n:] = np.diag(policy.disturbance)
    for k in range(n_steps):
        gain, offset = policy.at((k + 0.5) * step)
        flow = np.zeros((2 * n, 2 * n))
        flow[:n, n:], flow[n:] = np.eye(n), gain
        drift = np.concatenate((np.zeros(n), offset))
        mean.append(_runge_kutta(partial(_mean_slope, flow, drift), mean[-1], step))
        following = _runge_kutta(partial(_covariance_slope, flow, noise), covariance[-1], step)
        covariance.append(symmetrize(following))
    times = step * np.arange(n_steps + 1)
    return times, Gaussian(np.array(mean), np.array(covariance))


def _mean_slope(flow: Floats, drift: Floats, mean: Floats) -> Floats:
    return flow @ mean + drift


def _covariance_slope(flow: Floats, noise: Floats, covariance: Floats) -> Floats:
    return flow @ covariance + covariance @ flow.T + noise


def _runge_kutta(slope: Callable[[Floats], Floats], value: Floats, step: float) -> Floats:
    """One classical step of fourth order."""
    k1 = slope(value)
    k2 = slope(value + 0.5 * step * k1)
    k3 = slope(value + 0.5 * step * k2)
    k4 = slope(value + step * k3)
    return value + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def second_derivative_matrix(basis: NormalizedRBFBasis, phase: Floats) -> Floats:
    """d^2 basis / d phase^2 at phases (T,): (T, N); zero outside [0, 1]."""
    values = basis.design_matrix(phase)
    slope = -(np.clip(phase, 0.0, 1.0)[:, None] - basis.centers) / basis.scale**2
    slope -= np.sum(values * slope, axis=1, keepdims=True)
    variance = np.sum(values * slope**2, axis=1, keepdims=True)
    inside = (phase >= 0.0) & (phase <= 1.0)
    return values * (slope**2 - variance) * inside[:, None]


def _moments(
    basis: NormalizedRBFBasis, weights: Gaussian, phase: Floats, duration_s: float
) -> tuple[Floats, Floats]:
    """Mean (T, 3, Q) and covariance (T, 3, Q, 3, Q) of positions, velocities, accelerations."""
    rows = np.stack(
        (
            basis.design_matrix(phase),
            basis.derivative_matrix(phase) / duration_s,
            second_derivative_matrix(basis, phase) / duration_s**2,
        )
    )
    per_joint = weights.mean.reshape(-1, basis.n_basis)
    mean = np.einsum("atn,qn->taq", rows, per_joint)
    blocks = weights.covariance.reshape(per_joint.shape * 2)
    half = np.einsum("atn,qnrm->taqrm", rows, blocks, optimize=True)
    return mean, np.einsum("taqrm,btm->taqbr", half, rows, optimize=True)


def _controllable(
    moments: tuple[Floats, Floats], times_s: Floats, density: Floats, bandwidth_rad_s: float
) -> tuple[Floats, Floats]:
    """The same with the two terms that make the state one that can be controlled."""
    mean, covariance = moments
    covariance = covariance.copy()
    index = np.arange(len(density))
    covariance[:, 0, index, 0, index] += density / (4.0 * bandwidth_rad_s**3)
    position = symmetrize(covariance[:, 0, :, 0, :])
    velocity = _rest_velocity(position, density)
    slope = np.gradient(velocity, times_s, axis=0, edge_order=2)
    covariance[:, 1, :, 1, :] += velocity
    covariance[:, 2, :, 0, :] -= velocity
    covariance[:, 2, :, 1, :] += 0.5 * slope
    return mean, covariance


def _rest_velocity(position: Floats, density: Floats) -> Floats:
    """F = (S/4)^(2/3) C^(1/3) for covariances C (..., Q, Q), in coordinates where S is one."""
    scale = np.sqrt(density)
    values, vectors = np.linalg.eigh(position / np.outer(scale, scale))
    root = np.cbrt(np.maximum(values, 0.0)) * 0.25 ** (2.0 / 3.0)
    found = (vectors * root[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return symmetrize(found) * np.outer(scale, scale)


def _policy(times_s: Floats, mean: Floats, covariance: Floats, density: Floats) -> FeedbackPolicy:
    """Gains from the moments."""
    n = len(density)
    state = symmetrize(covariance[:, :2, :, :2, :].reshape(-1, 2 * n, 2 * n))
    wanted = covariance[:, 2, :, :2, :].reshape(-1, n, 2 * n).copy()
    wanted[:, :, n:] -= 0.5 * np.diag(density)
    gain = np.swapaxes(np.linalg.solve(state, np.swapaxes(wanted, 1, 2)), 1, 2)
    state_mean = mean[:, :2].reshape(-1, 2 * n)
    offset = mean[:, 2] - np.einsum("tij,tj->ti", gain, state_mean)
    stiffness, damping = _rest_gains(symmetrize(covariance[-1, 0, :, 0, :]), density)
    rest = np.hstack((-stiffness, -damping)), stiffness @ mean[-1, 0]
    return FeedbackPolicy(times_s, gain, offset, state_mean, state, density, rest)


def _rest_gains(position: Floats, density: Floats) -> tuple[Floats, Floats]:
    """Stiffness and damping (Q, Q) that hold a distribution of positions (Q, Q) at rest."""
    velocity = _rest_velocity(position, density)
    stiffness = np.linalg.solve(position, velocity).T
    return stiffness, 0.5 * np.linalg.solve(velocity, np.diag(density)).T
