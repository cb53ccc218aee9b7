# SPDX-License-Identifier: Apache-2.0
"""PyBullet without messages on the standard streams from its import or its worlds."""

from sim_bridge.physics.bullet import BulletClient, end_world, fix, pybullet, start_world
