# SPDX-License-Identifier: Apache-2.0
"""The arm's forward and inverse kinematics and its limits; no simulator."""
