# SPDX-License-Identifier: Apache-2.0
"""What stands in a cell, from a YAML file: furniture, bodies that are handed over, and the person.

A page knows no more of a cell than this file and the topics say. docs/dashboard.md has the keys.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from intent_recognition.dashboard.figure import Stance
from intent_recognition.errors import ArgumentError
from intent_recognition.share import share_path
from intent_recognition.untrusted import UntrustedError, load_yaml, read_text

SHAPES = {"box": "edges along x, y and z", "cylinder": "radius and length", "sphere": "radius"}
"""Shapes of parts, and what their numbers are [m]."""
N_NUMBERS: dict[str, tuple[int, ...]] = {"box": (3,), "cylinder": (2,), "sphere": ()}
MOST_THINGS = 100
"""Things of a scene, and parts of each. Convention."""
LARGEST_M = 100.0
"""Farthest place and longest edge [m]. Convention: a mistake in the unit is farther."""
SHIPPED = "config/scenes"
VIEW = ((1.72, -1.38, 1.05), (0.48, 0.0, 0.33))
"""Where the camera is, and what it looks at, of an arm at the origin [m]. Convention."""
GREY = "#9aa5b1"
ROBOT, PERSON = "robot", "person"


@dataclass(frozen=True)
class ScenePart:
    """A shape with a colour.

    Attributes:
        shape: one of `SHAPES`.
        size: its numbers [m].
        pose: of its middle in the frame of the thing (4, 4); a cylinder lies along z.
        colour: #rrggbb; empty: that of the thing's task.
    """

    shape: str
    size: tuple[float, ...]
    pose: NDArray[np.float64]
    colour: str


@dataclass(frozen=True)
class Thing:
    """Something that stays where it is.

    Attributes:
        name: one word, unique in the scene.
        pose: in the world (4, 4).
        parts: what it is made of.
    """

    name: str
    pose: NDArray[np.float64]
    parts: tuple[ScenePart, ...]


@dataclass(frozen=True)
class Body(Thing):
    """Something that is taken and given in a task, and whose place is `pose` before.

    Attributes:
        task: label.
        brought_by: `robot` fetches it for the person, or `person` for the robot.
        grasp: where the robot's hand is when it takes it from its place (3,) [m], world.
        in_hand: its middle from the wrist of a person who brings it (3,) [m], world axes.
        laid: where a person puts it down (3,) [m], world; None: back to its place.
    """

    task: str = ""
    brought_by: str = ROBOT
    grasp: NDArray[np.float64] | None = None
    in_hand: NDArray[np.float64] | None = None
    laid: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class CellScene:
    """All that the file says.

    Attributes:
        floor_m: height of the floor in the world.
        person: where the only person stands; None: no figure is drawn.
        people: where others stand, by name.
        furniture: what never moves.
        bodies: what is taken and given.
        view: where the camera is at first, and what it looks at, (3,) [m] each.
    """

    floor_m: float = 0.0
    person: Stance | None = None
    furniture: tuple[Thing, ...] = ()
    bodies: tuple[Body, ...] = ()
    view: Sequence[Sequence[float]] = VIEW
    people: Mapping[str, Stance] = field(default_factory=dict)


def load_scene(path: str | Path) -> CellScene:
    """Read a scene.

    Args:
        path: of a YAML file, or the name of a shipped one, such as `toolbox`.

    Raises:
        ArgumentError: it is missing, no YAML or malformed; names the place in the file.
    """
    source = _source(path)
    return _scene(_content(source), str(source))


def _source(path: str | Path) -> Path:
    """The file of a path, or of a shipped scene's name."""
    source = Path(path)
    if source.name == str(path) and not source.suffix and not source.exists():
        names = [found.stem for found in sorted(share_path(SHIPPED).glob("*.yaml"))]
        if source.name not in names:
            expected = f"a YAML file, or one of {', '.join(names)}"
            raise ArgumentError.about("scene", expected, path, "Name one.")
        source = share_path(f"{SHIPPED}/{source.name}.yaml")
    return source


def _content(source: Path) -> object:
    """What a file holds; with `like`, beside what that scene, which is like no other, has."""
    try:
        content = load_yaml(read_text(source))
    except (OSError, UntrustedError) as error:
        raise _wrong(str(source), "a scene in YAML", error) from error
    if not isinstance(content, dict) or "like" not in content:
        return content
    like = content.pop("like")
    if not isinstance(like, str):
        raise _wrong(f"{source}: like", "a scene", like)
    before = _source(like)
    try:
        base = load_yaml(read_text(before))
    except (OSError, UntrustedError) as error:
        raise _wrong(str(before), "a scene in YAML", error) from error
    base = _mapping(base, str(before))
    for key in ("furniture", "bodies"):
        both = base.get(key, []), content.get(key, [])
        if all(isinstance(things, list) for things in both):
            content[key] = [*both[0], *both[1]]
    return {**base, **content}


def _scene(content: object, file: str) -> CellScene:
    keys = ("floor", "person", "people", "furniture", "bodies", "view")
    found = _mapping(content, file, keys)
    furniture = [
        Thing(**_thing(item, place, ())) for item, place in _items(found, "furniture", file)
    ]
    bodies = [_body(item, place) for item, place in _items(found, "bodies", file)]
    names = [thing.name for thing in (*furniture, *bodies)]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise _wrong(f"{file}: name", "names that differ", f"{twice[0]} twice")
    floor = _number(found.get("floor", 0.0), f"{file}: floor")
    person = _person(found["person"], floor, f"{file}: person") if "person" in found else None
    view = _numbers(found.get("view", VIEW), (2, 3), f"{file}: view (camera and what it looks at)")
    people = {
        name: _person(stance, floor, f"{file}: people.{name}")
        for name, stance in _mapping(found.get("people", {}), f"{file}: people").items()
    }
    return CellScene(floor, person, tuple(furniture), tuple(bodies), view.tolist(), people)


def _person(content: object, floor: float, place: str) -> Stance:
    found = _mapping(content, place, ("stands", "faces", "height", "hand"))
    ground = _numbers(found.get("stands"), (2,), f"{place}.stands")
    faces = _number(found.get("faces", 0.0), f"{place}.faces")
    height = _number(found.get("height", 1.75), f"{place}.height")
    hand = found.get("hand", "right")
    if hand not in ("left", "right"):
        raise _wrong(f"{place}.hand", "left or right", hand)
    if not 0.5 <= height <= 2.5:
        raise _wrong(f"{place}.height", "0.5 to 2.5 m", height)
    return Stance(np.append(ground, floor), faces, height, hand == "left")


def _body(item: object, place: str) -> Body:
    keys = ("task", "brought_by", "grasp", "in_hand", "laid")
    values = _thing(item, place, keys)
    found = _mapping(item, place)
    task, bringer = found.get("task"), found.get("brought_by", ROBOT)
    if not isinstance(task, str) or not task:
        raise _wrong(f"{place}.task", "the label of a task", task)
    if bringer not in (ROBOT, PERSON):
        raise _wrong(f"{place}.brought_by", f"{ROBOT} or {PERSON}", bringer)
    needed = "grasp" if bringer == ROBOT else "in_hand"
    if needed not in found:
        raise _wrong(f"{place}.{needed}", f"x, y, z of what the {bringer} brings", "nothing")
    grasp, in_hand, laid = (
        _numbers(found[key], (3,), f"{place}.{key}") if key in found else None
        for key in ("grasp", "in_hand", "laid")
    )
    return Body(**values, task=task, brought_by=bringer, grasp=grasp, in_hand=in_hand, laid=laid)


def _thing(item: object, place: str, more_keys: Sequence[str]) -> dict:
    """What furniture and bodies have in common."""
    found = _mapping(item, place, ("name", "xyz", "rpy", "parts", *more_keys))
    name = found.get("name")
    if not isinstance(name, str) or not name.replace("_", "").isalnum():
        raise _wrong(f"{place}.name", "a word of letters, digits and _", name)
    parts = tuple(_part(part, where) for part, where in _items(found, "parts", place))
    if not parts:
        raise _wrong(f"{place}.parts", "at least one shape", "none")
    return {"name": name, "pose": _pose(found, place), "parts": parts}


def _part(item: object, place: str) -> ScenePart:
    found = _mapping(item, place, (*SHAPES, "xyz", "rpy", "colour"))
    shapes = [shape for shape in SHAPES if shape in found]
    if len(shapes) != 1:
        raise _wrong(place, f"one of {', '.join(SHAPES)}", ", ".join(shapes) or "none")
    (shape,) = shapes
    size = _numbers(found[shape], N_NUMBERS[shape], f"{place}.{shape} ({SHAPES[shape]})")
    if np.any(size <= 0.0):
        raise _wrong(f"{place}.{shape}", "sizes above zero", size.tolist())
    colour = found.get("colour", "")
    if colour and not _is_colour(colour):
        raise _wrong(f"{place}.colour", "a colour such as '#9aa5b1'", colour)
    return ScenePart(shape, tuple(np.atleast_1d(size).tolist()), _pose(found, place), colour)


def _is_colour(text: object) -> bool:
    try:
        return isinstance(text, str) and text[0] == "#" and len(bytes.fromhex(text[1:])) == 3
    except ValueError:
        return False


def _pose(found: Mapping, place: str) -> NDArray[np.float64]:
    """As in a URDF: xyz [m], and rpy [rad] about the fixed axes x, y and z."""
    pose = np.eye(4)
    pose[:3, 3] = _numbers(found.get("xyz", [0.0] * 3), (3,), f"{place}.xyz")
    turn = _numbers(found.get("rpy", [0.0] * 3), (3,), f"{place}.rpy")
    pose[:3, :3] = Rotation.from_euler("xyz", turn).as_matrix()
    return pose


def _items(found: Mapping, key: str, place: str) -> list[tuple[object, str]]:
    """Items of a list, and where each of them stands."""
    items = found.get(key, [])
    where = f"{place}: {key}" if place.endswith((".yaml", ".yml")) else f"{place}.{key}"
    if not isinstance(items, list) or len(items) > MOST_THINGS:
        raise _wrong(where, f"a list of at most {MOST_THINGS}", type(items).__name__)
    return [(item, f"{where}[{k}]") for k, item in enumerate(items)]


def _mapping(value: object, place: str, keys: Sequence[str] = ()) -> Mapping:
    if not isinstance(value, Mapping):
        raise _wrong(place, f"a mapping with keys among {', '.join(keys)}", value)
    if keys and (unknown := sorted(set(map(str, value)) - set(keys))):
        raise _wrong(place, f"only the keys {', '.join(keys)}", ", ".join(unknown))
    return value


def _number(value: object, place: str) -> float:
    """A finite number of bounded size."""
    return float(_numbers(value, (), place))


def _numbers(value: object, shape: tuple[int, ...], place: str) -> NDArray[np.float64]:
    """Finite numbers of this shape and of bounded size."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.array(np.nan)
    if array.shape != shape or not np.all(np.abs(array) <= LARGEST_M):
        count = " by ".join(map(str, shape)) or "a"
        raise _wrong(place, f"{count} number{'s' * bool(shape)} up to {LARGEST_M:g}", value)
    return array


def _wrong(place: str, expected: str, got: object) -> ArgumentError:
    return ArgumentError.about(place, expected, got, "See docs/dashboard.md.")
