# SPDX-License-Identifier: Apache-2.0
"""Plots over time: their folder, their range, and their numbers in a real browser."""

import numpy as np
import pytest
from dashboard.browser import visitor

from intent_recognition.dashboard.widgets import TimePlot

CHART = "Object.values(window.__viserTestpoints?.uplots ?? {})[0]?.chart"
SQUEEZE = f"() => {{ const c = {CHART}; c.setSize({{width: 150, height: 165}}); c.redraw(); }}"
"""As in one rendering with a new width and new data; the numbers are still those of before."""


def test_the_folder_of_a_plot_comes_with_it(server):
    """One that came empty to a tab that is not shown would stay folded."""
    plot = TimePlot(server, "Probability")
    for n_times, shown in ((1, False), (2, True)):
        assert plot.due(True, float(n_times)) and not plot._folder.visible
        plot.draw((np.arange(n_times), np.zeros(n_times)), ("plate",), {})
        assert plot._folder.visible is shown
    assert not plot.due(False, 9.0) and not plot._folder.visible


def test_a_plot_has_a_range_whatever_was_not_received(server):
    plot, times = TimePlot(server, "Forces"), np.linspace(-20.0, 0.0, 3)
    for load, low, top in ((np.nan, 0.0, 5.0), (4.0, 0.0, 5.0), (12.0, 0.0, 15.0), (-1, -5.0, 5.0)):
        plot.draw((times, np.array([np.nan, load, 0.0])), ("load",), {})
        below, above = plot._plot.scales["y"]["range"]
        assert below < low <= top < above and above - below < 1.1 * (top - low)


@pytest.mark.slow
def test_the_numbers_of_the_time_follow_the_width(server):
    plot = TimePlot(server, "Probability", 1.0)
    times = np.linspace(-20.0, 0.0, 50)

    def draw():
        plot.draw((times, 0.5 + 0.0 * times), ("plate",), {})

    assert plot.due(True, 0.0)
    draw()
    with visitor() as person:
        numbers = lambda: person.page.evaluate(f"() => {CHART}?.axes[0]._values ?? []")  # noqa: E731
        person.page.goto(f"http://127.0.0.1:{server.get_port()}")
        person.wait_until(lambda: len(numbers()) > 2, "the axis has numbers")
        person.page.evaluate(SQUEEZE)
        draw()
        person.wait_until(lambda: numbers() == ["-20", "0"], f"two numbers for {numbers()}")
