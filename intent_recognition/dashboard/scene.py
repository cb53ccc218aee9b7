# SPDX-License-Identifier: Apache-2.0
"""The cell in 3D: arm, people, things and the predicted path of the hand."""

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
import viser

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.cell import STALE_S, CellState
from intent_recognition.dashboard.handling import HandlingMoment
from intent_recognition.dashboard.person_marks import GREY, NOTHING, Lines, PersonMarks
from intent_recognition.dashboard.robot_view import ROOT, RobotView
from intent_recognition.dashboard.scene_file import CellScene
from intent_recognition.dashboard.things_view import ThingsView, rgb
from intent_recognition.errors import one_line
from intent_recognition.kinematics import JOINT_NAMES, frame_poses
from intent_recognition.report import INK, NONE_COLOUR

Result = TypeVar("Result")
DARK = rgb(INK)
"""Colour of the only person's wrist, and of things without a task."""


class PageScene:
    """Draws a `CellState`; `update` sends only what has changed.

    Attributes:
        robot: the arm; None until its description is received and can be drawn.
        hand_path: task and positions (T, 3) [m] of the last predicted path; None before it.
    """

    def __init__(
        self, server: viser.ViserServer, cell: CellScene, hand_link: str = "", light: bool = False
    ):
        self._server, self._cell, self._hand_link = server, cell, hand_link
        self.robot: RobotView | None = None
        self._description = self._problem = self._helped = ""
        self._hand_path_at_s = -np.inf
        self.hand_path: tuple[str, Floats] | None = None
        self._light = self._shaded = False
        self._prepare()
        if light:
            self.lighten()
        self._things = ThingsView(server, cell)
        self._people = {"": PersonMarks(server, "", DARK, cell.person)}

    def lighten(self) -> None:
        """Do without shadows, environment light and a solid floor, all of which draw slowly."""
        if self._light:
            return
        self._light = True
        if self._shaded:
            self._server.scene.configure_default_lights(cast_shadow=False)
        self._server.scene.configure_environment_map(None)
        self._server.scene.add_light_ambient("/ambient", intensity=1.2)
        self._server.scene.remove_by_name("/floor")
        x, y = np.meshgrid(np.linspace(-3.0, 3.0, 13), (-3.0, 3.0), indexing="ij")
        along = np.stack((x, y, np.full_like(x, self._cell.floor_m)), axis=-1)
        lines = np.concatenate((along, along[..., [1, 0, 2]]))  # (26, 2, 3)
        self._server.scene.add_line_segments("/floor", lines, (208, 214, 221), thickness=0.006)

    def shade(self) -> None:
        """Draw shadows from now on, unless the scene is light."""
        self._shaded = not self._light
        if self._shaded:
            self._server.scene.configure_default_lights()

    def update(
        self, state: CellState, colours: Mapping[str, str], people: Mapping[str, str], now_s: float
    ) -> str:
        """Draw the newest state, in the colours of tasks and people.

        Returns:
            Problem with the robot's description, empty if there is none.
        """
        self._guarded(lambda: self._update_robot(state))
        bare = self.robot is None and not self._problem
        self._base.visible = bare
        self._lines.draw("arm", _skeleton(state.joints) if bare else NOTHING, GREY, 0.045)
        self._update_people(state, colours, people, now_s)
        self._update_things(state, colours, now_s)
        self._update_hand_path(state, colours, now_s)
        return self._problem

    def _update_people(
        self, state: CellState, colours: Mapping[str, str], people: Mapping[str, str], now_s: float
    ) -> None:
        for name in self._people.keys() - state.people.keys():
            self._people.pop(name).remove()
        for name in state.people:
            if name not in self._people:
                colour, stance = rgb(people[name]), self._cell.people.get(name)
                self._people[name] = PersonMarks(self._server, name, colour, stance)
            self._people[name].update(state, colours, now_s)

    def _guarded(self, of_robot: Callable[[], Result]) -> Result | None:
        """Call a function of the robot; drop a robot that cannot be drawn and return None."""
        try:
            return of_robot()
        except Exception as error:  # XML and mesh parsers raise anything
            self._server.scene.remove_by_name(ROOT)
            self.robot = None
            self._problem = f"robot_description cannot be drawn: {one_line(error)}"
            return None

    def _prepare(self) -> None:
        scene = self._server.scene
        # First: a slow browser would compile shaders with shadows for all that is drawn before.
        scene.configure_default_lights(cast_shadow=False)
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
        self._lines = Lines(self._server)

    def _update_robot(self, state: CellState) -> None:
        if state.description and state.description != self._description:
            self._description = state.description
            self._server.scene.remove_by_name(ROOT)
            self.robot, self._problem = None, ""
            self.robot = RobotView(self._server, state.description, self._hand_link)
        if self.robot is not None and state.joints:
            self.robot.update(state.joints)

    def _update_things(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        hand = None
        if self.robot is not None and self._things.handling.follows_hand(state.active):
            hand = self._guarded(self.robot.hand_pose)
        self._helped = state.helped or self._helped  # no longer published after the task
        wrists = {name: person.wrist for name, person in state.people.items()}
        moment = HandlingMoment(now_s, state.active, state.begun, hand, wrists, self._helped)
        self._things.update(moment, colours)

    def _update_hand_path(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        person = state.person
        predicted = person.predicted
        if predicted is None or not state.fresh(person.predicted_at_s, now_s, STALE_S):
            self._lines.draw("hand_path", NOTHING, DARK)
            return
        due, robot = now_s - self._hand_path_at_s >= 0.2, self.robot
        if robot is None or not due or len(predicted.positions) < 2:
            return
        self._hand_path_at_s = now_s
        path = self._guarded(lambda: robot.hand_path(predicted.joints, predicted.positions))
        if path is None:
            return
        self.hand_path = predicted.task, path
        colour = rgb(colours.get(predicted.task, NONE_COLOUR))
        self._lines.draw("hand_path", path, colour)


def _skeleton(joints: Mapping[str, float]) -> Floats:
    """The points (8, 3) [m] where an LWR's axes meet, drawn without a URDF; none for other arms."""
    if not all(name in joints for name in JOINT_NAMES):
        return NOTHING
    poses = frame_poses(np.array([joints[name] for name in JOINT_NAMES]))
    return poses[:, :3, 3]
