# SPDX-License-Identifier: Apache-2.0
"""Tab with the statistics of each task's changes, and controls to keep, undo and rate them."""

from functools import partial

import viser

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import CellState, SkillRow
from intent_recognition.dashboard.commands import TEACHER
from intent_recognition.dashboard.scene import rgb
from intent_recognition.dashboard.widgets import PageAccess
from intent_recognition.model import DOWN, TO_KEEP, TO_UNDO, UP
from intent_recognition.report import readable

NOTHING = "Nothing was taught or executed yet, or no teacher runs."
HOW = (
    "Push or guide the arm while it executes: it yields, and goes on from where you leave it."
    " `primitive_activation` needs `correction: lwr` for that.",
    "Keep it: the task moves there. Undo takes the last change back.",
)
UNKNOWN = ("", "-")
THUMBS = {"Good": UP, "Bad": DOWN}
HEAD = ("change", "done", "arrived", "corrected", "good / bad", "spilled")


class SkillsTab:
    """Shows the results of each task's changes, and can undo the last one."""

    def __init__(self, page: PageAccess):
        gui, self._commands = page.server.gui, page.commands
        self._task = ""
        self._hint = gui.add_html(markup.heading("Correct by hand") + markup.steps(HOW))
        self._keep = gui.add_button(
            "Keep the last correction",
            disabled=True,
            icon=viser.Icon.HAND_GRAB,
            color=rgb(markup.GOOD),
        )
        self._undo = gui.add_button(
            "Undo", disabled=True, icon=viser.Icon.ARROW_BACK_UP, color="gray"
        )
        self._last = gui.add_html("")
        self._thumbs = gui.add_button_group("How was it?", tuple(THUMBS), visible=False)
        self._table = gui.add_html("")
        page.on_click(self._keep, partial(page.commands.trigger, f"{TEACHER}/keep"))
        page.on_click(self._undo, partial(page.commands.trigger, f"{TEACHER}/undo"))
        page.on_click(self._thumbs, self._judge)

    def update(self, state: CellState) -> None:
        """Show the changes, and enable what can be done now."""
        self._task = state.active or self._task
        teacher = self._commands.offers(f"{TEACHER}/keep")
        self._keep.disabled = not teacher or not state.any_skill(TO_KEEP)
        self._undo.disabled = not teacher or not state.any_skill(TO_UNDO)
        self._thumbs.visible = teacher and bool(self._task)
        last = f"Last execution: {readable(self._task)}" if self._task else ""
        self._last.content = markup.heading(last)
        self._table.content = skills_table(state.skills)

    def _judge(self) -> None:
        self._commands.tell(self._task, {"thumbs": THUMBS[self._thumbs.value]})


def skills_table(skills: dict[str, list[SkillRow]]) -> str:
    """A table for each task, its newest change first."""
    if not skills:
        return markup.remark(NOTHING)
    return "".join(
        markup.heading(readable(task)) + _task_table([_cells(row) for row in reversed(rows)])
        for task, rows in sorted(skills.items())
    )


def _task_table(rows: list[tuple[str, ...]]) -> str:
    """Table of one task; spilling has a column only where it is measured: the panel is narrow."""
    known = len(HEAD) if any(row[-1] not in UNKNOWN for row in rows) else len(HEAD) - 1
    return markup.table(HEAD[:known], [row[:known] for row in rows])


def _cells(row: SkillRow) -> tuple[str, ...]:
    value = row.values.get
    since = value("since", "")[5:16].replace("T", " ")
    return (
        f"{since}\n{readable(row.what)}".strip(),
        *(value(name, "") for name in ("executions", "arrived", "corrected")),
        f"{value('thumbs up', '')} / {value('thumbs down', '')}",
        value("spilled", ""),
    )
