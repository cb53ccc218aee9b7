# SPDX-License-Identifier: Apache-2.0
"""A first map of recordings of ROS, by the topics of the first one."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from intent_recognition.bags import JOINT_STATE, POSE, BagReader
from intent_recognition.errors import BagError
from intent_recognition.tables.file_kinds import name_pattern
from intent_recognition.tables.suggested_entries import flow

PLACES = {
    POSE: "pose.position",
    "geometry_msgs/msg/TransformStamped": "transform.translation",
    "nav_msgs/msg/Odometry": "pose.pose.position",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose.position",
    "geometry_msgs/msg/PointStamped": "point",
    "geometry_msgs/msg/Pose": "position",
}
"""Types of messages that hold the place of one body [m], and where."""


def suggest_of_bags(source: Path, bags: Sequence[Path]) -> str:
    """The text of a map that labels recordings by their names."""
    reader = BagReader(bags[0])
    filled = {t.name: t.type for t in reader.topics.values() if t.message_count}
    poses = [name for name, kind in filled.items() if kind in PLACES]
    states = [name for name, kind in filled.items() if kind == JOINT_STATE]
    entries = [_place(topic, filled[topic]) for topic in poses]
    entries += [_joints(reader, topic) for topic in states]
    if not entries:
        got = ", ".join(f"{t.name} ({t.type})" for t in reader.topics.values()) or "no topics"
        cure = "Write the DOF file by hand (docs/bags.md)."
        expected = f"{', '.join(PLACES)} or {JOINT_STATE}"
        raise BagError.about(str(bags[0]), expected, got, cure)
    pattern = name_pattern(source, bags)
    others = [t.name for t in reader.topics.values() if t.name not in (*poses, *states)]
    lines = [
        f"# Suggested from {bags[0].name}: bags of ROS, whose messages stay as they are.",
        "# Delete what is not needed, move what the robot does to `controlled`. Bags that are",
        "# labelled, or shall have no label, need no import: intent train takes them.",
        f"files: {flow(pattern)}" if "{task}" in pattern else "task: give_it_a_name",
        "observed:",
        *entries[0],
        *(["controlled:"] if entries[1:] else []),
        *(line for entry in entries[1:] for line in entry),
        *([f"# Other topics: {', '.join(others)}"] if others else []),
    ]
    return "\n".join(lines) + "\n"


def _place(topic: str, kind: str) -> list[str]:
    fields = [f"{PLACES[kind]}.{axis}" for axis in "xyz"]
    return [*_head(topic, kind), f"    fields: {flow(fields)}", "    unit: m"]


def _joints(reader: BagReader, topic: str) -> list[str]:
    names = next(iter(reader.messages([topic]))).message.name
    return [*_head(topic, JOINT_STATE), f"    joints: {flow(list(names))}", "    unit: rad"]


def _head(topic: str, kind: str) -> Iterator[str]:
    yield f"  - topic: {topic}"
    yield f"    type: {kind}"
