# SPDX-License-Identifier: Apache-2.0
"""PyBullet without its chatter: its import and its worlds write nothing of their own."""

from sim_bridge.physics.bullet import BulletClient, end_world, fix, pybullet, start_world
