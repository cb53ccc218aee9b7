# SPDX-License-Identifier: Apache-2.0
"""Curves of cubics as a controller follows them, from the definition of Hermite's polynomials."""

import numpy as np


def cubic(x, h, q0, q1, v0, v1):
    """Position, velocity and acceleration at the share x of an interval h."""
    return (
        (2 * x**3 - 3 * x**2 + 1) * q0
        + (x**3 - 2 * x**2 + x) * h * v0
        + (-2 * x**3 + 3 * x**2) * q1
        + (x**3 - x**2) * h * v1,
        6 * (x**2 - x) / h * (q0 - q1) + (3 * x**2 - 4 * x + 1) * v0 + (3 * x**2 - 2 * x) * v1,
        (12 * x - 6) / h**2 * (q0 - q1) + (6 * x - 4) / h * v0 + (6 * x - 2) / h * v1,
    )


def hermite(times_s, q, v, time_s):
    """Position and velocity at a time, at the end from there on."""
    if time_s >= times_s[-1]:
        return q[-1], v[-1]
    i = max(int(np.searchsorted(times_s, time_s, side="right")) - 1, 0)
    h = times_s[i + 1] - times_s[i]
    return cubic((time_s - times_s[i]) / h, h, q[i], q[i + 1], v[i], v[i + 1])[:2]
