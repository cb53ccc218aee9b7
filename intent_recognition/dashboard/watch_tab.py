# SPDX-License-Identifier: Apache-2.0
"""What the graph thinks: task posterior, its past, phase; and the everyday controls."""

from collections.abc import Callable, Mapping

import numpy as np
import viser
from viser import uplot

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import HISTORY_S, CellState
from intent_recognition.dashboard.commands import ACTIVATION, ESTIMATOR, Commands

PLOT_PERIOD_S = 0.2
PLOT_HEIGHT = 190
FONT = "12px sans-serif"
NOBODY = "No tracker, arm or estimator is heard yet."
NEXT_STEPS = (
    "See it work, with a simulated coworker and arm: `intent demo --dashboard`",
    "Your own cell: start tracker and arm, then"
    " `ros2 launch intent_recognition intent.launch.py model:=M.npz`",
    "Or play a recording: tab Replay.",
)


class WatchTab:
    """The first tab.

    Args:
        server: the page.
        commands: what the buttons do.
        do: runs a function in the thread of the graph.
    """

    def __init__(
        self, server: viser.ViserServer, commands: Commands, do: Callable[[Callable], None]
    ):
        gui = server.gui
        self._server, self._gui = server, gui
        self._empty = gui.add_html(markup.ways(NOBODY, NEXT_STEPS))
        self._bars = gui.add_html("")
        self._plot: viser.GuiUplotHandle | None = None
        self._plotted: tuple = ()
        self._plotted_at_s = -np.inf
        self._place = gui.add_folder("Probability over time", visible=False)
        with gui.add_folder("Controls"):
            self._reset = gui.add_button("Forget the movement", icon="refresh")
            self._helps = gui.add_checkbox("Robot helps", True, hint="activation is active")
            self._guide = gui.add_checkbox(
                "Guide the arm by hand", False, hint="gravity compensation"
            )
        self._commands = commands
        self._reset.on_click(lambda _: do(self._forget))
        self._helps.on_update(lambda e: e.client and do(self._set_help))
        self._guide.on_update(lambda e: e.client and do(self._set_guide))

    def update(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        """Show the newest."""
        heard = state.posterior is not None
        self._empty.visible = not heard and not state.joints
        fresh = heard and state.fresh(state.tasks_at_s, now_s)
        set_content(self._bars, markup.bars(state, colours, fresh))
        self._place.visible = heard
        if heard and now_s - self._plotted_at_s >= PLOT_PERIOD_S:
            self._plotted_at_s = now_s
            self._draw(state, colours, now_s)

    def update_controls(self) -> None:
        """Disable what nobody offers, and show whether the robot helps."""
        offers = self._commands.offers
        self._helps.value = self._commands.helping
        self._commands.ask_for_help()
        self._reset.disabled = not offers(f"{ESTIMATOR}/reset")
        self._helps.disabled = not self._commands.can_switch_help()
        self._guide.disabled = not self._commands.can_guide()

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


def probability_plot(
    gui: viser.GuiApi,
    data: tuple[np.ndarray, ...],
    labels: tuple[str, ...],
    colours: Mapping[str, str],
    first_s: float = -HISTORY_S,
    last_s: float = 0.0,
    title: str | None = None,
) -> viser.GuiUplotHandle:
    """Probabilities of tasks over time [s]."""
    axis = {"stroke": markup.SOFT, "grid": {"stroke": markup.RULE}, "font": FONT}
    return gui.add_uplot(
        data=data,
        series=series_of(labels, colours),
        title=title,
        scales={
            "x": uplot.Scale(time=False, auto=False, range=(first_s, last_s)),
            "y": uplot.Scale(auto=False, range=(-0.02, 1.06)),
        },
        axes=(
            uplot.Axis(label="time [s]", size=34, labelSize=18, labelFont=FONT, **axis),
            uplot.Axis(label="probability", size=40, labelSize=18, labelFont=FONT, **axis),
        ),
        legend=uplot.Legend(show=False),
        height=PLOT_HEIGHT,
    )


def series_of(labels: tuple[str, ...], colours: Mapping[str, str]) -> tuple[uplot.Series, ...]:
    """Time and one curve per task, in its colour."""
    series = [uplot.Series(label="time [s]")]
    for label in labels:
        width = 1.5 if label == "none" else 2.5
        name = label.replace("_", " ")
        series.append(
            uplot.Series(label=name, stroke=colours.get(label, markup.STALE), width=width)
        )
    return tuple(series)


def set_content(handle: viser.GuiHtmlHandle, content: str) -> None:
    """Change a piece of the page only where it is another one."""
    if handle.content != content:
        handle.content = content
