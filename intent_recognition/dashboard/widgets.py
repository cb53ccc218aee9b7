# SPDX-License-Identifier: Apache-2.0
"""What the tabs have in common: a plot of probabilities, and small changes of viser's controls."""

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
import viser
from numpy.typing import NDArray
from viser import uplot

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import PLOTTED_S
from intent_recognition.promp import NONE
from intent_recognition.report import NONE_COLOUR, SOFT, readable

FONT = "12px sans-serif"
ControlValue = TypeVar("ControlValue")


def on_change(handle: viser.GuiInputHandle, action: Callable[[], object]) -> None:
    """Call `action` when a person changes a control, not when the program does."""

    def update(event: viser.GuiEvent) -> None:
        if event.client is not None:
            action()

    handle.on_update(update)


def set_value(handle: viser.GuiInputHandle[ControlValue], value: ControlValue) -> None:
    """Change the value of a control."""
    handle.value = value  # type: ignore[misc]  # viser 1.0 has a method before the setter


def slider_value(handle: viser.GuiSliderHandle) -> float:
    """Where a slider stands, inside its range whatever a browser has sent."""
    return float(min(max(handle.value, handle.min), handle.max))


def probability_plot(
    gui: viser.GuiApi,
    data: tuple[NDArray[np.float64], ...],
    labels: tuple[str, ...],
    colours: Mapping[str, str],
    first_s: float = -PLOTTED_S,
    last_s: float = 0.0,
    title: str | None = None,
) -> viser.GuiUplotHandle:
    """Probabilities of tasks over time [s]; what is around it says so, an axis has no room."""
    return gui.add_uplot(
        data=data,
        series=series_of(labels, colours),
        title=title,
        scales={
            "x": uplot.Scale(time=False, auto=False, range=(first_s, last_s)),
            "y": uplot.Scale(auto=False, range=(-0.02, 1.06)),
        },
        axes=(_axis("time [s]", 34), _axis("", 46)),
        legend=uplot.Legend(show=False),
        height=190,
    )


def _axis(label: str, size: int) -> uplot.Axis:
    return uplot.Axis(
        label=label,
        size=size,
        labelSize=18,
        labelFont=FONT,
        font=FONT,
        stroke=SOFT,
        grid={"stroke": markup.RULE},
    )


def series_of(labels: tuple[str, ...], colours: Mapping[str, str]) -> tuple[uplot.Series, ...]:
    """Time and one curve per task, in its colour."""
    series = [uplot.Series(label="time [s]")]
    for label in labels:
        width = 1.5 if label == NONE else 2.5
        name = readable(label)
        series.append(uplot.Series(label=name, stroke=colours.get(label, NONE_COLOUR), width=width))
    return tuple(series)
