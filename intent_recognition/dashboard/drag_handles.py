# SPDX-License-Identifier: Apache-2.0
"""Drag handles in the scene: for the two goals, or for the wrist and the arm's hand."""

import time
from collections.abc import Callable
from typing import Literal

import numpy as np
import viser

from intent_recognition.array_types import Floats
from intent_recognition.dashboard import admission
from intent_recognition.dashboard.person_view import MOVED_M
from intent_recognition.dashboard.scene import DARK, GREY
from intent_recognition.dashboard.things_view import Colour

WRIST, HAND = "wrist", "hand"
GOALS, DIRECT = "goals", "direct"
NAMES = {
    (GOALS, WRIST): "human reaches here",
    (GOALS, HAND): "robot's hand goes here",
    (DIRECT, WRIST): "drag the wrist",
    (DIRECT, HAND): "drag the robot's hand",
}
COLOURS = {WRIST: DARK, HAND: GREY}
ANCHORS: dict[str, Literal["top-left", "top-right"]] = {WRIST: "top-left", HAND: "top-right"}
"""Corner of each label: with the robot on the left, neither label covers the other."""

Moved = Callable[[Floats], None]


def add_handle(scene: viser.SceneApi, name: str, place: Floats) -> viser.TransformControlsHandle:
    """Add hidden arrows of 14 cm to drag at a position (3,) [m]; they are drawn in front of all."""
    return scene.add_transform_controls(
        name, 0.14, disable_rotations=True, depth_test=False, position=place, visible=False
    )


def add_ball(
    scene: viser.SceneApi, name: str, colour: Colour, place: Floats, opacity: float | None = None
) -> viser.IcosphereHandle:
    """Add a ball that marks a position (3,) [m] in its frame."""
    return scene.add_icosphere(name, 0.018, colour, opacity=opacity, position=place)


class Drag:
    """Drag events of a handle, in the order in which they were sent.

    `moved` is called with the position (3,) [m] and with whether the handle was released there.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        handle: viser.TransformControlsHandle,
        moved: Callable[[Floats, bool], None],
    ):
        self._server, self._moved, self._moved_s = server, moved, -np.inf
        handle.on_update(self._update)

    @property
    def held(self) -> bool:
        """Whether somebody drags the handle and has moved it within the last `IDLE_S`."""
        return time.monotonic() - self._moved_s <= admission.IDLE_S

    async def _update(self, event: viser.TransformControlsEvent) -> None:
        left = event.phase == "end"
        self._moved_s = -np.inf if left else time.monotonic()
        if not left or event.client_id in self._server.get_clients():  # unless client left
            self._moved(np.array(event.target.position, dtype=float), left)


class DragHandles:
    """Two pairs of drag handles, hidden until shown. `places` are positions (3,) [m] by body."""

    def __init__(self, server: viser.ViserServer, places: dict[str, Floats]):
        self._server = server
        self._drags: dict[tuple[str, str], Drag] = {}
        self._handles = {key: self._make(*key, places[key[1]]) for key in NAMES}

    def on_moved(self, kind: str, body: str, moved: Moved) -> None:
        """Call `moved` whenever a person drags this handle."""
        key = (kind, body)
        self._drags[key] = Drag(self._server, self._handles[key], lambda place, _: moved(place))

    def show(self, kind: str | None) -> bool:
        """Show one pair and hide the other, or hide both (None); returns whether this changed."""
        changed = False
        for (of_kind, _), handle in self._handles.items():
            if handle.visible != (of_kind == kind):
                handle.visible = changed = of_kind == kind
        return changed

    def place(self, kind: str, body: str, position: Floats) -> None:
        """Move a handle to a position (3,) [m], unless it is being dragged."""
        handle = self._handles[kind, body]
        away = np.linalg.norm(np.asarray(handle.position) - position)
        if not self._drags[kind, body].held and away > MOVED_M:
            handle.position = np.asarray(position, dtype=float)

    def _make(self, kind: str, body: str, place: Floats) -> viser.TransformControlsHandle:
        scene, name = self._server.scene, f"/{kind}/{body}"
        handle = add_handle(scene, name, place)
        scene.add_label(f"{name}/name", NAMES[kind, body], anchor=ANCHORS[body])
        if kind == GOALS:
            add_ball(scene, f"{name}/ball", COLOURS[body], np.zeros(3), opacity=0.8)
        return handle
