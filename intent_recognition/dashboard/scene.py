# SPDX-License-Identifier: Apache-2.0
"""The cell in three dimensions: arm, wrist, what was seen of it, and what is expected."""

from collections.abc import Callable, Mapping

import numpy as np
import viser
from numpy.typing import NDArray

from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.handling import HandlingMoment
from intent_recognition.dashboard.person_view import PersonView
from intent_recognition.dashboard.robot_view import ROOT, RobotView
from intent_recognition.dashboard.scene_file import CellScene
from intent_recognition.dashboard.things_view import Colour, ThingsView, rgb
from intent_recognition.errors import one_line
from intent_recognition.kinematics import JOINT_NAMES, frame_poses
from intent_recognition.promp import NONE
from intent_recognition.report import INK, NONE_COLOUR, readable

TUBE_OPACITY = 0.28
"""With viser's lights; RViz shows the same tube with `markers.TUBE_ALPHA`. Convention."""
STALE_S = 1.5
"""Age from which on a prediction is not drawn [s]. Convention."""
PATH_WIDTH_M = 0.006
"""Width of a drawn path [m]. Convention."""
NOTHING = np.zeros((0, 3))
HAND_PATH_PERIOD_S = 0.2
"""Time between two updates of the predicted path of the hand [s]. Convention."""

DARK, GREY = rgb(INK), rgb(NONE_COLOUR)
"""The wrist; the arm, and what is old."""


class PageScene:
    """Draws a `CellState`; `update` is cheap where nothing has changed.

    Attributes:
        hand_path: task and positions (T, 3) [m] of the path predicted last; None before the first.
    """

    def __init__(
        self, server: viser.ViserServer, cell: CellScene, hand_link: str = "", shadows: bool = True
    ):
        self._server, self._cell, self._hand_link = server, cell, hand_link
        self._robot: RobotView | None = None
        self._description = self._problem = ""
        self._hand_path_at_s = -np.inf
        self.hand_path: tuple[str, NDArray[np.float64]] | None = None
        self._prepare()
        self.set_shadows(shadows)
        self._things = ThingsView(server, cell)
        self._person = PersonView(server, cell.person) if cell.person is not None else None

    def set_shadows(self, shadows: bool) -> None:
        """Draw shadows from now on, or none."""
        self._server.scene.configure_default_lights(cast_shadow=shadows)

    @property
    def robot(self) -> RobotView | None:
        """The arm, once its description was received and could be read."""
        return self._robot

    def update(self, state: CellState, colours: Mapping[str, str], now_s: float) -> str:
        """Draw the newest; returns what is wrong with the robot's description, empty if nothing."""
        self._guard(lambda: self._update_robot(state))
        bare = self._robot is None and not self._problem
        self._base.visible = bare
        self._line("arm", _skeleton(state.joints) if bare else NOTHING, GREY, 0.045)
        self._update_wrist(state, now_s)
        self._guard(lambda: self._update_things(state, colours, now_s))
        self._update_prediction(state, colours, now_s)
        self._guard(lambda: self._update_hand_path(state, colours, now_s))
        return self._problem

    def _guard(self, update: Callable[[], None]) -> None:
        """Update what depends on the robot's description; one that cannot be drawn is dropped."""
        try:
            update()
        except Exception as error:  # whatever the parsers of XML and meshes raise, or made of it
            self._server.scene.remove_by_name(ROOT)
            self._robot = None
            self._problem = f"robot_description cannot be drawn: {one_line(error)}"

    def _prepare(self) -> None:
        scene = self._server.scene
        scene.set_up_direction("+z")
        scene.add_grid(
            "/floor",
            width=12.0,
            height=12.0,
            cell_size=0.25,
            section_size=1.0,
            cell_color=(222, 226, 231),
            section_color=(208, 214, 221),
            plane_color=(236, 239, 242),
            plane_opacity=1.0,
            shadow_opacity=0.25,
            fade_distance=5.0,
            position=(0.0, 0.0, self._cell.floor_m),
        )
        camera = self._server.initial_camera
        camera.position, camera.look_at = np.array(self._cell.view)
        camera.fov = np.deg2rad(42.0)
        self._base = scene.add_frame("/base", axes_length=0.15, axes_radius=0.004)
        scene.add_label("/base/name", "robot's base; x goes to the worker", anchor="top-center")
        self._wrist = scene.add_icosphere("/wrist", 0.022, DARK, visible=False)
        self._lines: dict[str, viser.LineSegmentsHandle] = {}
        self._tube: viser.MeshHandle | None = None
        self._label = scene.add_label("/task", "", visible=False, anchor="bottom-center")

    def _update_robot(self, state: CellState) -> None:
        if state.description and state.description != self._description:
            self._description = state.description
            self._server.scene.remove_by_name(ROOT)
            self._robot, self._problem = None, ""
            self._robot = RobotView(self._server, state.description, self._hand_link)
        if self._robot is not None and state.joints:
            self._robot.update(state.joints)

    def _update_wrist(self, state: CellState, now_s: float) -> None:
        if state.wrist is None:
            return
        fresh = state.fresh(state.wrist_at_s, now_s)
        self._wrist.visible = True
        self._wrist.position = state.wrist
        self._wrist.color = DARK if fresh else GREY
        if self._person is not None:
            self._person.update(state.wrist)
        self._line("wrist_path", state.wrist_path(now_s), GREY, PATH_WIDTH_M / 2)

    def _update_things(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        hand = None
        if self._robot is not None and self._things.follows_hand(state.active):
            hand = self._robot.hand_pose()
        self._things.update(
            HandlingMoment(now_s, state.active, state.begun, hand, state.wrist), colours
        )

    def _update_prediction(
        self, state: CellState, colours: Mapping[str, str], now_s: float
    ) -> None:
        best = state.posterior.best if state.posterior is not None else ""
        colour = rgb(colours.get(best, NONE_COLOUR))
        shown = state.drawn if state.fresh(state.drawn_at_s, now_s, STALE_S) else None
        self._line("predicted", NOTHING if shown is None else shown.predicted, colour, PATH_WIDTH_M)
        self._draw_tube(NOTHING if shown is None else shown.tube, colour)
        path = NOTHING if shown is None or best == NONE else shown.predicted
        self._draw_label(path, readable(best))

    def _draw_label(self, path: NDArray[np.float64], text: str) -> None:
        """Name the task above the predicted end."""
        visible = len(path) > 0
        self._label.visible = visible
        if visible:
            self._label.position = path[-1] + np.array([0.0, 0.0, 0.14])
            self._label.text = text

    def _update_hand_path(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        predicted = state.predicted
        if predicted is None or not state.fresh(state.predicted_at_s, now_s, STALE_S):
            self._line("hand_path", NOTHING, DARK, PATH_WIDTH_M)
            return
        due = now_s - self._hand_path_at_s >= HAND_PATH_PERIOD_S
        if self._robot is None or not due or len(predicted.positions) < 2:
            return
        self._hand_path_at_s = now_s
        path = self._robot.hand_path(predicted.joints, predicted.positions)
        self.hand_path = predicted.task, path
        colour = rgb(colours.get(predicted.task, NONE_COLOUR))
        self._line("hand_path", path, colour, PATH_WIDTH_M)

    def _line(self, name: str, path: NDArray[np.float64], colour: Colour, width_m: float) -> None:
        """Draw a path (T, 3), or hide it where it has fewer than two points."""
        handle = self._lines.get(name)
        if len(path) < 2:
            if handle is not None:
                handle.visible = False
            return
        pairs = np.stack((path[:-1], path[1:]), axis=1).astype(np.float32)
        if handle is None:
            self._lines[name] = self._server.scene.add_line_segments(
                f"/{name}", pairs, colour, thickness=width_m
            )
            return
        handle.points = pairs
        # Of the whole line: those of points come out paler.
        handle.colors = np.array(colour, dtype=np.uint8)
        handle.visible = True

    def _draw_tube(self, corners: NDArray[np.float64], colour: Colour) -> None:
        if len(corners) < 3:
            if self._tube is not None:
                self._tube.visible = False
            return
        vertices = corners.astype(np.float32)
        if self._tube is None or len(self._tube.vertices) != len(vertices):
            self._tube = self._server.scene.add_mesh_simple(
                "/tube",
                vertices,
                np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3),
                color=colour,
                opacity=TUBE_OPACITY,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
            return
        self._tube.vertices = vertices
        self._tube.color = colour
        self._tube.visible = True


def _skeleton(joints: Mapping[str, float]) -> NDArray[np.float64]:
    """The points (8, 3) [m] where the axes of an LWR without description meet; none for others."""
    if not all(name in joints for name in JOINT_NAMES):
        return NOTHING
    poses = frame_poses(np.array([joints[name] for name in JOINT_NAMES]))
    return poses[:, :3, 3]
