# SPDX-License-Identifier: Apache-2.0
"""A person in the scene: figure, wrist, measured and predicted path, tube, task."""

from collections.abc import Mapping

import numpy as np
import viser

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.cell import STALE_S, CellState
from intent_recognition.dashboard.figure import Stance
from intent_recognition.dashboard.person_view import FIGURE_GREY, ROOT, PersonView
from intent_recognition.dashboard.things_view import Colour, rgb
from intent_recognition.promp import NONE
from intent_recognition.report import NONE_COLOUR, readable

NOTHING = np.zeros((0, 3))
GREY = rgb(NONE_COLOUR)
"""Colour of old values."""


class Lines:
    """Paths below a node of the scene, created when first drawn."""

    def __init__(self, server: viser.ViserServer, root: str = ""):
        self._scene, self._root = server.scene, root
        self._lines: dict[str, viser.LineSegmentsHandle] = {}

    def draw(self, name: str, path: Floats, colour: Colour, width_m: float = 0.006) -> None:
        """Draw a path (T, 3), or hide it where it has fewer than two points."""
        if name in self._lines:
            self._lines[name].visible = len(path) > 1
        if len(path) < 2:
            return
        pairs = np.stack((path[:-1], path[1:]), axis=1).astype(np.float32)
        if name not in self._lines:
            self._lines[name] = self._scene.add_line_segments(
                f"{self._root}/{name}", pairs, colour, thickness=width_m
            )
        self._lines[name].points = pairs
        # One colour for the whole line: colours per point come out paler.
        self._lines[name].colors = np.array(colour, dtype=np.uint8)


class PersonMarks:
    """Draws a `PersonState`, without a figure where no stance is known.

    The only person has neither name nor label.
    """

    def __init__(self, server: viser.ViserServer, name: str, colour: Colour, stance: Stance | None):
        self._scene, self._name, self._colour = server.scene, name, colour
        self._root = f"/people/{name}" if name else ""
        self._lines = Lines(server, self._root)
        self._tube: viser.MeshHandle | None = None
        scene, root = self._scene, self._root
        self._frame = scene.add_frame(root, show_axes=False) if name else None
        self._wrist = scene.add_icosphere(f"{root}/wrist", 0.022, colour, visible=False)
        if name:
            above = (0.0, 0.0, 0.08)
            scene.add_label(f"{root}/wrist/name", name, anchor="bottom-center", position=above)
        self._label = scene.add_label(f"{root}/task", "", visible=False, anchor="bottom-center")
        self._figure: PersonView | None = None
        if stance is not None:
            at, tint = (f"/figures/{name}", colour) if name else (ROOT, FIGURE_GREY)
            self._figure = PersonView(server, stance, at, tint)

    def update(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        """Draw the newest state; hide a named person who is no longer seen."""
        person = state.people[self._name]
        if person.wrist is not None:
            fresh = state.fresh(person.wrist_at_s, now_s)
            self._wrist.visible = fresh or not self._name
            self._wrist.position = person.wrist
            self._wrist.color = self._colour if fresh else GREY
            self._lines.draw("wrist_path", person.wrist_path(now_s), GREY, width_m=0.003)
            if self._figure is not None:
                self._figure.update(person.wrist)
        best = person.posterior.best if person.posterior is not None else ""
        colour = rgb(colours.get(best, NONE_COLOUR))
        known = best != NONE and state.fresh(person.drawn_at_s, now_s, STALE_S)
        shown = person.drawn if known else None  # an unknown movement's is metres wide
        path = NOTHING if shown is None else shown.predicted
        self._lines.draw("predicted", path, colour)
        self._draw_tube(NOTHING if shown is None else shown.tube, colour)
        self._label.visible = len(path) > 0
        if self._label.visible:
            self._label.position = path[-1] + np.array([0.0, 0.0, 0.14])
            self._label.text = readable(best)

    def remove(self) -> None:
        """Remove all of a named person."""
        for part in (self._frame, self._figure):
            if part is not None:
                part.remove()

    def _draw_tube(self, corners: Floats, colour: Colour) -> None:
        if len(corners) < 3:
            if self._tube is not None:
                self._tube.visible = False
            return
        vertices = corners.astype(np.float32)
        if self._tube is None or len(self._tube.vertices) != len(vertices):
            self._tube = self._scene.add_mesh_simple(
                f"{self._root}/tube",
                vertices,
                np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3),
                color=colour,
                opacity=0.28,  # with viser's lights
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
            return
        self._tube.vertices = vertices
        self._tube.color = colour
        self._tube.visible = True
