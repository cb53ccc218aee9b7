# SPDX-License-Identifier: Apache-2.0
"""Progress of an assembly, and controls to change, undo and save its plan."""

from collections import deque
from collections.abc import Callable
from functools import partial

import viser

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.commands import ESTIMATOR
from intent_recognition.dashboard.widgets import PageAccess, set_value
from intent_recognition.errors import ArgumentError
from intent_recognition.plans import WorkPlan, moved, ordered, required, without, write_plan

SAVE = f"{ESTIMATOR}/save_plan"
CHANGES: dict[str, Callable[[WorkPlan, str], WorkPlan]] = {
    "Earlier": lambda plan, step: moved(plan, step, -1),
    "Later": lambda plan, step: moved(plan, step, 1),
    "Require": required,
    "Forget": without,
}
MUST, NEED_NOT = "Must wait", "Need not"


class PlanPanel:
    """A folder of controls, visible while there is a plan.

    Changes are sent as the parameter `plan` of the node that holds the plan, which checks them.
    """

    def __init__(self, page: PageAccess):
        gui, self._commands = page.server.gui, page.commands
        self._plan: WorkPlan | None = None
        self._before: deque[WorkPlan] = deque(maxlen=20)
        self._folder = gui.add_folder("Plan of the assembly", visible=False)
        with self._folder:
            self._list = gui.add_html("")
            with gui.add_folder("Change the plan", expand_by_default=False):
                self._step = gui.add_dropdown("Step", ("",))
                about = "Require: it is part of every assembly. Forget: of none."
                self._change = gui.add_button_group("", tuple(CHANGES), hint=about)
                self._other = gui.add_dropdown("Waits for", ("",))
                self._wait = gui.add_button_group("", (MUST, NEED_NOT))
                self._undo = gui.add_button(
                    "Undo", disabled=True, icon=viser.Icon.ARROW_BACK_UP, color="gray"
                )
                self._save = gui.add_button("Save", icon=viser.Icon.DEVICE_FLOPPY, color="gray")
        page.on_click(self._change, self._press_change)
        page.on_click(self._wait, self._press_wait)
        page.on_click(self._undo, self._press_undo)
        page.on_click(self._save, partial(page.commands.trigger, SAVE))

    def update(self, state: CellState) -> None:
        """Show the plan in force and its progress."""
        self._list.content = markup.plan(state.plan, state.progress)
        if state.plan == self._plan:
            return
        self._plan = state.plan
        self._folder.visible = state.plan is not None
        if state.plan is not None:
            names = state.plan.names
            for field, at_first in ((self._step, names[-1]), (self._other, names[0])):
                chosen = field.value
                field.options = names
                set_value(field, chosen if chosen in names else at_first)

    def update_controls(self) -> None:
        """Disable the controls that have no effect now."""
        self._undo.disabled = not self._before
        self._save.disabled = not self._commands.offers(SAVE)

    def _press_change(self) -> None:
        if (plan := self._plan) is not None:
            self._send_change(plan, CHANGES[self._change.value](plan, self._step.value))

    def _press_wait(self) -> None:
        if (plan := self._plan) is None:
            return
        if self._other.value == self._step.value:
            cure = "Choose another one."
            raise ArgumentError.about("Waits for", "another step", self._step.value, cure)
        must = self._wait.value == MUST
        self._send_change(plan, ordered(plan, self._other.value, self._step.value, must))

    def _press_undo(self) -> None:
        if self._before:
            self._send(self._before[-1], self._before.pop)

    def _send_change(self, before: WorkPlan, plan: WorkPlan) -> None:
        """Put a changed plan in force; the one before can then be restored."""
        self._send(plan, lambda: self._before.append(before), "the plan is changed")

    def _send(self, plan: WorkPlan, taken: Callable[[], object], said: str = "") -> None:
        def done(ok: bool, why: str) -> None:
            if ok:
                taken()
            self._commands.notify(ok, why or said)

        self._commands.set_parameter(ESTIMATOR, "plan", write_plan(plan), done)
