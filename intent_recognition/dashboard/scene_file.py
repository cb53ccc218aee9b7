# SPDX-License-Identifier: Apache-2.0
"""Reads the contents of a cell from a YAML file: furniture, bodies that are handed over, people.

The page knows the cell only from this file and the topics. docs/dashboard.md lists the keys.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import msgspec
import numpy as np
from msgspec import Meta, Struct
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.checks import MOST_NAMES
from intent_recognition.dashboard.figure import Stance
from intent_recognition.errors import ArgumentError, one_line
from intent_recognition.share import share_path
from intent_recognition.signals import homogeneous
from intent_recognition.untrusted import UntrustedError, load_yaml, read_text

LARGEST_M = 100.0
"""Farthest position and longest edge [m]; larger values are mistakes in the unit."""
Coordinate = Annotated[float, Meta(ge=-LARGEST_M, le=LARGEST_M)]
Size = Annotated[float, Meta(gt=0.0, le=LARGEST_M)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
SHIPPED = "config/scenes"
GREY = "#9aa5b1"
ROBOT, PERSON = "robot", "person"
T = TypeVar("T")


class Placed(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, dict=True):
    """A pose in the file: xyz [m], and rpy [rad] about the fixed axes x, y and z."""

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)

    @cached_property
    def pose(self) -> Floats:
        """Pose (4, 4) with the conventions of a URDF."""
        return homogeneous(Rotation.from_euler("xyz", self.rpy).as_matrix(), self.xyz)


class ScenePart(Placed, frozen=True):
    """A coloured shape, placed in its thing's frame; a cylinder lies along z."""

    box: tuple[Size, Size, Size] | None = None  # edge lengths [m]
    cylinder: tuple[Size, Size] | None = None  # radius and length [m]
    sphere: Size | None = None  # radius [m]; exactly one of the three shapes is given
    # #rrggbb; if empty, the colour of the thing's task
    colour: Annotated[str, Meta(pattern=r"^#[0-9a-fA-F]{6}\Z")] = ""

    def __post_init__(self) -> None:
        if sum(shape is not None for shape in (self.box, self.cylinder, self.sphere)) != 1:
            raise ValueError("Expected one of box, cylinder, sphere")


class Thing(Placed, frozen=True):
    """A fixed thing, placed in the world."""

    name: Annotated[str, Meta(pattern=r"^\w+\Z")]  # one word, unique in the scene
    parts: Annotated[tuple[ScenePart, ...], Meta(min_length=1, max_length=MOST_NAMES)]


class Body(Thing, frozen=True):
    """A thing that is handed over in a task; `pose` is its place before.

    Attributes:
        brought_by: `robot` if the robot fetches it for the person, `person` for the reverse.
        grasp: position of the robot's hand when it grasps the body in its place [m], world.
        in_hand: centre relative to the wrist of the person who brings it [m], world axes.
        laid: position where a person puts it down [m], world; None: back in its place.
    """

    task: Annotated[str, Meta(min_length=1)]
    brought_by: Literal["robot", "person"] = "robot"
    grasp: Vector | None = None
    in_hand: Vector | None = None
    laid: Vector | None = None

    def __post_init__(self) -> None:
        needed = "grasp" if self.brought_by == ROBOT else "in_hand"
        if getattr(self, needed) is None:
            raise ValueError(f"Expected {needed}: x, y, z of what the {self.brought_by} brings")


@dataclass(frozen=True)
class CellScene:
    """Contents of a scene file."""

    floor_m: float = 0.0  # height of the floor in the world
    person: Stance | None = None  # stance of the only person; None: no figure is drawn
    furniture: tuple[Thing, ...] = ()  # things that never move
    bodies: tuple[Body, ...] = ()  # things that are handed over
    # initial position and target of the camera, (3,) [m] each
    view: tuple[Vector, Vector] = ((1.72, -1.38, 1.05), (0.48, 0.0, 0.33))
    people: Mapping[str, Stance] = field(default_factory=dict)  # stances of named people


class _Person(Struct, forbid_unknown_fields=True):
    stands: tuple[Coordinate, Coordinate]
    faces: Coordinate = 0.0
    height: Annotated[float, Meta(ge=0.5, le=2.5)] = 1.75
    hand: Literal["left", "right"] = "right"

    def stance(self, floor_m: float) -> Stance:
        return Stance(
            np.array([*self.stands, floor_m]), self.faces, self.height, self.hand == "left"
        )


class _SceneFile(Struct, forbid_unknown_fields=True):
    floor: Coordinate = 0.0
    person: _Person | None = None
    people: dict[str, object] = {}  # each a `_Person`, checked singly: errors then name the key
    furniture: Annotated[tuple[Thing, ...], Meta(max_length=MOST_NAMES)] = ()
    bodies: Annotated[tuple[Body, ...], Meta(max_length=MOST_NAMES)] = ()
    view: tuple[Vector, Vector] = CellScene.view

    def __post_init__(self) -> None:
        names = [thing.name for thing in (*self.furniture, *self.bodies)]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"Expected names that differ, got {twice[0]} twice")


def load_scene(path: str | Path) -> CellScene:
    """Read a scene from a YAML file, or a shipped scene by name, such as `toolbox`.

    Raises:
        ArgumentError: the file is missing, not YAML or malformed; names the place in the file.
    """
    source = _source(path)
    found = _checked(_content(source), _SceneFile, source)
    people = {
        name: _checked(said, _Person, source, f"people.{name}")
        for name, said in found.people.items()
    }
    floor_m = found.floor
    return CellScene(
        floor_m,
        None if found.person is None else found.person.stance(floor_m),
        found.furniture,
        found.bodies,
        found.view,
        {name: person.stance(floor_m) for name, person in people.items()},
    )


def _checked(content: object, kind: type[T], source: Path, within: str = "") -> T:
    """Convert a part of the file; errors name the place in the file."""
    try:
        return msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        what, _, place = one_line(error).replace("`", "").partition(" - at ")
        place = (within + place.removeprefix("$")).removeprefix(".")
        where = f"{source}: {place}".removesuffix(": ")
        raise ArgumentError(f"{where}: {what}. See docs/dashboard.md.") from error


def _source(path: str | Path) -> Path:
    """The file at a path, or of a shipped scene by name."""
    source = Path(path)
    if source.name == str(path) and not source.suffix and not source.exists():
        names = [found.stem for found in sorted(share_path(SHIPPED).glob("*.yaml"))]
        if source.name not in names:
            expected = f"a YAML file, or one of {', '.join(names)}"
            raise ArgumentError.about("scene", expected, path, "Name one.")
        source = share_path(f"{SHIPPED}/{source.name}.yaml")
    return source


def _content(source: Path) -> object:
    """Content of a file, merged into the scene that its key `like` names, if any."""
    content = _yaml(source)
    if not isinstance(content, dict) or "like" not in content:
        return content
    like = content.pop("like")
    base = _yaml(_source(like)) if isinstance(like, str) else None
    if not isinstance(base, dict):
        raise ArgumentError.about(f"{source}: like", "a scene", like, "See docs/dashboard.md.")
    for key in ("furniture", "bodies"):
        both = base.get(key, []), content.get(key, [])
        if all(isinstance(things, list) for things in both):
            content[key] = [*both[0], *both[1]]
    return {**base, **content}


def _yaml(source: Path) -> object:
    try:
        return load_yaml(read_text(source))
    except (OSError, UntrustedError) as error:
        cure = "See docs/dashboard.md."
        raise ArgumentError.about(str(source), "a scene in YAML", error, cure) from error
