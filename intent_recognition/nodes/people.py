# SPDX-License-Identifier: Apache-2.0
"""Named people in the nodes: finds their topics, and assigns the tracker's bodies to them."""

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from rclpy.node import Node

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.nodes.conversions import PoseNumbers
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.runtime import steady_timer
from intent_recognition.tracking import NOBODY, Identities, IngestSettings, frame_name, identify

ANYBODY = "*"
"""Name that stands for everybody whose topics appear."""
_NAME = re.compile(r"[A-Za-z]\w*", re.ASCII)


def named_people(node: Node) -> list[str]:
    """The parameter `persons`: ids as in REP 155; empty for one person, who has no name.

    Raises:
        ArgumentError: a name cannot be part of a topic, or is given twice.
    """
    names = [name for name in declare(node, "people")["persons"] if name]
    bad = [name for name in names if name != ANYBODY and not _NAME.fullmatch(name)]
    if bad or len(set(names)) != len(names):
        cure = "Use e.g. [anna, ben], or ['*'] for whoever is there."
        expected = "different names of letters, digits and _"
        raise ArgumentError.about("parameter persons", expected, names, cure)
    return names


def meet(node: Node, template: str, act: Callable[[str], object]) -> bool:
    """Call `act` once for each person; returns whether the parameter `persons` names any.

    `template` is a topic that each person has, with {} for the name. If the names include
    `ANYBODY`, `act` is also called later for each person whose topic appears.
    """
    names = named_people(node)
    met = set(names) - {ANYBODY}
    for name in sorted(met):
        act(name)
    if ANYBODY in names:
        meet_all(node, template, act, met)
    return bool(names)


def meet_all(node: Node, template: str, act: Callable[[str], object], met: set[str]) -> None:
    """Call `act` once for each person whose topic appears, at most a hundred; see `meet`."""
    parts = node.resolve_topic_name(template.format("X_X")).split("X_X")
    pattern = re.compile(f"({_NAME.pattern})".join(map(re.escape, parts)), re.ASCII)

    def look() -> None:
        for topic, _ in node.get_topic_names_and_types():
            found = pattern.fullmatch(topic)
            new = found is not None and found[1] not in met and len(met) < 100
            if found and new and node.count_publishers(topic):
                met.add(found[1])
                node.get_logger().info(f"meets {found[1]}")
                act(found[1])

    steady_timer(node, 0.5, look)


class _Snapshot(NamedTuple):
    """Bodies measured at one time: positions (3,) [m] in the world by label, and the poses."""

    positions: dict[str, Floats]
    poses: list[tuple[str, str, PoseNumbers]]


class IdentityInput:
    """Collects the bodies measured at one time in a snapshot, and passes them on by person.

    A snapshot is complete once everybody of the last one has come; after 50 ms it is used as it
    is. People are identified by the position of `body`; `send` takes person, body and pose.
    """

    def __init__(
        self, body: str, send: Callable[[str, str, PoseNumbers], object], diagnostics: Diagnostics
    ) -> None:
        self._body, self._send, self._diagnostics = body, send, diagnostics
        self.forget()

    def forget(self) -> None:
        """Forget all people: later poses may have earlier stamps."""
        self._identities = Identities()
        self._who: dict[str, str] = {}
        self._expected: set[str] = set()
        self._snapshots: dict[int, _Snapshot] = {}
        self._newest_ns = self._taken_ns = self._doubtful_ns = 0

    def take(self, label: str, body: str, measured: PoseNumbers, settings: IngestSettings) -> None:
        """Take a pose with the label that the tracker has given it."""
        frame, stamp_ns = frame_name(measured.frame_id), measured.stamp_ns
        usable = stamp_ns > 0 and bool(np.isfinite(measured.pose).all())
        if not usable or frame not in settings.frames:
            self._send(self._who.get(label) or label, body, measured)  # the receiver rejects it
            return
        since_ns, off_ns = stamp_ns - self._doubtful_ns, abs(stamp_ns - self._newest_ns)
        goes_on = self._doubtful_ns and 1_000_000 <= since_ns <= off_ns
        if self._newest_ns and off_ns > 1_000_000_000:
            self._doubtful_ns = stamp_ns
            if not goes_on:  # a single frame may be stamped wrong
                self._diagnostics.count("stamp_jumped")
                return
            if stamp_ns < self._newest_ns:  # a clock was set back
                self.forget()
        elif since_ns:
            self._doubtful_ns = 0
        self._newest_ns = max(self._newest_ns, stamp_ns)
        if body == self._body:
            self._expected.add(label)
        if stamp_ns <= self._taken_ns:
            self._pass_on([(label, body, measured)])
            return
        positions, poses = self._snapshots.setdefault(stamp_ns, _Snapshot({}, []))
        poses.append((label, body, measured))
        if body == self._body:
            positions[label] = settings.frames[frame].apply(measured.pose[:3])
        for stamp_ns in sorted(self._snapshots):
            complete = self._snapshots[stamp_ns].positions.keys() >= self._expected
            if not complete and self._newest_ns - stamp_ns < 50_000_000:
                break
            self._take_snapshot(stamp_ns)

    def _take_snapshot(self, stamp_ns: int) -> None:
        before, (positions, poses) = self._identities, self._snapshots.pop(stamp_ns)
        self._taken_ns = stamp_ns
        self._identities, found = identify(before, stamp_ns, positions)
        gone = {k: who for k, who in self._who.items() if who not in found.values()}
        self._who = {**gone, **found}
        self._expected = set(positions).union(*(f.positions for f in self._snapshots.values()))
        for name in ("n_undone", "n_unknown"):
            if getattr(self._identities, name) > getattr(before, name):
                self._diagnostics.count(f"identity_{name[2:]}")
        self._pass_on(poses)

    def _pass_on(self, poses: Sequence[tuple[str, str, PoseNumbers]]) -> None:
        for label, body, measured in poses:
            person = self._who.get(label, NOBODY)
            if person == NOBODY:
                self._diagnostics.count("of_nobody")
            else:
                self._send(person, body, measured)
