# SPDX-License-Identifier: Apache-2.0
"""Shared parts of the tabs: a plot over time, and helpers for viser's controls."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
import viser
from viser import uplot

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.cell import PLOTTED_S
from intent_recognition.dashboard.commands import Commands
from intent_recognition.promp import NONE
from intent_recognition.report import NONE_COLOUR, readable

FONT = "12px sans-serif"
PULSE = uplot.Series(scale="pulse", points={"show": False})
"""Invisible series that changes at each drawing to force uPlot to lay out its axes. Otherwise a new
width and new data that arrive together, as when the page opens, leave the axes without numbers."""
ControlValue = TypeVar("ControlValue")


class PageAccess(NamedTuple):
    """What the parts of the page need; a part adds its controls where it is constructed."""

    server: viser.ViserServer
    commands: Commands  # service calls to other nodes, and notifications
    do: Callable[[Callable[[], None]], None]  # runs it in the graph's thread, at the next update

    def on_click(
        self, button: viser.GuiButtonHandle | viser.GuiButtonGroupHandle, action: Callable
    ) -> None:
        """Run an action in the graph's thread whenever a button is pressed."""
        button.on_click(lambda _: self.do(action))

    def on_change(self, handle: viser.GuiInputHandle, action: Callable) -> None:
        """Run an action when a person changes a control, but not when the program does."""

        def update(event: viser.GuiEvent) -> None:
            if event.client is not None:
                self.do(action)

        handle.on_update(update)


def set_value(handle: viser.GuiInputHandle[ControlValue], value: ControlValue) -> None:
    """Change the value of a control."""
    handle.value = value  # type: ignore[misc]  # viser 1.0 has a method before the setter


def slider_value(handle: viser.GuiSliderHandle) -> float:
    """Value of a slider, clipped to its range whatever a browser sent."""
    return float(min(max(handle.value, handle.min), handle.max))


class TimePlot:
    """Curves over the last seconds, in a folder that is shown while there is data.

    The title names the quantity and its unit. The height fits the data, in whole steps. Without an
    order the folder comes last.
    """

    def __init__(
        self, server: viser.ViserServer, title: str, step: float = 5.0, order: float | None = None
    ):
        self._server, self._step = server, step
        self._folder = server.gui.add_folder(title, visible=False, order=order)
        self._plot: viser.GuiUplotHandle | None = None
        self._drawn_at_s, self._pulse = -np.inf, False

    def remove(self) -> None:
        """Remove the plot from the page."""
        self._folder.remove()

    def due(self, visible: bool, now_s: float) -> bool:
        """Show or hide the plot; return whether it should be redrawn now."""
        self._folder.visible = visible and self._plot is not None  # viser keeps an empty one folded
        if not visible or now_s - self._drawn_at_s < 0.2:
            return False
        self._drawn_at_s = now_s
        return True

    def draw(
        self, columns: tuple[Floats, ...], names: Sequence[str], colours: Mapping[str, str]
    ) -> None:
        """Draw times (T,) [s] and the named curves (T,)."""
        if len(columns[0]) < 2:
            return
        look = (*series_of(names, colours), PULSE)
        step = self._step  # uPlot itself finds no range where there is NaN: nothing was received
        low = step * math.floor(np.nanmin(columns[1:], initial=0.0) / step)
        top = step * math.ceil(np.nanmax(columns[1:], initial=step) / step)
        self._pulse = not self._pulse
        columns = (*columns, np.full(len(columns[0]), float(self._pulse)))
        if self._plot is None:
            with self._folder:
                self._plot = time_plot(self._server.gui, columns, look, (low, top))
            self._folder.visible = True
            return
        scales = {**(self._plot.scales or {}), "y": _height(low, top)}
        with self._server.atomic():
            if (look, scales) != (self._plot.series, self._plot.scales):
                self._plot.series, self._plot.scales = look, scales
            self._plot.data = columns


def time_plot(
    gui: viser.GuiApi,
    columns: tuple[Floats, ...],
    series: tuple[uplot.Series, ...],
    height: tuple[float, float] = (0.0, 1.0),
    times_s: tuple[float, float] = (-PLOTTED_S, 0.0),
    title: str | None = None,
) -> viser.GuiUplotHandle:
    """Curves over time [s]; axes have no room for labels, so the surroundings name the quantity."""
    return gui.add_uplot(
        data=columns,
        series=series,
        title=title,
        scales={"x": uplot.Scale(time=False, auto=False, range=times_s), "y": _height(*height)},
        axes=(_axis("time [s]", 34), _axis("", 46)),
        legend=uplot.Legend(show=False),
        height=165,
        padding=(8, 20, 0, 0),  # leaves room for the uppermost number
    )


def _height(low: float, top: float) -> uplot.Scale:
    """A range in which thick curves at its smallest and largest value are seen whole."""
    return uplot.Scale(auto=False, range=(low - 0.02 * (top - low), top + 0.06 * (top - low)))


def _axis(label: str, size: int) -> uplot.Axis:
    return uplot.Axis(
        label=label,
        size=size,
        labelSize=18,
        labelFont=FONT,
        font=FONT,
        stroke=NONE_COLOUR,
        grid={"stroke": "rgba(128, 140, 153, 0.22)"},
    )


def series_of(names: Sequence[str], colours: Mapping[str, str]) -> tuple[uplot.Series, ...]:
    """The time series and one named curve each, in its colour."""
    series = [uplot.Series(label="time [s]")]
    for name in names:
        width, colour = 1.5 if name == NONE else 2.5, colours.get(name, NONE_COLOUR)
        series.append(uplot.Series(label=readable(name), stroke=colour, width=width))
    return tuple(series)
