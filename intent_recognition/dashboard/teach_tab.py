# SPDX-License-Identifier: Apache-2.0
"""Teach a task without hardware: the wrist and the arm's hand are led from the page."""

from collections.abc import Callable

import numpy as np
import viser

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.commands import TEACHER, Commands
from intent_recognition.dashboard.lesson import Lesson
from intent_recognition.dashboard.puppet import Puppet
from intent_recognition.dashboard.watch_tab import set_content

REST_M = np.array([1.05, 0.0, 0.25])
WRIST_GOAL_M = np.array([0.78, 0.22, 0.42])
HAND_GOAL_M = np.array([0.60, 0.20, 0.42])
GIZMO_SIZE = 0.14
GOALS, BY_HAND = "set two goals", "drag both myself"
NEXT_STEPS = (
    "Take the wrist. Drag the two goals: where the human reaches, and where the robot's hand"
    " should then be.",
    "Give the task a name and record a handful of demonstrations. Each is a little different;"
    " the goals move together.",
    "Press Learn. The running graph knows the task at once: try it with Reach.",
)
NO_TEACHER = (
    "Nobody records yet. `intent demo --dashboard` brings a teacher along; else start one:"
    " `ros2 run intent_recognition task_teacher --ros-args -p library:=tasks -p model:=M.npz`",
)


class TeachTab:
    """The second tab.

    Args:
        server: the page.
        puppet: moves the wrist and the arm.
        lesson: shows, records and learns.
        commands: tells who is there.
        do: runs a function in the thread of the graph.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        puppet: Puppet,
        lesson: Lesson,
        commands: Commands,
        do: Callable[[Callable], None],
    ):
        self._server, self._puppet, self._lesson, self._commands = server, puppet, lesson, commands
        self._do = do
        gui = server.gui
        self._hint = gui.add_html(markup.steps(NEXT_STEPS))
        self._take = gui.add_checkbox("Take the wrist", False)
        self._how = gui.add_dropdown("Show by", (GOALS, BY_HAND))
        self._wrist_goal = gui.add_vector3("Wrist goal [m]", tuple(WRIST_GOAL_M), step=0.01)
        self._hand_goal = gui.add_vector3("Hand goal [m]", tuple(HAND_GOAL_M), step=0.01)
        self._length = gui.add_slider("Duration [s]", 1.0, 4.0, 0.1, 2.0)
        self._vary = gui.add_slider("Variation [cm]", 0.0, 8.0, 0.5, 3.0)
        self._task = gui.add_text("Task", "my_task")
        self._record = gui.add_button("Record a demonstration", icon="player-record", color="red")
        self._learn = gui.add_button("Learn", icon="school", color="green")
        self._undo = gui.add_button("Undo", icon="arrow-back-up")
        self._reach = gui.add_button("Reach to the wrist goal", icon="hand-finger")
        self._told = gui.add_html("")
        self._make_gizmos()
        self._connect()

    def update(self, state: CellState) -> None:
        """Show what can be done now, and what the teacher says."""
        puppet, lesson = self._puppet, self._lesson
        teacher = self._commands.offers(f"{TEACHER}/start")
        taken = puppet.holds_wrist
        set_content(self._hint, markup.steps(NEXT_STEPS if teacher else NO_TEACHER))
        self._take.disabled = not taken and puppet.others_move_wrist()
        ready = taken and teacher and not lesson.busy
        by_hand = self._how.value == BY_HAND
        self._record.disabled = not (ready and puppet.can_move_arm()) and not (
            by_hand and lesson.recording
        )
        label = "Stop recording" if lesson.recording and by_hand else "Record a demonstration"
        if self._record.label != label:
            self._record.label = label
        self._learn.disabled = lesson.busy or not teacher or not lesson.recorded
        learn = f"Learn ({lesson.recorded})" if lesson.recorded else "Learn"
        if self._learn.label != learn:
            self._learn.label = learn
        self._undo.disabled = lesson.busy or not teacher
        self._reach.disabled = not taken or lesson.busy
        self._show_gizmos(taken, by_hand)
        note = "the wrist is moved by another node" if self._take.disabled else state.teaching
        set_content(self._told, markup.remark(note))

    def _make_gizmos(self) -> None:
        scene = self._server.scene

        def gizmo(name: str, position: np.ndarray) -> viser.TransformControlsHandle:
            return scene.add_transform_controls(
                name, GIZMO_SIZE, disable_rotations=True, position=position, visible=False
            )

        self._goal_gizmos = {
            "wrist": gizmo("/goals/wrist", WRIST_GOAL_M),
            "hand": gizmo("/goals/hand", HAND_GOAL_M),
        }
        self._lead_gizmos = {
            "wrist": gizmo("/lead/wrist", REST_M),
            "hand": gizmo("/lead/hand", HAND_GOAL_M),
        }
        for name, text in (("wrist", "human reaches here"), ("hand", "robot's hand here")):
            scene.add_label(f"/goals/{name}/name", text, anchor="top-center")
            scene.add_icosphere(f"/goals/{name}/ball", 0.018, (200, 54, 43), opacity=0.8)

    def _connect(self) -> None:
        do, lesson, puppet = self._do, self._lesson, self._puppet
        self._take.on_update(lambda event: event.client and do(self._take_or_release))
        self._record.on_click(lambda _: do(self._press_record))
        self._learn.on_click(lambda _: do(lesson.learn))
        self._undo.on_click(lambda _: do(lesson.undo))
        self._reach.on_click(lambda _: do(self._press_reach))
        for name, field in (("wrist", self._wrist_goal), ("hand", self._hand_goal)):
            gizmo = self._goal_gizmos[name]
            gizmo.on_update(lambda e, f=field: _write(f, e.target.position))
            field.on_update(lambda e, g=gizmo, f=field: _place(g, e, f.value))
        self._lead_gizmos["wrist"].on_update(
            lambda e: do(lambda: puppet.lead_wrist(np.array(e.target.position)))
        )
        self._lead_gizmos["hand"].on_update(
            lambda e: do(lambda: puppet.lead_hand(np.array(e.target.position)))
        )

    def _take_or_release(self) -> None:
        if self._take.value:
            self._puppet.take_wrist(REST_M)
            self._lead_gizmos["wrist"].position = REST_M
        else:
            self._puppet.release_wrist()

    def _press_record(self) -> None:
        if self._how.value == BY_HAND:
            if self._lesson.recording:
                self._lesson.stop_by_hand()
            else:
                self._lesson.start_by_hand(self._task.value.strip())
            return
        self._lesson.show(
            self._task.value.strip(),
            np.array(self._wrist_goal.value),
            np.array(self._hand_goal.value),
            self._length.value,
            self._vary.value / 100.0,
        )

    def _press_reach(self) -> None:
        self._lesson.reach(np.array(self._wrist_goal.value), self._length.value)

    def _show_gizmos(self, taken: bool, by_hand: bool) -> None:
        for gizmos, shown in (
            (self._goal_gizmos, taken and not by_hand),
            (self._lead_gizmos, taken and by_hand),
        ):
            for gizmo in gizmos.values():
                if gizmo.visible != shown:
                    gizmo.visible = shown
        for field in (self._wrist_goal, self._hand_goal):
            field.disabled = by_hand


def _write(field: viser.GuiVector3Handle, position: np.ndarray) -> None:
    """Show a gizmo's position in its field."""
    field.value = tuple(round(float(v), 3) for v in position)


def _place(gizmo: viser.TransformControlsHandle, event, position: tuple) -> None:
    """Put a gizmo where its field says, if a person typed it."""
    if event.client is not None:
        gizmo.position = np.array(position)
