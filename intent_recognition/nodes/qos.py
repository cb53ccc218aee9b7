# SPDX-License-Identifier: Apache-2.0
"""The four qualities of service of the topic graph; each topic's one stands in the contract."""

from rclpy.qos import (
    QoSDurabilityPolicy,
    QoSHistoryPolicy,
    QoSProfile,
    QoSReliabilityPolicy,
)


def _profile(
    reliability: QoSReliabilityPolicy, durability: QoSDurabilityPolicy, depth: int
) -> QoSProfile:
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=reliability,
        durability=durability,
    )


SENSOR = _profile(QoSReliabilityPolicy.BEST_EFFORT, QoSDurabilityPolicy.VOLATILE, 10)
"""Best effort, keep last 10: measured streams (`mocap/*`, `human/*`), newest matters most."""

STATE = _profile(QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.VOLATILE, 10)
"""Reliable, keep last 10: `joint_states`, `intent/tasks`; best-effort subscribers match too."""

COMMAND = _profile(QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.VOLATILE, 1)
"""Reliable, keep last 1: trajectories and predictions, where only the newest counts."""

LATCHED = _profile(QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.TRANSIENT_LOCAL, 1)
"""Reliable, transient local: the last value reaches late subscribers (`robot_description`)."""
