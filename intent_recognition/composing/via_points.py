# SPDX-License-Identifier: Apache-2.0
"""Via points as a user writes them: for a task or for all tasks, for joints or for the hand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from intent_recognition.untrusted import YamlChecks

HAND = "hand"
"""Key of a via point of the hand."""
USUAL_STD = 0.01
"""Default standard deviation of a via point, in the unit of its DOFs: 1 cm, or 0.6 degrees."""
CHECKS = YamlChecks("docs/combining.md describes them.")
KEYS = ("name", "task", "phase", "time", HAND, "dofs", "std")


@dataclass(frozen=True)
class ViaPoint:
    """Point that the controlled agent passes; either `phase` or `time_s` is None.

    Attributes:
        name: name by which the point can be replaced and removed.
        values: values by controlled DOF, in their units; for the hand x, y, z [m] in the world
            frame, under the name `hand`.
        std: standard deviation of each value, in its unit.
        phase: phase of the task, in [0, 1]; 1 is the end.
        time_s: time after onset, at the task's usual duration [s].
        task: label of the task; empty for all tasks.
    """

    name: str
    values: Mapping[str, tuple[float, ...]]
    std: tuple[float, ...]
    phase: float | None = None
    time_s: float | None = None
    task: str = ""

    @property
    def of_hand(self) -> bool:
        """Whether it is a point of the hand."""
        return HAND in self.values

    def __str__(self) -> str:
        what = ", ".join(
            f"{name} {' '.join(f'{v:g}' for v in values)}" for name, values in self.values.items()
        )
        when = f"phase {self.phase:g}" if self.time_s is None else f"{self.time_s:g} s"
        std = " ".join(f"{s:g}" for s in dict.fromkeys(self.std))
        return f"{self.name}: {what} +- {std} at {when} of {self.task or 'all tasks'}"


def read_via_points(text: str) -> tuple[ViaPoint, ...]:
    """Read via points from a YAML list.

    For example::

        - {name: bottle, task: plate_handover, phase: 0.6, hand: [0.4, 0.1, 0.3], std: 0.01}
        - {name: elbow, time: 2.5, dofs: {lwr_a4_joint: -1.2}}

    Each has a `name`, a `phase` in [0, 1] or a `time` [s], and `hand` or `dofs`. `std` is a number,
    or a list of one per value. Without a `task`, the point is for all. An empty text has no points.

    Raises:
        ArgumentError: the text is no such list.
    """
    content = CHECKS.load("via_points", text)
    if content is None:
        return ()
    if not isinstance(content, list) or len(content) > 100:
        CHECKS.refuse("via_points", "a list of at most 100 points", content)
    points = tuple(map(_read, content))
    names = [point.name for point in points]
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        CHECKS.refuse("via_points", "a name of its own for each", ", ".join(doubled))
    return points


def write_via_points(points: Sequence[ViaPoint]) -> str:
    """YAML list of via points that `read_via_points` reads; empty for no points."""
    if not points:
        return ""
    content = []
    for point in points:
        values = {name: list(at) for name, at in point.values.items()}
        where = values if point.of_hand else {"dofs": {name: at[0] for name, at in values.items()}}
        when = {"phase": point.phase} if point.time_s is None else {"time": point.time_s}
        task = {"task": point.task} if point.task else {}
        content.append({"name": point.name, **task, **when, **where, "std": list(point.std)})
    return yaml.safe_dump(content, default_flow_style=True, sort_keys=False, width=10**6).strip()


def _read(content: Any) -> ViaPoint:
    if not isinstance(content, Mapping):
        CHECKS.refuse("via point", f"keys of {', '.join(KEYS)}", content)
    name = content.get("name")
    if not isinstance(name, str) or not 0 < len(name) <= 100 or not name.isprintable():
        CHECKS.refuse("via point", "a name", name)
    place = f"via point {name}"
    CHECKS.keys(place, content, KEYS)
    task = content.get("task", "")
    if not isinstance(task, str):
        CHECKS.refuse(place, "a label as task", task)
    if ("phase" in content) == ("time" in content):
        CHECKS.refuse(place, "phase or time", "both" if "phase" in content else "neither")
    when = CHECKS.number(place, content.get("phase", content.get("time")))
    if when < 0.0 or ("phase" in content and when > 1.0):
        CHECKS.refuse(place, "a phase from 0 to 1, or a time from 0 s on", when)
    values = _values(place, content)
    size = sum(map(len, values.values()))
    std = content.get("std", USUAL_STD)
    spread = tuple(
        CHECKS.number(place, s) for s in (std if isinstance(std, list) else [std] * size)
    )
    if len(spread) != size or min(spread) < 0.0:
        CHECKS.refuse(place, f"a std from 0 on, or {size} of them", std)
    phase, time_s = (when, None) if "phase" in content else (None, when)
    return ViaPoint(name, values, spread, phase, time_s, task)


def _values(place: str, content: Mapping[Any, Any]) -> dict[str, tuple[float, ...]]:
    hand, dofs = content.get(HAND), content.get("dofs")
    if (hand is None) == (dofs is None):
        CHECKS.refuse(place, "hand or dofs", "neither" if hand is None else "both")
    if dofs is None:
        if not isinstance(hand, list) or len(hand) != 3:
            CHECKS.refuse(place, "hand: [x, y, z] in metres", hand)
        return {HAND: tuple(CHECKS.number(place, value) for value in hand)}
    if not isinstance(dofs, Mapping) or not dofs or HAND in dofs:
        CHECKS.refuse(place, "dofs: {NAME: value}", dofs)
    return {str(name): (CHECKS.number(place, value),) for name, value in dofs.items()}
