# SPDX-License-Identifier: Apache-2.0
"""A plot over time, as a browser shows it."""

import numpy as np
import pytest
from dashboard.browser import visitor

from intent_recognition.dashboard.widgets import TimePlot

CHART = "Object.values(window.__viserTestpoints?.uplots ?? {})[0]?.chart"
SQUEEZE = f"() => {{ const c = {CHART}; c.setSize({{width: 150, height: 165}}); c.redraw(); }}"
"""As in one rendering with a new width and new data; the numbers are still those of before."""


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
