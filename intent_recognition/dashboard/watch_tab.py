# SPDX-License-Identifier: Apache-2.0
"""The task posterior, its past and the phase; and the everyday controls."""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import viser

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import CellState
from intent_recognition.dashboard.commands import ACTIVATION, ESTIMATOR, Commands
from intent_recognition.dashboard.widgets import on_change, probability_plot, series_of, set_value
from intent_recognition.report import readable

PLOT_PERIOD_S = 0.2
"""Time between two updates of the plot [s]. Convention."""
NO_INPUT = "No tracker, arm or estimator publishes yet."
NEXT_STEPS = (
    "See it work, with a simulated coworker and arm: `intent demo --dashboard`",
    "Your own cell: start tracker and arm, then"
    " `ros2 launch intent_recognition intent.launch.py model:=M.npz`",
    "Or play a recording: tab Replay.",
)


class WatchTab:
    """The first tab."""

    def __init__(
        self, server: viser.ViserServer, commands: Commands, do: Callable[[Callable], None]
    ):
        gui = server.gui
        self._server, self._gui = server, gui
        self._empty = gui.add_html(markup.ways(NO_INPUT, NEXT_STEPS))
        self._bars = gui.add_html("")
        self._plan = gui.add_html("")
        self._question = gui.add_folder("Which task is it?", visible=False)
        self._choices: dict[str, viser.GuiButtonHandle] = {}
        self._do = do
        self._plot: viser.GuiUplotHandle | None = None
        self._plotted: tuple = ()
        self._plotted_at_s = -np.inf
        self._place = gui.add_folder("Probability over time", visible=False)
        with gui.add_folder("Controls"):
            self._reset = gui.add_button("Forget the movement", icon=viser.Icon.REFRESH)
            self._helps = gui.add_checkbox("Robot helps", True, hint="activation is active")
            self._guide = gui.add_checkbox(
                "Guide the arm by hand", False, hint="gravity compensation"
            )
        self._commands = commands
        self._reset.on_click(lambda _: do(self._forget))
        on_change(self._helps, lambda: do(self._set_help))
        on_change(self._guide, lambda: do(self._set_guide))

    def update(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        """Show the newest."""
        present = state.posterior is not None
        self._empty.visible = not present and not state.joints
        fresh = present and state.fresh(state.tasks_at_s, now_s)
        self._bars.content = markup.bars(state, colours, fresh)
        self._plan.content = markup.plan(state.plan)
        self._ask(state.question(now_s) if fresh else ())
        self._place.visible = present
        if present and now_s - self._plotted_at_s >= PLOT_PERIOD_S:
            self._plotted_at_s = now_s
            self._draw(state, colours, now_s)

    def update_controls(self) -> None:
        """Disable controls without a service, and show whether the robot helps."""
        offers = self._commands.offers
        set_value(self._helps, self._commands.helping)
        self._commands.ask_for_help()
        self._reset.disabled = not offers(f"{ESTIMATOR}/reset")
        self._helps.disabled = not self._commands.can_switch_help()
        self._guide.disabled = not self._commands.can_guide()

    def _ask(self, tasks: tuple[str, ...]) -> None:
        """A button for each task in question."""
        if tasks == tuple(self._choices):
            return
        for button in self._choices.values():
            button.remove()
        self._question.visible = bool(tasks)
        with self._question:
            self._choices = {task: self._gui.add_button(readable(task)) for task in tasks}
        for task, button in self._choices.items():
            button.on_click(partial(self._answer, task))

    def _answer(self, task: str, _: viser.GuiEvent) -> None:
        self._do(partial(self._commands.answer, task))

    def _draw(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        times, columns = state.posterior_past(now_s)
        labels = tuple(columns)
        if len(times) < 2:
            return
        data = (times, *columns.values())
        look = series_of(labels, colours)
        if self._plot is None:
            with self._place:
                self._plot = probability_plot(self._gui, data, labels, colours)
        elif look == self._plotted:
            self._plot.data = data
        else:
            with self._server.atomic():
                self._plot.series, self._plot.data = look, data
        self._plotted = look

    def _forget(self) -> None:
        for node in (ESTIMATOR, ACTIVATION):
            if self._commands.offers(f"{node}/reset"):
                self._commands.trigger(f"{node}/reset")

    def _set_help(self) -> None:
        self._commands.robot_helps(self._helps.value)

    def _set_guide(self) -> None:
        self._commands.gravity_compensation(self._guide.value)
