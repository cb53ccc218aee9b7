# SPDX-License-Identifier: Apache-2.0
"""Tab to teach a task without hardware: the page moves the wrist and the arm's hand."""

from functools import partial

import numpy as np
import viser

from intent_recognition.array_types import Floats
from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.commands import TEACHER
from intent_recognition.dashboard.drag_handles import DIRECT, GOALS, HAND, WRIST, DragHandles
from intent_recognition.dashboard.scene import rgb
from intent_recognition.dashboard.teaching_session import TeachingSession
from intent_recognition.dashboard.teleoperation import Teleoperation
from intent_recognition.dashboard.widgets import PageAccess, set_value, slider_value
from intent_recognition.model import TO_UNDO

SET_GOALS, BY_HAND = "set two goals", "drag both myself"
FEW = 3
"""Number of demonstrations that a person is asked to record before learning."""
RECORD, REACH = "Record a demonstration", "Reach to the wrist goal"
TAKE = "Tick `Take the wrist`."
BY_GOALS = (
    TAKE,
    "Drag the two goals: where the human reaches, and where the robot's hand should then be. Name"
    f" the task and press `{RECORD}` {FEW} times or more; each time is a little different.",
    "Press `Learn`: the running graph knows the task at once.",
    f"Press `{REACH}`: the robot should help.",
)
BY_POINTER = (
    TAKE,
    f"Name the task. Press `{RECORD}`, drag the wrist, then the robot's hand, and press `Stop`;"
    f" {FEW} times or more.",
    BY_GOALS[2],
    "Drag the wrist again: the robot should help.",
)
NO_TEACHER = (
    "The demo starts a teacher: `intent demo --dashboard`",
    "Or start one:"
    " `ros2 run intent_recognition task_teacher --ros-args -p library:=tasks -p model:=M.npz`",
)
OTHERS = ("With the demo: wait until the coworker is done.", "With a tracker: stop it.")
NO_ARM = "No arm that can be moved from here publishes its joint states."
ARMS = (
    "The demo has one; yours must take the topic `joint_trajectory`",
    "Other arms than the LWR need a URDF on robot_description, and pinocchio: `pip install pin`",
)


class TeachTab:
    """Records and learns demonstrations given on the page."""

    def __init__(self, page: PageAccess, teleoperation: Teleoperation, session: TeachingSession):
        self._page, self._commands = page, page.commands
        self._teleoperation, self._session = teleoperation, session
        self._rested = self._helped = False
        server, gui = page.server, page.server.gui
        self._hint = gui.add_html("")
        self._take = gui.add_checkbox("Take the wrist", False)
        self._how = gui.add_dropdown("Show by", (SET_GOALS, BY_HAND))
        self._task = gui.add_text("Task", "my_task", hint="label of what is recorded")
        with gui.add_folder("Goals: x, y, z [m]") as self._goals:
            self._wrist_goal = gui.add_vector3("Human's wrist", (0.78, 0.22, 0.42), step=0.01)
            self._hand_goal = gui.add_vector3("Robot's hand", (0.60, 0.20, 0.42), step=0.01)
            self._length = gui.add_slider("Duration [s]", 1.0, 4.0, 0.1, 2.0)
            self._vary = gui.add_slider("Variation [cm]", 0.0, 8.0, 0.5, 3.0)
        self._record = gui.add_button(RECORD, icon=viser.Icon.PLAYER_RECORD, color=rgb(markup.BAD))
        self._learn = gui.add_button("Learn", icon=viser.Icon.SCHOOL, color=rgb(markup.GOOD))
        self._discard = gui.add_button("Discard the last one", icon=viser.Icon.TRASH, color="gray")
        self._reach = gui.add_button(REACH, icon=viser.Icon.HAND_FINGER)
        self._undo = gui.add_button("Undo", icon=viser.Icon.ARROW_BACK_UP, color="gray")
        self._status = gui.add_html("")
        goals = {WRIST: self._wrist_goal, HAND: self._hand_goal}
        self._handles = DragHandles(
            server, {body: np.array(goal.value) for body, goal in goals.items()}
        )
        self._connect()

    def update(self, state: CellState) -> None:
        """Show the possible actions, the next step and the teacher's status."""
        teleoperation, session = self._teleoperation, self._session
        teacher = self._commands.offers(f"{TEACHER}/start")
        taken, by_hand = teleoperation.holds_wrist, self._how.value == BY_HAND
        obstacle = self._obstacle(teacher, taken)
        came = session.learned and state.active == self._task.value.strip()
        self._helped = (self._helped or came) and not state.waiting
        steps = BY_POINTER if by_hand else BY_GOALS
        self._hint.content = obstacle or markup.steps(steps, self._steps_done(state.waiting, taken))
        others = not taken and teleoperation.others_move_wrist()
        self._take.disabled = others or session.busy
        stops = by_hand and session.recording
        free = taken and teacher and not obstacle and not session.busy
        self._record.disabled = not (free or stops)
        self._record.label = "Stop" if stops else RECORD
        self._learn.disabled = session.busy or not teacher or not state.waiting
        self._learn.label = f"Learn ({state.waiting})" if state.waiting else "Learn"
        self._discard.disabled = not (stops or (teacher and state.waiting and not session.busy))
        self._undo.disabled = session.busy or not teacher or not state.any_skill(TO_UNDO)
        self._reach.disabled = not taken or session.busy
        for field in (self._task, self._record, self._learn, self._discard, self._undo):
            field.visible = teacher
        self._goals.visible = self._reach.visible = not by_hand
        self._update_handles(DIRECT if by_hand else GOALS, taken)
        self._status.content = markup.remark(state.teaching)

    def _obstacle(self, teacher: bool, taken: bool) -> str:
        """What prevents recording and how to mend it; empty if nothing does."""
        if not teacher:
            return markup.ways("No teacher is running.", NO_TEACHER)
        if not taken and self._teleoperation.others_move_wrist():
            return markup.ways("Another node moves the wrist.", OTHERS)
        if not self._teleoperation.can_move_arm():
            return markup.ways(self._teleoperation.arm_problem or NO_ARM, ARMS)
        return ""

    def _steps_done(self, waiting: int, taken: bool) -> int:
        """Number of completed steps."""
        session = self._session
        if not taken:
            return 0
        if waiting:
            return 2 if waiting >= FEW else 1
        if session.learned:
            return 4 if self._helped else 3
        return 1

    def _update_handles(self, kind: str, taken: bool) -> None:
        """Show the pair of handles in use, with the leading pair at wrist and hand."""
        shown = self._handles.show(kind if taken else None)
        rests = not self._session.busy
        if kind == DIRECT and taken and (shown or (rests and not self._rested)):
            self._handles.place(DIRECT, WRIST, self._teleoperation.position)
            if self._teleoperation.can_move_arm():
                self._handles.place(DIRECT, HAND, self._teleoperation.hand())
        self._rested = rests

    def _connect(self) -> None:
        page, session = self._page, self._session
        teleoperation, handles = self._teleoperation, self._handles
        page.on_change(self._take, self._take_or_release)
        page.on_click(self._record, self._press_record)
        page.on_click(self._learn, session.learn)
        page.on_click(self._discard, session.discard)
        page.on_click(self._undo, partial(page.commands.trigger, f"{TEACHER}/undo"))
        page.on_click(self._reach, self._press_reach)
        for body, field in ((WRIST, self._wrist_goal), (HAND, self._hand_goal)):
            self._join(body, field)
        handles.on_moved(DIRECT, WRIST, lambda to: page.do(partial(teleoperation.drag_wrist, to)))
        handles.on_moved(DIRECT, HAND, lambda to: page.do(partial(session.drag_hand, to)))

    def _join(self, body: str, field: viser.GuiVector3Handle) -> None:
        """Keep a goal's handle and its number field in step."""

        def dragged(position: Floats) -> None:
            x, y, z = (round(float(value), 3) for value in position)
            set_value(field, (x, y, z))

        self._handles.on_moved(GOALS, body, dragged)
        self._page.on_change(field, lambda: self._handles.place(GOALS, body, np.array(field.value)))

    def _take_or_release(self) -> None:
        if self._take.value:
            self._teleoperation.take_wrist(np.array([1.05, 0.0, 0.25]))
        elif self._session.busy:
            set_value(self._take, True)
        else:
            self._teleoperation.release_wrist()

    def _press_record(self) -> None:
        if self._how.value == BY_HAND:
            if self._session.recording:
                self._session.stop_by_hand()
            else:
                self._session.start_by_hand(self._task.value.strip())
            return
        self._session.show(
            self._task.value.strip(),
            np.array(self._wrist_goal.value),
            np.array(self._hand_goal.value),
            slider_value(self._length),
            slider_value(self._vary) / 100.0,
        )

    def _press_reach(self) -> None:
        self._session.reach(np.array(self._wrist_goal.value), slider_value(self._length))
