# SPDX-License-Identifier: Apache-2.0
"""Via points on the page: drag the predicted path of the hand, and remove the points again."""

import numpy as np
import viser

from intent_recognition.array_types import Floats
from intent_recognition.composing import HAND, ViaPoint, write_via_points
from intent_recognition.dashboard.commands import ESTIMATOR
from intent_recognition.dashboard.drag_handles import Drag, add_ball, add_handle
from intent_recognition.dashboard.person_view import MOVED_M
from intent_recognition.dashboard.scene import DARK
from intent_recognition.dashboard.widgets import PageAccess, set_value, slider_value

NOTHING = "none"
"""Entry of the list while no via point is in force."""


class ViaPointControls:
    """A folder of controls, and a handle on the last predicted path."""

    def __init__(self, page: PageAccess):
        server, gui, self._page = page.server, page.server.gui, page
        self._points: tuple[ViaPoint, ...] = ()
        self._path: tuple[str, Floats] | None = None
        with gui.add_folder("Via points"):
            self._drag = gui.add_checkbox(
                "Drag the robot's path", False, hint="the hand's, as it was predicted last"
            )
            self._phase = gui.add_slider("At phase", 0.0, 1.0, 0.01, 0.5)
            self._std = gui.add_number("Within [cm]", 1.0, min=0.1, max=10.0, step=0.1)
            self._chosen = gui.add_dropdown("In force", (NOTHING,))
            self._remove = gui.add_button("Remove it", disabled=True)
        self._handle = add_handle(server.scene, "/via/handle", np.zeros(3))
        server.scene.add_label("/via/handle/name", "pass here", anchor="top-center")
        self._drawn: list[viser.SceneNodeHandle] = []
        self._dragged = Drag(server, self._handle, self._on_moved)
        page.on_click(self._remove, self.remove)

    def update(self, points: tuple[ViaPoint, ...], path: tuple[str, Floats] | None) -> None:
        """Show the points in force and the handle on the predicted path, if there is one.

        `path` holds a task and positions of the hand (T, 3) [m], evenly spaced in time.
        """
        self._path = path
        visible = bool(self._drag.value) and path is not None
        self._handle.visible = visible
        if path is not None and visible and not self._dragged.held:
            place = self._place(path[1])
            if np.linalg.norm(np.asarray(self._handle.position) - place) > MOVED_M:
                self._handle.position = place
        if points != self._points:
            self._points = points
            self._show()

    def drop(self, place: Floats) -> None:
        """Make the hand pass through a position (3,) [m] at the chosen phase."""
        if self._path is None:
            return
        names = {point.name for point in self._points}
        name = next(n for k in range(1, len(names) + 2) if (n := f"page {k}") not in names)
        std = float(np.clip(self._std.value, self._std.min, self._std.max)) * 1e-2
        x, y, z = np.round(place, 4).tolist()
        new = ViaPoint(
            name, {HAND: (x, y, z)}, (std,) * 3, slider_value(self._phase), None, self._path[0]
        )
        self._send((*self._points, new))

    def remove(self) -> None:
        """Remove the chosen point."""
        self._send(tuple(point for point in self._points if point.name != self._chosen.value))

    def _send(self, points: tuple[ViaPoint, ...]) -> None:
        self._page.commands.set_parameter(ESTIMATOR, "via_points", write_via_points(points))

    def _on_moved(self, place: Floats, left: bool) -> None:
        if left:
            self._page.do(lambda: self.drop(place))

    def _place(self, path: Floats) -> Floats:
        at = slider_value(self._phase) * (len(path) - 1)
        low = min(int(at), len(path) - 2)
        return path[low] + (at - low) * (path[low + 1] - path[low])

    def _show(self) -> None:
        names = tuple(point.name for point in self._points) or (NOTHING,)
        self._chosen.options = names
        set_value(self._chosen, names[-1])
        self._remove.disabled = not self._points
        for node in self._drawn:
            node.remove()
        self._drawn = []
        for k, point in enumerate(self._points):
            if point.of_hand:
                scene, place = self._page.server.scene, np.array(point.values[HAND])
                ball = add_ball(scene, f"/via/point{k}", DARK, place)
                text = f"{point.name}: {point.task or 'all tasks'}"
                scene.add_label(f"/via/point{k}/name", text, anchor="bottom-center")
                self._drawn.append(ball)
