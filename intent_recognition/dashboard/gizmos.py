# SPDX-License-Identifier: Apache-2.0
"""What is dragged in the scene: two goals, or the wrist and the arm's hand themselves."""

from collections.abc import Callable

import numpy as np
import viser

SIZE_M = 0.14
BALL_M = 0.018
MOVED_M = 1e-3
WRIST, HAND = "wrist", "hand"
GOALS, LEADS = "goals", "lead"
NAMES = {
    (GOALS, WRIST): "human reaches here",
    (GOALS, HAND): "robot's hand goes here",
    (LEADS, WRIST): "drag the wrist",
    (LEADS, HAND): "drag the robot's hand",
}
COLOURS = {WRIST: (29, 39, 51), HAND: (135, 146, 160)}
"""The wrist is drawn so in the whole scene, and the robot is grey."""

Moved = Callable[[np.ndarray], None]


class Gizmos:
    """Two pairs of controls with three arrows each, hidden until they are shown.

    Args:
        server: the page.
        places: where each begins (3,) [m], by body: `wrist` and `hand`.
    """

    def __init__(self, server: viser.ViserServer, places: dict[str, np.ndarray]):
        self._server = server
        self._held: set[tuple[str, str]] = set()
        self._gizmos = {key: self._make(*key, places[key[1]]) for key in NAMES}

    def on_moved(self, kind: str, body: str, moved: Moved) -> None:
        """Call `moved` with the place (3,) [m] while a person drags this one."""
        key = (kind, body)

        def update(event: viser.TransformControlsEvent) -> None:
            (self._held.discard if event.phase == "end" else self._held.add)(key)
            moved(np.array(event.target.position))

        self._gizmos[key].on_update(update)

    def show(self, kind: str | None) -> bool:
        """Show one pair and hide the other, or both; whether that was news."""
        changed = False
        for (of_kind, _), gizmo in self._gizmos.items():
            if gizmo.visible != (of_kind == kind):
                gizmo.visible = changed = of_kind == kind
        return changed

    def place(self, kind: str, body: str, position: np.ndarray) -> None:
        """Put one at a place (3,) [m], unless somebody holds it."""
        gizmo = self._gizmos[kind, body]
        away = np.linalg.norm(np.asarray(gizmo.position) - position)
        if (kind, body) not in self._held and away > MOVED_M:
            gizmo.position = np.asarray(position, dtype=float)

    def _make(self, kind: str, body: str, place: np.ndarray) -> viser.TransformControlsHandle:
        scene, name = self._server.scene, f"/{kind}/{body}"
        gizmo = scene.add_transform_controls(
            name,
            SIZE_M,
            disable_rotations=True,
            depth_test=False,
            position=place,
            visible=False,
        )
        scene.add_label(f"{name}/name", NAMES[kind, body], anchor="top-center")
        if kind == GOALS:
            scene.add_icosphere(f"{name}/ball", BALL_M, COLOURS[body], opacity=0.8)
        return gizmo
