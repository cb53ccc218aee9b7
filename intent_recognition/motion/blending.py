# SPDX-License-Identifier: Apache-2.0
"""Quintic polynomials: an offset that decays to zero, and moves from a moving start to rest."""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats

# Quintics in tau = t / T, as coefficients of tau^0 .. tau^5, that start with one unit of position,
# velocity (times T) or acceleration (times T^2), one per row, and end with all three at zero.
_BASIS = np.array(
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
    ]
)
_POWERS = np.arange(6)
_FIRST = _BASIS[:, 1:] * _POWERS[1:]
_SECOND = _FIRST[:, 1:] * _POWERS[1:5]


def _tables(tau: Floats) -> tuple[Floats, Floats, Floats]:
    """Basis and its first and second derivative at tau (T,), each (3, T)."""
    powers = tau[None, :] ** _POWERS[:, None]
    return _BASIS @ powers, _FIRST @ powers[:5], _SECOND @ powers[:4]


_SEARCH = _tables(np.linspace(0.0, 1.0, 25))


class Offset(NamedTuple):
    """A difference that decays to zero within `duration_s`, with continuous acceleration.

    `position`, `velocity`, `acceleration` are its values at time 0, each (n,).
    """

    position: Floats
    velocity: Floats
    acceleration: Floats
    duration_s: float

    def sample(self, times_s: Floats) -> tuple[Floats, Floats]:
        """Position and velocity at times_s (T,), each (T, n); zero from duration_s on."""
        span = self.duration_s
        tau = np.minimum(np.asarray(times_s) / span, 1.0)
        position, velocity, _ = _tables(tau)
        start = np.stack([self.position, self.velocity * span, self.acceleration * span**2])
        q, v = position.T @ start, velocity.T @ start / span
        q[tau >= 1.0] = 0.0
        v[tau >= 1.0] = 0.0
        return q, v

    def largest(self) -> tuple[Floats, Floats]:
        """Largest speed and acceleration of each joint, each (n,), on a grid of 25 samples."""
        speed, acceleration = _largest(
            self.position, self.velocity, self.acceleration, np.array([self.duration_s])
        )
        return speed[0], acceleration[0]


def _largest(
    position: Floats, velocity: Floats, acceleration: Floats, durations_s: Floats
) -> tuple[Floats, Floats]:
    """Largest speed and acceleration (M, n) for each of the durations (M,)."""
    span = durations_s[:, None]
    placed = np.broadcast_to(position, (len(durations_s), len(position)))
    start = np.stack([placed, velocity * span, acceleration * span**2], axis=1)
    _, first, second = _SEARCH
    speed = np.abs(first.T @ start).max(axis=1) / span
    return speed, np.abs(second.T @ start).max(axis=1) / span**2


def decay(
    position: Floats,
    velocity: Floats,
    acceleration: Floats,
    *,
    max_velocity: Floats,
    max_acceleration: Floats,
    shortest_s: float,
) -> Offset:
    """The quickest decay of an offset (n,) within the largest velocity and acceleration per joint.

    A start velocity above `max_velocity` may decay from its value. If no duration from `shortest_s`
    on keeps the bounds, the offset starts without acceleration: the sum of motions then jumps in
    acceleration, by a bounded amount, never in position or velocity. If that is not enough, the
    longest duration is used.
    """
    durations = np.geomspace(shortest_s, max(8.0, 4.0 * shortest_s), 28)
    speed_bound = np.maximum(max_velocity, np.abs(velocity)) * (1.0 + 1e-9)
    acceleration = np.clip(acceleration, -0.5 * max_acceleration, 0.5 * max_acceleration)
    for start in (acceleration, np.zeros_like(acceleration)):
        speed, sharpness = _largest(position, velocity, start, durations)
        fits = np.all((speed <= speed_bound) & (sharpness <= max_acceleration), axis=1)
        if fits.any():
            return Offset(position, velocity, start, float(durations[np.argmax(fits)]))
    return Offset(position, velocity, np.zeros_like(acceleration), float(durations[-1]))
