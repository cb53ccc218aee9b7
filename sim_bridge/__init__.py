# SPDX-License-Identifier: Apache-2.0
"""Simulation in PyBullet: arms, coworkers, containers with balls, and the scenes they make."""

GRAVITY_M_S2 = 9.81
"""Acceleration of gravity in every simulated world [m/s^2]; the standard value is 9.80665."""
