# SPDX-License-Identifier: Apache-2.0
"""Teach a task without hardware: the wrist and the arm's hand are led from the page."""

from collections.abc import Callable

import numpy as np
import viser

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.commands import TEACHER, Commands
from intent_recognition.dashboard.gizmos import GOALS, HAND, LEADS, WRIST, Gizmos
from intent_recognition.dashboard.lesson import Lesson
from intent_recognition.dashboard.puppet import Puppet
from intent_recognition.dashboard.scene import rgb
from intent_recognition.dashboard.watch_tab import set_content
from intent_recognition.kinematics import hand_position

REST_M = np.array([1.05, 0.0, 0.25])
WRIST_GOAL_M = np.array([0.78, 0.22, 0.42])
HAND_GOAL_M = np.array([0.60, 0.20, 0.42])
SET_GOALS, BY_HAND = "set two goals", "drag both myself"
FEW = 3
"""Demonstrations of a task from which on it is worth learning."""
TAKE = "Tick `Take the wrist`."
BY_GOALS = (
    TAKE,
    "Drag the two goals: where the human reaches, and where the robot's hand should then be. Name"
    f" the task and press `Record` {FEW} times or more; each time is a little different.",
    "Press `Learn`: the running graph knows the task at once.",
    "Press `Reach`: the robot should help.",
)
BY_POINTER = (
    TAKE,
    "Name the task. Press `Record`, drag the wrist, then the robot's hand, and press `Stop`;"
    f" {FEW} times or more.",
    BY_GOALS[2],
    "Drag the wrist again: the robot should help.",
)
NOBODY_RECORDS = "Nobody records yet."
NO_TEACHER = (
    "The demo brings a teacher along: `intent demo --dashboard`",
    "Or start one:"
    " `ros2 run intent_recognition task_teacher --ros-args -p library:=tasks -p model:=M.npz`",
)
NOT_FREE = "Another node moves the wrist."
OTHERS = ("With the demo: wait until the coworker is done.", "With a tracker: stop it.")
NO_ARM = "No arm is heard that can be moved from here."
ARMS = ("It must be an LWR that takes `joint_trajectory`: the demo has one.",)
RECORD = "Record a demonstration"


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
        self._puppet, self._lesson, self._commands, self._do = puppet, lesson, commands, do
        self._rested = False
        gui = server.gui
        self._hint = gui.add_html("")
        self._take = gui.add_checkbox("Take the wrist", False)
        self._how = gui.add_dropdown("Show by", (SET_GOALS, BY_HAND))
        self._task = gui.add_text("Task", "my_task", hint="label of what is recorded")
        with gui.add_folder("Goals: x, y, z [m]") as self._goals:
            self._wrist_goal = gui.add_vector3("Human's wrist", tuple(WRIST_GOAL_M), step=0.01)
            self._hand_goal = gui.add_vector3("Robot's hand", tuple(HAND_GOAL_M), step=0.01)
            self._length = gui.add_slider("Duration [s]", 1.0, 4.0, 0.1, 2.0)
            self._vary = gui.add_slider("Variation [cm]", 0.0, 8.0, 0.5, 3.0)
        self._record = gui.add_button(RECORD, icon="player-record", color=rgb(markup.BAD))
        self._learn = gui.add_button("Learn", icon="school", color=rgb(markup.GOOD))
        self._reach = gui.add_button("Reach to the wrist goal", icon="hand-finger")
        self._undo = gui.add_button("Undo", icon="arrow-back-up", color="gray")
        self._told = gui.add_html("")
        self._gizmos = Gizmos(server, {WRIST: WRIST_GOAL_M, HAND: HAND_GOAL_M})
        self._connect()

    def update(self, state: CellState) -> None:
        """Show what can be done now, what is next, and what the teacher says."""
        puppet, lesson = self._puppet, self._lesson
        teacher = self._commands.offers(f"{TEACHER}/start")
        taken, by_hand = puppet.holds_wrist, self._how.value == BY_HAND
        obstacle = self._obstacle(teacher, taken)
        steps = BY_POINTER if by_hand else BY_GOALS
        set_content(self._hint, obstacle or markup.steps(steps, self._steps_done(taken)))
        self._take.disabled = not taken and puppet.others_move_wrist()
        stops = by_hand and lesson.recording
        free = taken and teacher and not obstacle and not lesson.busy
        self._record.disabled = not (free or stops)
        _label(self._record, "Stop" if stops else RECORD)
        self._learn.disabled = lesson.busy or not teacher or not lesson.recorded
        _label(self._learn, f"Learn ({lesson.recorded})" if lesson.recorded else "Learn")
        self._undo.disabled = lesson.busy or not teacher
        self._reach.disabled = not taken or lesson.busy
        for field in (self._task, self._record, self._learn, self._undo):
            field.visible = teacher
        self._goals.visible = self._reach.visible = not by_hand
        self._update_gizmos(LEADS if by_hand else GOALS, taken)
        set_content(self._told, markup.remark(state.teaching))

    def _obstacle(self, teacher: bool, taken: bool) -> str:
        """What has to be mended before anything can be recorded, and how; empty if nothing."""
        if not teacher:
            return markup.ways(NOBODY_RECORDS, NO_TEACHER)
        if not taken and self._puppet.others_move_wrist():
            return markup.ways(NOT_FREE, OTHERS)
        if not self._puppet.can_move_arm():
            return markup.ways(NO_ARM, ARMS)
        return ""

    def _steps_done(self, taken: bool) -> int:
        """How many of the steps are behind."""
        lesson = self._lesson
        if not taken:
            return 0
        if lesson.recorded:
            return 2 if lesson.recorded >= FEW else 1
        return 3 if lesson.learned else 1

    def _update_gizmos(self, kind: str, taken: bool) -> None:
        """Show the pair in use; the leading pair is where wrist and hand are at rest."""
        shown = self._gizmos.show(kind if taken else None)
        rests = not self._lesson.busy
        if kind == LEADS and taken and (shown or (rests and not self._rested)):
            self._gizmos.place(LEADS, WRIST, self._puppet.position)
            if self._puppet.can_move_arm():
                self._gizmos.place(LEADS, HAND, hand_position(self._puppet.measured()))
        self._rested = rests

    def _connect(self) -> None:
        do, lesson, puppet, gizmos = self._do, self._lesson, self._puppet, self._gizmos
        self._take.on_update(lambda event: event.client and do(self._take_or_release))
        self._record.on_click(lambda _: do(self._press_record))
        self._learn.on_click(lambda _: do(lesson.learn))
        self._undo.on_click(lambda _: do(lesson.undo))
        self._reach.on_click(lambda _: do(self._press_reach))
        for body, field in ((WRIST, self._wrist_goal), (HAND, self._hand_goal)):
            gizmos.on_moved(GOALS, body, lambda place, f=field: _write(f, place))
            field.on_update(
                lambda event, b=body, f=field: (
                    event.client and gizmos.place(GOALS, b, np.array(f.value))
                )
            )
        gizmos.on_moved(LEADS, WRIST, lambda place: do(lambda: puppet.lead_wrist(place)))
        gizmos.on_moved(LEADS, HAND, lambda place: do(lambda: puppet.lead_hand(place)))

    def _take_or_release(self) -> None:
        if self._take.value:
            self._puppet.take_wrist(REST_M)
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


def _write(field: viser.GuiVector3Handle, position: np.ndarray) -> None:
    """Show a gizmo's position in its field."""
    field.value = tuple(round(float(v), 3) for v in position)


def _label(button: viser.GuiButtonHandle, text: str) -> None:
    if button.label != text:
        button.label = text
