# SPDX-License-Identifier: Apache-2.0
"""Read the DOF file, which selects the degrees of freedom of human and robot from topics."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from intent_recognition.bags import JOINT_STATE, POSE
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.paths import MOST_ELEMENTS, is_path
from intent_recognition.errors import ArgumentError, DofError, as_path, number
from intent_recognition.share import share_path
from intent_recognition.signals import (
    ORIENTATION_FIELDS,
    POSITION_FIELDS,
    SPATIAL_UNITS,
    UNITS,
    spelled,
)
from intent_recognition.tracking import Extrinsics, parse_extrinsics
from intent_recognition.untrusted import UntrustedError, load_yaml, read_text

DEFAULT = "config/dofs.yaml"
"""The shipped DOF file."""
QUANTITIES = ("position", "velocity", "effort")
VELOCITY_KEYS = ("topic", "type", "fields", "joints", "unit", "quantity", "of", "std")
KEYS = (*VELOCITY_KEYS[:6], "orientation", "reference")
QUATERNION = "quaternion"
"""The only supported representation of an orientation in an entry."""
OBSERVED_KEYS = (*KEYS, "context")
CONTROLLED_KEYS = (*KEYS, "link", "robot")
SIDES = ("observed", "controlled", "velocities")
EXTRINSICS = "extrinsics"
"""Top-level key for the poses of tracker frames in the world."""
RAW_POSE_TOPIC = re.compile(r"(.*/)?mocap/[^/]+/pose")
TYPE_NAME = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*")


@dataclass(frozen=True)
class DofSpec:
    """Observed (human) and controlled (robot) degrees of freedom, in the order of the model.

    Attributes:
        observed: entries of the human, at least one.
        controlled: entries of the robot; may be empty.
        velocities: entries for velocities of observed DOFs, measured independently of their
            positions. They are observed online; training does not need them.
        context: observed entries with `context: true`, which describe the scene.
        extrinsics: pose of each tracker frame in the world, 'frame x y z qx qy qz qw' [m,
            quaternion], by which recorded raw poses are transformed; None to use the frame of each
            recording as the world.
    """

    observed: tuple[DofEntry, ...]
    controlled: tuple[DofEntry, ...]
    velocities: tuple[DofEntry, ...] = ()
    context: tuple[DofEntry, ...] = ()
    extrinsics: tuple[str, ...] | None = None

    @property
    def tracker_frames(self) -> Extrinsics | None:
        """The extrinsics as numbers, in the form that `read_demonstrations` expects."""
        return None if self.extrinsics is None else parse_extrinsics(self.extrinsics)

    @property
    def recorded(self) -> tuple[DofEntry, ...]:
        """All entries that training needs: observed, controlled, then context."""
        return (*self.observed, *self.controlled, *self.context)

    @property
    def observed_names(self) -> tuple[str, ...]:
        """Names of all observed DOFs, entry by entry."""
        return tuple(name for entry in self.observed for name in entry.names)

    @property
    def controlled_names(self) -> tuple[str, ...]:
        """Names of all controlled DOFs, entry by entry."""
        return tuple(name for entry in self.controlled for name in entry.names)

    @property
    def context_names(self) -> tuple[str, ...]:
        """Names of all context DOFs, entry by entry."""
        return tuple(name for entry in self.context for name in entry.names)

    @property
    def controlled_message_names(self) -> tuple[str, ...]:
        """Names of the controlled agent's numbers as in messages, entry by entry."""
        return tuple(name for entry in self.controlled for name in entry.message_names)

    def signal_of(self, velocity: DofEntry) -> tuple[int, tuple[int, ...]] | None:
        """Indices of the observed entry with a velocity's DOFs and of their columns; or None."""
        for group, entry in enumerate(self.observed):
            if set(velocity.of) <= set(entry.names):
                return group, tuple(entry.names.index(name) for name in velocity.of)
        return None

    @property
    def topics(self) -> dict[str, str]:
        """Type of every topic that training needs, by topic name without leading slash."""
        return {entry.topic: entry.type for entry in self.recorded}

    @property
    def streams(self) -> dict[str, DofEntry]:
        """The first entry of every stream that training needs, see `DofEntry.stream`."""
        return {entry.stream: entry for entry in reversed(self.recorded)}

    def to_dict(self) -> dict[str, list]:
        """Convert to plain lists and dictionaries, as in the DOF file and the model file."""
        sides: dict[str, list] = {
            side: [entry.to_dict() for entry in getattr(self, side)] for side in SIDES
        }
        sides["observed"] += [entry.to_dict() for entry in self.context]
        if not self.velocities:
            del sides["velocities"]
        if self.extrinsics is not None:
            sides[EXTRINSICS] = list(self.extrinsics)
        return sides

    @classmethod
    def from_dict(cls, content: object, source: str = "dofs") -> DofSpec:
        """Check the content of a DOF file or of `to_dict`; `source` names it in errors.

        Raises:
            DofError: anything is missing, unknown, repeated or of the wrong type.
        """
        if not isinstance(content, Mapping):
            raise _error(source, "a mapping with the keys observed and controlled", content)
        keys = (*SIDES, EXTRINSICS)
        if unknown := sorted(set(map(str, content)) - set(keys)):
            raise _error(source, f"only the keys {', '.join(keys)}", ", ".join(unknown))
        observed = _entries(content, "observed", source, minimum=1)
        spec = cls(
            tuple(entry for entry in observed if not entry.context),
            _entries(content, "controlled", source, minimum=0),
            _entries(content, "velocities", source, minimum=0),
            tuple(entry for entry in observed if entry.context),
            _extrinsics(content, f"{source}: {EXTRINSICS}"),
        )
        if not spec.observed:
            raise _error(f"{source}: observed", "an entry of the human", "context alone")
        _check_consistent(spec, source)
        _check_velocities(spec, source)
        _check_hands(spec, source)
        return spec


def load_dofs(path: str | Path | None = None) -> DofSpec:
    """Read a DOF file (see docs/bags.md), by default the shipped config/dofs.yaml.

    Raises:
        DofError: names file, entry and key, if the file is missing, not YAML or malformed.
    """
    source = share_path(DEFAULT) if path is None else as_path("path", path)
    try:
        text = read_text(source)
    except (OSError, UntrustedError) as error:
        cure = f"Check the path; {share_path(DEFAULT)} is an example."
        raise _error(str(source), "a readable DOF file", error, cure) from error
    try:
        content = load_yaml(text)
    except UntrustedError as error:
        raise _error(str(source), "YAML", error) from error
    spec = DofSpec.from_dict(content, str(source))
    beside = [replace(e, robot=_beside(source, e.robot)) for e in spec.controlled]
    return replace(spec, controlled=tuple(beside))


def _beside(source: Path, robot: str) -> str:
    """Absolute path of a URDF relative to a DOF file that is not shipped, else `robot` as it is."""
    path = (source.parent / robot).resolve()
    shipped = path.is_relative_to(share_path(DEFAULT).resolve().parent)
    return str(path) if robot and path.is_file() and not shipped else robot


def robot_path(robot: str) -> Path:
    """Path of the URDF that a DOF file's `robot` names."""
    return Path(robot) if Path(robot).is_file() else share_path(DEFAULT).parent / robot


def relative_topic(topic: str) -> str:
    """The topic name without leading slash, the form in which this package compares names."""
    return topic.lstrip("/")


def is_raw_pose(topic: str, type_name: str) -> bool:
    """Whether a topic carries unchecked tracker poses, `mocap/<body>/pose`."""
    return type_name == POSE and RAW_POSE_TOPIC.fullmatch(relative_topic(topic)) is not None


def _entries(content: Mapping, side: str, source: str, minimum: int) -> tuple[DofEntry, ...]:
    listed = content.get(side)
    if listed is None and minimum == 0:
        return ()
    if not isinstance(listed, list) or len(listed) < minimum:
        raise _error(f"{source}: {side}", f"a list of at least {minimum} entries", listed)
    keys = dict(zip(SIDES, (OBSERVED_KEYS, CONTROLLED_KEYS, VELOCITY_KEYS), strict=True))[side]
    return tuple(_entry(item, f"{source}: {side}[{i}]", keys) for i, item in enumerate(listed))


def _extrinsics(content: Mapping, place: str) -> tuple[str, ...] | None:
    listed = content.get(EXTRINSICS)
    if listed is None:
        return None
    if not isinstance(listed, list):
        raise _error(place, "a list of texts 'frame x y z qx qy qz qw'", listed)
    for k, text in enumerate(listed):
        if not isinstance(text, str):
            raise _error(f"{place}[{k}]", "a text 'frame x y z qx qy qz qw'", text)
    try:
        parse_extrinsics(listed, place)
    except ArgumentError as error:
        raise DofError(str(error)) from error
    return tuple(listed)


def _entry(item: object, place: str, keys: Sequence[str]) -> DofEntry:
    if not isinstance(item, Mapping):
        raise _error(place, "a mapping with topic, type, fields or joints, and unit", item)
    if unknown := sorted(set(map(str, item)) - set(keys)):
        raise _error(place, f"only the keys {', '.join(keys)}", ", ".join(unknown))
    texts = {key: _text(item, key, place) for key in ("topic", "type", "unit")}
    if (unit := spelled(texts["unit"])) != texts["unit"]:  # it would count as another unit
        raise _error(f"{place}: unit", f"{unit}, the only spelling", texts["unit"])
    if not TYPE_NAME.fullmatch(texts["type"]):
        raise _error(f"{place}: type", "package/msg/Name", texts["type"])
    if not relative_topic(texts["topic"]):
        raise _error(f"{place}: topic", "a topic name", texts["topic"])
    if ("fields" in item) == ("joints" in item):
        raise _error(place, "either fields or joints", "both" if "fields" in item else "neither")
    if "joints" in item and texts["type"] != JOINT_STATE:
        raise _error(f"{place}: joints", f"type {JOINT_STATE}", texts["type"])
    if is_raw_pose(texts["topic"], texts["type"]) and unit in UNITS and unit not in SPATIAL_UNITS:
        cure = "Publish metres; tables in another unit take columns_unit in a map."
        raise _error(f"{place}: unit", "m, in which raw poses are checked", unit, cure)
    quantity = item.get("quantity", "position")
    if quantity not in QUANTITIES or (quantity != "position" and "joints" not in item):
        raise _error(f"{place}: quantity", f"{', '.join(QUANTITIES)}, with joints", quantity)
    is_velocity = "of" in keys
    link, robot = (_text(item, key, place) if key in item else "" for key in ("link", "robot"))
    fields = {"m": [*POSITION_FIELDS], "rad": [*ORIENTATION_FIELDS]}
    if link and (texts["type"], item.get("fields")) != (POSE, fields.get(texts["unit"])):
        expected = f"type {POSE}, unit m and the fields {', '.join(POSITION_FIELDS)}"
        got = f"{texts['type']}, {item.get('fields')} in {texts['unit']}"
        raise _error(f"{place}: link", f"{expected}; or its quaternion in rad", got)
    if robot and not link and "joints" not in item:
        raise _error(f"{place}: robot", "a link or joints of it", "neither")
    found = DofEntry(
        relative_topic(texts["topic"]),
        texts["type"],
        fields=_names(item, "fields", place) if "fields" in item else (),
        joints=_names(item, "joints", place) if "joints" in item else (),
        unit=texts["unit"],
        quantity=quantity,
        orientation=item.get("orientation", ""),
        reference=_reference(item, place),
        of=_names(item, "of", place) if is_velocity else (),
        std=_std(item, place) if is_velocity else None,
        link=link,
        robot=robot,
        context=item.get("context", False),
    )
    if not isinstance(found.context, bool):
        raise _error(f"{place}: context", "true or false", found.context)
    _check_orientation(found, item, place)
    return found


def _check_orientation(entry: DofEntry, item: Mapping, place: str) -> None:
    """Check that an orientation has the four fields of one quaternion and the unit rad."""
    if "orientation" not in item:
        if entry.reference:
            raise _error(f"{place}: reference", "orientation: quaternion with it", "none")
        return
    if entry.orientation != QUATERNION:
        raise _error(f"{place}: orientation", QUATERNION, entry.orientation)
    stem = entry.fields[0].rpartition(".")[0] if entry.fields else ""
    expected = tuple(f"{stem}.{axis}" for axis in "xyzw")
    if entry.fields != expected:
        got = ", ".join(entry.fields or entry.joints)
        shape = "the fields x, y, z, w of one quaternion in this order, and no others"
        raise _error(f"{place}: fields", shape, got)
    if entry.unit != "rad":
        raise _error(f"{place}: unit", "rad, of rotation vectors", entry.unit)


def _reference(item: Mapping, place: str) -> tuple[float, ...]:
    """The reference of an entry, a unit quaternion (4,) xyzw; empty if it has none."""
    if "reference" not in item:
        return ()
    given = item["reference"]
    try:
        quaternion = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        quaternion = np.empty(0)
    norm = float(np.linalg.norm(quaternion))
    if quaternion.shape != (4,) or not abs(norm - 1.0) < 1e-3:
        raise _error(f"{place}: reference", "a unit quaternion [x, y, z, w]", given)
    return tuple(quaternion.tolist())


def _text(item: Mapping, key: str, place: str) -> str:
    value = item.get(key)
    if not isinstance(value, str) or not value:
        raise _error(f"{place}: {key}", "a text", "nothing" if key not in item else value)
    return value


def _std(item: Mapping, place: str) -> float | None:
    std = item.get("std")
    if std is not None and not 0.0 < number(std) < np.inf:
        raise _error(f"{place}: std", "a positive number", std)
    return None if std is None else float(std)


def _names(item: Mapping, key: str, place: str) -> tuple[str, ...]:
    names = item.get(key)
    if not isinstance(names, list) or not names:
        raise _error(f"{place}: {key}", "a list of names", names)
    for name in names:
        if not isinstance(name, str) or not name:
            raise _error(f"{place}: {key}", "names", name)
        if key == "fields" and not is_path(name):
            example = "pose.position.x or poses[7].position.x"
            expected = f"paths such as {example}, with elements below {MOST_ELEMENTS}"
            raise _error(f"{place}: {key}", expected, name)
    return tuple(names)


def _check_consistent(spec: DofSpec, source: str) -> None:
    names = [name for entry in spec.recorded for name in entry.names]
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise _error(source, "every degree of freedom once", f"twice {', '.join(doubled)}")
    for entry in spec.recorded:
        if spec.topics[entry.topic] != entry.type:
            both = f"{entry.type} and {spec.topics[entry.topic]}"
            raise _error(f"{source}: {entry.topic}", "one type per topic", both)


def _check_velocities(spec: DofSpec, source: str) -> None:
    """Check that each velocity belongs to one DOF and is not computed from observed poses."""
    tracked = {entry.topic for entry in spec.observed}
    for k, entry in enumerate(spec.velocities):
        place, cure = f"{source}: velocities[{k}]", "Correct the file; docs/bags.md shows one."
        if len(entry.of) != len(entry.names) or len(set(entry.of)) != len(entry.of):
            expected = f"{len(entry.names)} different names, one for each field or joint"
            raise _error(f"{place}: of", expected, ", ".join(entry.of), cure)
        if spec.signal_of(entry) is None:
            raise _error(f"{place}: of", "DOFs of one observed entry", ", ".join(entry.of), cure)
        *before, kind, body = ["", *entry.topic.split("/")]
        if kind == "human" and "/".join([*before[1:], "mocap", body, "pose"]) in tracked:
            got = f"{entry.topic}, differentiated from the same poses"
            raise _error(f"{place}: topic", "velocities measured independently", got, cure)


def _check_hands(spec: DofSpec, source: str) -> None:
    """Check that the orientation of a hand comes right after its position."""
    before: tuple[str, ...] = ()
    for k, entry in enumerate(spec.controlled):
        same = (entry.topic, entry.link, entry.robot)
        if entry.link and entry.orientation and same != before:
            expected = "the position before it, of the same topic, link and robot"
            raise _error(f"{source}: controlled[{k}]", expected, ", ".join(before) or "none")
        before = same if entry.link and not entry.orientation else ()


def _error(argument: str, expected: str, got: object, cure: str = "") -> DofError:
    example = f"Correct the file; {share_path(DEFAULT)} is an example."
    return DofError.about(argument, expected, got, cure or example)
