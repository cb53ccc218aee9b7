# SPDX-License-Identifier: Apache-2.0
"""Tab with task posteriors, progress of the assembly, forces and the everyday controls."""

from collections.abc import Mapping
from functools import partial

import viser

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import PLOTTED_S, CellState
from intent_recognition.dashboard.commands import ACTIVATION, ESTIMATOR
from intent_recognition.dashboard.plan_panel import PlanPanel
from intent_recognition.dashboard.widgets import PageAccess, TimePlot, set_value
from intent_recognition.report import readable

NEXT_STEPS = (
    "See it work, with a simulated coworker and arm: `intent demo --dashboard`",
    "Your own cell: start tracker and arm, then"
    " `ros2 launch intent_recognition intent.launch.py model:=M.npz`",
    "Or play a recording: tab Replay.",
)


class WatchTab:
    """Shows who does what, and switches nodes on and off."""

    def __init__(self, page: PageAccess, tab: viser.GuiTabHandle):
        gui, commands = page.server.gui, page.commands
        self._page, self._gui, self._tab, self._commands = page, gui, tab, commands
        self._empty = gui.add_html(
            markup.ways("No tracker, arm or estimator publishes yet.", NEXT_STEPS)
        )
        self._question = gui.add_folder("Which task is it?", visible=False)
        self._choices: dict[str, viser.GuiButtonHandle] = {}
        self._people, self._n_met = {"": PersonPanel(page.server, "")}, 0
        self._plan = PlanPanel(page)
        self._transfer_line = gui.add_html("")
        self._forces = TimePlot(page.server, "Forces at the hand over time [N]")
        with gui.add_folder("Controls"):
            self._reset = gui.add_button("Forget the movement", icon=viser.Icon.REFRESH)
            self._helps = gui.add_checkbox("Robot helps", True, hint="activation is active")
            self._guide = gui.add_checkbox(
                "Guide the arm by hand", False, hint="gravity compensation"
            )
        page.on_click(self._reset, self._forget)
        page.on_change(self._helps, lambda: commands.robot_helps(self._helps.value))
        page.on_change(self._guide, lambda: commands.gravity_compensation(self._guide.value))

    def update(
        self, state: CellState, colours: Mapping[str, str], people: Mapping[str, str], now_s: float
    ) -> None:
        """Show the newest state, in the colours of tasks and people."""
        self._empty.visible = not state.joints and not state.believes
        for name in self._people.keys() - state.people.keys():
            self._people.pop(name).remove()
        for name in state.people:
            if name not in self._people:
                with self._tab:  # above the rows that follow the first panel
                    self._n_met += 1
                    order = self._people[""].bars.order + 1e-6 * self._n_met
                    self._people[name] = PersonPanel(self._page.server, name, people[name], order)
            self._people[name].update(state, colours, now_s)
        only = state.people[""]
        asked = only.posterior is not None and state.fresh(only.tasks_at_s, now_s)
        self._ask(state.question(now_s) if asked else ())
        self._plan.update(state)
        self._update_transfer(state, now_s)

    def update_controls(self) -> None:
        """Disable controls without a service, and show whether the robot helps."""
        offers = self._commands.offers
        set_value(self._helps, self._commands.helping)
        self._commands.ask_for_help()
        self._reset.disabled = not offers(f"{ESTIMATOR}/reset")
        self._helps.disabled = not self._commands.can_switch_help()
        self._guide.disabled = not self._commands.can_guide()
        self._plan.update_controls()

    def _update_transfer(self, state: CellState, now_s: float) -> None:
        """Show the forces, if any were received within the plotted time."""
        transfer = state.transfer
        names = transfer.names(now_s)
        self._transfer_line.content = (
            markup.transfer(transfer, state.fresh(transfer.at_s, now_s)) if names else ""
        )
        if self._forces.due(bool(names), now_s):
            columns = transfer.forces.columns(names, now_s)
            self._forces.draw(columns, names, markup.FORCE_COLOURS)

    def _ask(self, tasks: tuple[str, ...]) -> None:
        """Show a button for each task among which the recogniser is undecided."""
        if tasks == tuple(self._choices):
            return
        for button in self._choices.values():
            button.remove()
        self._question.visible = bool(tasks)
        with self._question:
            self._choices = {task: self._gui.add_button(readable(task)) for task in tasks}
        for task, button in self._choices.items():
            self._page.on_click(button, partial(self._commands.answer, task))

    def _forget(self) -> None:
        for node in (ESTIMATOR, ACTIVATION):
            if self._commands.offers(f"{node}/reset"):
                self._commands.trigger(f"{node}/reset")


class PersonPanel:
    """Bars with a plot below; hidden while a named person is not seen."""

    def __init__(
        self, server: viser.ViserServer, name: str, colour: str = "", order: float | None = None
    ):
        self._name, self._head = name, markup.chip(name, colour) if name else ""
        self.bars = server.gui.add_html("", order=order)
        title = f"Probability over time{f': {name}' if name else ''}"
        self._plot = TimePlot(server, title, 1.0, order)

    def remove(self) -> None:
        """Remove the panel."""
        self.bars.remove()
        self._plot.remove()

    def update(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        """Show the newest state."""
        person = state.people[self._name]
        fresh = state.fresh(person.tasks_at_s, now_s)
        active = state.active if state.helped in ("", self._name) else ""
        shown = not self._name or state.fresh(person.tasks_at_s, now_s, PLOTTED_S)
        self.bars.content = markup.bars(person, active, colours, fresh, self._head) if shown else ""
        labels = person.posterior.labels if person.posterior is not None and shown else ()
        if self._plot.due(bool(labels), now_s):
            self._plot.draw(person.past.columns(labels, now_s), labels, colours)
