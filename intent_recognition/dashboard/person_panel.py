# SPDX-License-Identifier: Apache-2.0
"""What is believed of one person: probabilities now and over time."""

from collections.abc import Mapping

import viser

from intent_recognition.dashboard import markup
from intent_recognition.dashboard.cell import PLOTTED_S, CellState
from intent_recognition.dashboard.widgets import TimePlot


class PersonPanel:
    """Bars, and a plot below; somebody with a name who is gone is not shown.

    Args:
        server: the page; the panel is made where it is called.
        name: of the person; empty for the only one.
        colour: of the person.
        order: place on the page; None: the last one.
    """

    def __init__(
        self, server: viser.ViserServer, name: str, colour: str = "", order: float | None = None
    ):
        self._name, self._head = name, markup.chip(name, colour) if name else ""
        self.bars = server.gui.add_html("", order=order)
        title = f"Probability over time{f': {name}' if name else ''}"
        self._plot = TimePlot(server, title, 1.0, order)

    def remove(self) -> None:
        """Show nothing any more."""
        self.bars.remove()
        self._plot.remove()

    def update(self, state: CellState, colours: Mapping[str, str], now_s: float) -> None:
        """Show the newest."""
        person = state.people[self._name]
        fresh = state.fresh(person.tasks_at_s, now_s)
        active = state.active if state.helped in ("", self._name) else ""
        shown = not self._name or state.fresh(person.tasks_at_s, now_s, PLOTTED_S)
        self.bars.content = markup.bars(person, active, colours, fresh, self._head) if shown else ""
        labels = person.posterior.labels if person.posterior is not None and shown else ()
        if self._plot.due(bool(labels), now_s):
            self._plot.draw(person.past.columns(labels, now_s), labels, colours)
