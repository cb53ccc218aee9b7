# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: a plot over time, and what is dragged into the real graph."""

import numpy as np
import pytest
from dashboard.browser import Visitor, chromium, free_port, visitor
from geometry_msgs.msg import PoseStamped
from ros_harness import NodeProcess
from sensor_msgs.msg import JointState

from intent_recognition.dashboard.teach_tab import BY_HAND
from intent_recognition.dashboard.widgets import TimePlot
from intent_recognition.kinematics.lwr import JOINT_NAMES, hand_position
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import joint_values, position_array

WRIST, HAND = "/direct/wrist", "/direct/hand"
SHAFT_M = 0.08
"""So far along an axis of the control its shaft is pressed."""
MOVED_M, LOST_S = 0.03, 15.0
"""So far it must go [m]; after so long a drag was lost [s]."""


@pytest.fixture
def cell():
    """An arm and the page in processes of their own; the page's port."""
    chromium()
    port = free_port()
    words = ("--ros-args", "-p", f"port:={port}", "-p", "rate:=10.0")
    arm = NodeProcess("sim_bridge.nodes.lwr_sim")
    with arm, NodeProcess("intent_recognition.dashboard.node", *words):
        yield port


@pytest.mark.slow
def test_what_is_dragged_on_the_page_moves_in_the_graph(cell, harness):
    """Far along one axis, and not along others; the simulated arm is soft."""
    poses = harness.collect(PoseStamped, "mocap/wrist/pose", qos.SENSOR)
    states = harness.collect(JointState, "joint_states", qos.STATE)

    def wrist():
        return position_array(poses[-1].pose)

    def hand():
        return hand_position(joint_values(states[-1], JOINT_NAMES))

    def rests(where):
        before = where()
        for _ in range(200):
            harness.executor.spin_once(timeout_sec=0.0025)
        return np.linalg.norm(where() - before) < 1e-3

    with visitor() as person:
        person.open(cell)
        person.wait_for("robot: waits")
        person.tab("Teach")
        person.page.get_by_label("Take the wrist").check()
        person.choose("Show by", BY_HAND)
        for node, where, tolerance_m in ((WRIST, wrist, 0.005), (HAND, hand, 0.012)):
            person.wait_until(lambda n=node: person.pixel(n) is not None, f"{node} is drawn")
            harness.spin_until(lambda: poses and states, what="positions")
            harness.spin_until(lambda w=where: rests(w), what="rest")
            before = where()

            def way(where=where, before=before):
                return np.abs(where() - before)

            for further in (True, True, False):
                along = drag(person, node)
                try:
                    harness.spin_until(lambda w=way, a=along: w()[a] > MOVED_M, LOST_S)
                    break
                except TimeoutError:  # a browser that draws few frames may lose where it is pressed
                    if not further:
                        raise
            harness.spin_until(lambda w=where: rests(w), what="rest")
            assert way()[along] > MOVED_M and np.all(np.delete(way(), along) < tolerance_m)


def drag(person: Visitor, node: str, far_pixels: float = 60.0) -> int:
    """Drag a control along that of its axes which is seen longest; returns which."""
    person.wait_until(lambda: steady(person, node), f"{node} is where it will be")
    origin = person.pixel(node)
    shafts = [person.pixel(node, SHAFT_M * axis) - origin for axis in np.eye(3)]
    along = int(np.argmax([np.linalg.norm(shaft) for shaft in shafts]))
    way = shafts[along] / np.linalg.norm(shafts[along])
    pressed = origin + shafts[along]
    person.drag(pressed, pressed + far_pixels * way)
    return along


def steady(person: Visitor, node: str) -> bool:
    """Whether a control is seen twice at the same place."""
    before = person.pixel(node)
    person.page.wait_for_timeout(300)
    return np.allclose(person.pixel(node), before, atol=0.5)


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
