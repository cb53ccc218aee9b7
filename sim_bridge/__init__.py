# SPDX-License-Identifier: Apache-2.0
"""The physical side: PyBullet LWR arm, simulated coworker, demonstrations."""

GRAVITY_M_S2 = 9.81
"""Acceleration of free fall in every simulated world [m/s^2]. Convention: standard gravity is
9.80665."""
