# SPDX-License-Identifier: Apache-2.0
"""Quality of service: the profiles of the topic graph, and those of recorded topics."""

from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy

from intent_recognition.bags import TopicInfo, qos_policy

PLAYBACK_DEPTH = 1000
"""Messages that a publisher keeps for slow subscribers in playback: 10 s at 100 Hz."""
LATCHED_TOPICS = (
    "intent/active_person",
    "intent/active_task",
    "intent/next_task",
    "intent/plan",
    "intent/question",
    "intent/sequence",
    "intent/via_points",
    "robot_description",
    "teach/skills",
    "teach/status",
)
SENSOR_TOPICS = ("mocap/", "human/")


def keep_last(depth: int, *, reliable: bool = True, latched: bool = False) -> QoSProfile:
    """Keep last `depth`; best effort unless reliable, transient local if latched."""
    reliability, durability = QoSReliabilityPolicy, QoSDurabilityPolicy
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=reliability.RELIABLE if reliable else reliability.BEST_EFFORT,
        durability=durability.TRANSIENT_LOCAL if latched else durability.VOLATILE,
    )


STATE = keep_last(10)
"""Reliable, keep last 10: `joint_states`, `intent/tasks`; best-effort subscribers match too."""

SENSOR = MEASURED = keep_last(10, reliable=False)
"""Best effort, keep last 10: measured streams (`mocap/*`, `human/*`), where the newest counts most,
and subscriptions to `joint_states`, which reliable publishers match, too."""

COMMAND = keep_last(1)
"""Reliable, keep last 1: trajectories and predictions, where only the newest counts."""

LATCHED = keep_last(1, latched=True)
"""Reliable, transient local: the last value reaches late subscribers (`robot_description`)."""

EACH = 100
"""Depth of a queue that must lose no message: as many as tf2 keeps of /tf."""

TRANSFORMS = keep_last(EACH)
"""Reliable, keep last 100: /tf, as tf2 has it."""

FIXED_TRANSFORMS = keep_last(EACH, latched=True)
"""Reliable, transient local, keep last 100: /tf_static, as tf2 has it."""


def each_of(profile: QoSProfile) -> QoSProfile:
    """The profile with depth `EACH`, for a subscriber that must get every message."""
    reliable = profile.reliability == QoSReliabilityPolicy.RELIABLE
    latched = profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL
    return keep_last(EACH, reliable=reliable, latched=latched)


FEEDBACK = keep_last(EACH)
"""Reliable, keep last 100: every message about an execution (`intent/feedback`)."""


def recorded_profile(info: TopicInfo) -> QoSProfile:
    """Profile that the recorded publishers offered; if not recorded, that usual for the topic."""
    topic = info.name.lstrip("/")
    latched = topic.endswith(LATCHED_TOPICS)
    sensor = any(f"/{part}" in f"/{topic}" for part in SENSOR_TOPICS)
    depth = PLAYBACK_DEPTH
    offered = info.offered_qos_profiles
    if offered:
        latched = all(qos_policy(p, "durability") == "transient_local" for p in offered)
        sensor = any(qos_policy(p, "reliability") == "best_effort" for p in offered)
        depth = max(1, *(int(p.get("depth") or 0) for p in offered)) if latched else depth
    elif latched:
        depth = 1
    return keep_last(depth, reliable=not sensor, latched=latched)
