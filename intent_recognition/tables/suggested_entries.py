# SPDX-License-Identifier: Apache-2.0
"""Entries of a suggested map, as lines of YAML with comments."""

import re
import unicodedata
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from intent_recognition.array_types import Floats
from intent_recognition.bags import JOINT_STATE, POSE, BagReader, decode
from intent_recognition.demonstrations import FIRST_MESSAGES, is_deleted, is_path
from intent_recognition.errors import BagError
from intent_recognition.signals import POSITION_FIELDS, spelled
from intent_recognition.tables.by_body import naming_key
from intent_recognition.tables.cells import ANGLES, convert, scale_between
from intent_recognition.tables.files import name_pattern
from intent_recognition.tables.table import NO_MOTION, Table

FARTHEST = {"m": 20.0, "rad": 4.0 * np.pi, "skeleton": 3.0}
"""Largest number in the basic unit; larger ones mean another unit [m, rad]: a lab, two turns, and
for a skeleton more than a person from a hand to the other foot."""
LIMBS = 4
"""Least number of ends of a whole person's skeleton: hands, feet, and mostly a head."""
LONGEST_LIMB_M = (0.6, 1.52)
"""Longest chain of bones from a person's hips [m]: of a child to the wrist, of a tall adult to the
fingertips. As an inch is 2.54 cm, a skeleton is of this size in one unit only."""
MOST_SUGGESTED = 8
"""Most bodies in a suggestion, of which a person is asked to delete those not needed."""
JOINT = re.compile(r"(?:.*?[./])?(?P<joint>[^./]*[^./\d][^./]*)(?:[./](?:position|pos|q))?$")
"""Names of columns that contain their joint, as in `/joint_states/panda_joint1/position`."""
ANGLE_END = re.compile(r"(?i)(?<=[^\W_])[\W_]+(?:deg(?:ree)?s?|rad(?:ian)?s?)[\W_]*$")
"""A unit of angles at the end of a name."""
NO_NAME = {"observation", "observations", "obs", "state", "human", "field", "mocap", "pose"}
NO_NAME |= {"position", "pos", "poses", "xyz", "translation", "t", "p"}
"""Words in names of columns that do not name a body."""
OF_ROBOT = re.compile(
    rf"(?i){JOINT_STATE}|(?<![^\W_])(?:robot|gripper|tcp|eef?|flange|tool0|end_?effector)[\d_/]"
)
"""Types and names of topics that hold the robot's movement."""


class SeenColumn(NamedTuple):
    """A column of numbers."""

    name: str
    values: Floats
    moves: bool  # whether the values change
    seen: float  # share of rows with a number
    farthest: float  # largest absolute value


def body_entry(
    table: Table, values: Floats, body: str, names: Sequence[str], farthest: float, file: str = ""
) -> list[str]:
    """Lines of the entry of a body with its columns `values`, named after the body or its file.

    All bodies whose unit is not stated have one: `farthest` is the largest number of any.
    """
    extent = float(np.nanmax(np.nanmax(values, axis=0) - np.nanmin(values, axis=0)))
    unit, note = _unit_of(table, names, farthest, "m")
    if len(names) == 2 and not note.startswith("from"):
        unit, note = "mm", "a pixel counts as one"
    for called in (body, file, "wrist"):
        parts = [part for part in re.split(r"[\W_]+", called.lower()) if part not in NO_NAME]
        if topic := "_".join(filter(None, parts)):
            break
    topic = unicodedata.normalize("NFKD", topic).encode("ascii", "ignore").decode()
    topic = f"body_{topic}" if topic[:1].isdigit() else topic
    topic = f"/mocap/{topic or 'wrist'}/pose  # moves over {extent:.3g} {unit or 'm'}"
    entry = _entry(topic, POSE, "fields", POSITION_FIELDS[: len(names)], "m")
    return entry + _columns(names, unit, note)


def joints_entry(table: Table, joints: Sequence[SeenColumn]) -> list[str]:
    """Lines of the entry of joints."""
    found = [JOINT.fullmatch(joint.name) for joint in joints]
    called = [
        match["joint"] if match else joint.name for match, joint in zip(found, joints, strict=True)
    ]
    if len(set(called)) < len(called) or {*called} & {*"xyzXYZ"}:  # axes of a body
        called = [joint.name for joint in joints]
    bare = [ANGLE_END.sub("", name) for name in called]  # the entry has another unit
    called = bare if len(set(bare)) == len(bare) else called
    names = [re.sub(r"\W+", "_", name).strip("_") for name in called]
    farthest = max(joint.farthest for joint in joints)
    unit, note = _unit_of(table, [joint.name for joint in joints], farthest, "rad")
    topic = "/joint_states  # they move; taken for joints"
    entry = _entry(topic, JOINT_STATE, "joints", names, "rad")
    return entry + _columns([joint.name for joint in joints], unit, note)


def _columns(names: Sequence[str], unit: str, note: str) -> list[str]:
    lines = [f"    columns: {flow(list(names))}", f"    columns_unit: {unit}  # {note}"]
    return lines if unit else lines[:1]


def distinct(entries: Sequence[list[str]]) -> list[list[str]]:
    """Give entries different topics or joints by numbering repeated names."""
    seen: Counter[str] = Counter()
    taken: set[str] = set()
    for entry in entries:
        topic = entry[0].split()[2]
        seen[topic] += 1
        before, _, listed = entry[2].partition("joints: ")
        joints = yaml.safe_load(listed) if listed else []
        if seen[topic] > 1 and topic.endswith("/pose"):
            entry[0] = entry[0].replace(topic, f"{topic.removesuffix('/pose')}_{seen[topic]}/pose")
        elif taken & {*joints}:
            joints = [f"{joint}_{seen[topic]}" for joint in joints]
            entry[2] = f"{before}joints: {flow(joints)}"
        taken |= {*joints}
    return list(entries)


def person_first(entries: Sequence[list[str]]) -> list[list[str]]:
    """Put entries of the robot last: the first entry is suggested as observed."""
    return sorted(entries, key=lambda entry: bool(OF_ROBOT.search(" ".join(entry[:3]))))


def note_on_observed(entries: Sequence[list[str]]) -> list[str]:
    """A comment if no entry, of those with a person first, may be a person's."""
    what = [" ".join(entry[:3]) for entry in entries]
    if all(JOINT_STATE in one for one in what):
        return ["# Note: no places were found, only joints. The first are observed."]
    of_robots = ["# Note: by their names all are of a robot. The first is observed."]
    return of_robots if OF_ROBOT.search(what[0]) else []


def is_angle(table: Table, name: str) -> bool:
    """Whether a column may be an angle, by its unit in the file."""
    return _said(table, name) in ("", *ANGLES)


def is_length(table: Table, name: str) -> bool:
    """Whether a column may be a length, by its unit in the file."""
    unit = _said(table, name)
    return unit not in ANGLES and "/" not in unit and not re.fullmatch(NO_MOTION, unit)


def _said(table: Table, name: str) -> str:
    """The unit of a column in the file, "" for none."""
    return spelled(table.said_of(name))


def _unit_of(table: Table, names: Sequence[str], farthest: float, base: str) -> tuple[str, str]:
    """Unit of columns and its source; "" for the unit of the entry, or for different units."""
    said, *others = {_said(table, name) for name in names}
    if others:
        return "", "from the file"
    if said:
        is_known = said != base and scale_between(said, base) is not None
        return (said if is_known else ""), "from the file"
    is_skeleton = base == "m" and table.reach > 0.0
    for unit in ("m", "cm", "mm", "in", "ft") if is_skeleton and table.limbs >= LIMBS else ():
        limb_m = float(convert(np.array(table.reach), unit, "m"))
        if LONGEST_LIMB_M[0] <= limb_m <= LONGEST_LIMB_M[1]:
            return unit, f"guessed: hands or feet are then up to {limb_m:.2g} m from the hips"
    farthest = table.reach if is_skeleton else farthest
    if farthest <= FARTHEST["skeleton" if is_skeleton else base]:
        is_asked = table.must_say and base == "m"
        return ("m", f"guessed: {farthest:.3g} m is near") if is_asked else ("", "")
    unit = "deg" if base == "rad" else "cm" if farthest <= 100.0 * FARTHEST["skeleton"] else "mm"
    return unit, f"guessed: {farthest:.3g} {base} is too far"


def flow(content: object) -> str:
    """YAML on one line."""
    options: dict[str, Any] = {"default_flow_style": True, "sort_keys": False, "width": 10**6}
    text: str = yaml.safe_dump(content, allow_unicode=True, **options)
    return text.strip().removesuffix("...").strip()


PLACES = ("position", "translation", "point")
"""Last names of paths to positions [m]."""
HAS_PLACES = re.compile(r"(?m)^float(?:32|64) x\b")
"""A definition of a type that may contain positions."""
MOST_DECODED = 4_000_000
"""Bytes of messages of a topic in which positions are looked for: a second for a growing path."""
NUMBERED = re.compile(r"\[\d+\]")
"""A number of an element in a path."""


def suggest_of_bags(source: Path, bags: Sequence[Path]) -> str:
    """Suggest the text of a map that labels recordings by their names."""
    reader = BagReader(bags[0])
    filled = {t.name: t.type for t in reader.topics.values() if t.message_count}
    states = [name for name, kind in filled.items() if kind == JOINT_STATE]
    places = {topic: _places_on(reader, topic) for topic in filled if topic not in states}
    moving = {name for name, of in places.items() if any(of.values())}
    poses = [name for name, of in places.items() if len(of) == 1 and "[" not in "".join(of)]
    if not moving & {*poses}:  # perhaps only a goal
        poses = [name for name, of in places.items() if of and "static" not in name]
    poses.sort(key=lambda name: name not in moving)
    entries = [
        _entry(topic, filled[topic], "fields", [f"{at}.{axis}".lstrip(".") for axis in "xyz"], "m")
        for topic in poses
        for at in places[topic]
    ]
    joints = {topic: [*_joints(reader, topic)] for topic in states}
    entries += [one for of in joints.values() for one in of]
    if not entries:
        got = ", ".join(f"{t.name} ({t.type})" for t in reader.topics.values()) or "no topics"
        cure = "Write the DOF file by hand (docs/bags.md)."
        expected = f"messages with positions, or {JOINT_STATE}"
        raise BagError.about(str(bags[0]), expected, got, cure)
    entries = person_first(entries)
    pattern = name_pattern(source, bags)
    named = f"files: {flow(pattern)}" if "{task}" in pattern else "task: give_it_a_name"
    used = {*poses, *(topic for topic, of in joints.items() if of)}
    others = [topic for topic in reader.topics if topic not in used]
    lines = [
        f"# Suggested from {bags[0].name}: bags of ROS, whose messages stay as they are.",
        "# Delete what is not needed, move what the robot does to `controlled`. Bags that are",
        "# labelled, or shall have no label, need no import: intent train takes them.",
        *([] if reader.custom_data.get("task") else [named]),
        *note_on_observed(entries),
        "observed:",
        *entries[0],
        *(["controlled:"] if entries[1:] else []),
        *(line for entry in entries[1:] for line in entry),
        *([f"# Other topics: {', '.join(others)}"] if others else []),
    ]
    return "\n".join(lines) + "\n"


def _places_on(reader: BagReader, topic: str) -> dict[str, bool]:
    """Paths of the positions in the first messages of a topic, and whether they move; these first.

    Elements without names are left out unless they move, such as the poses of a path that grows.
    """
    definition = reader.definition_of(topic)
    if definition is None or not HAS_PLACES.search(definition.text):
        return {}
    seen: dict[str, set[tuple[float, ...]]] = {}
    count, size = min(reader.topics[topic].message_count, FIRST_MESSAGES), 0
    with suppress(BagError):  # a damaged file, or a definition that cannot be used
        decoder = reader.decoder(topic, reader.topics[topic].type)
        for raw in islice(reader.raw_messages([topic]), count):
            message, size = decode(raw, decoder).message, size + len(raw.data)
            for path, at in _places(message, is_named=raw.type.endswith("/Point")):
                seen.setdefault(path, set()).add(at)
            if size > MOST_DECODED:
                break
    found = {path: len(places) > 1 for path, places in seen.items()}
    found = {path: moves for path, moves in found.items() if moves or not NUMBERED.search(path)}
    return dict(sorted(found.items(), key=lambda one: not one[1])[:MOST_SUGGESTED])


def _places(
    value: Any, path: str = "", is_named: bool = False
) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Positions in a message and their paths; `is_named` for a point, or an element with a name."""
    names = getattr(value, "__slots__", ())
    if {*"xyz"} <= {*names}:
        is_point = type(value).__name__.endswith("Point") and not path.endswith("]")
        if ((path.endswith(PLACES) or is_point) and "origin" not in path) or is_named:  # a map's
            yield path, (value.x, value.y, value.z)
        return
    for name in names:
        part, below = getattr(value, name), f"{path}.{name}".lstrip(".")
        if not isinstance(part, list):
            yield from _places(part, below)
        elif hasattr(part[0] if part else None, "__slots__"):
            key = naming_key([{own: getattr(one, own) for own in one.__slots__} for one in part])
            for k, one in enumerate(part):
                own = f"{below}[{key}={getattr(one, key)}]" if key else ""
                own = f"{below}[{one.ns}/{one.id}]" if not key and hasattr(one, "ns") else own
                if not is_deleted(one):
                    own = own if is_path(own) else f"{below}[{k}]"
                    yield from _places(one, own, bool(key))


def _entry(topic: str, kind: str, key: str, names: Sequence[str], unit: str) -> list[str]:
    what = f"    {key}: {flow(list(names))}"
    what += "  # by its order, which may change" * bool(NUMBERED.search(names[0]))
    return [f"  - topic: {topic}", f"    type: {kind}", what, f"    unit: {unit}"]


def _joints(reader: BagReader, topic: str) -> Iterator[list[str]]:
    """Entries of the joints of each publisher on a topic, by its first messages."""
    messages = [m.message for m in islice(reader.messages([topic]), FIRST_MESSAGES)]
    seen: set[str] = set()
    for names in dict.fromkeys(tuple(m.name) for m in messages if len(m.position)):
        joints = [name for name in names if name.strip() and name not in seen]
        joints = [name for name in joints if joints.count(name) == 1]  # others are not told apart
        seen |= set(joints)
        if joints:
            yield _entry(topic, JOINT_STATE, "joints", joints, "rad")
