# SPDX-License-Identifier: Apache-2.0
"""However much is observed, the page keeps no more: histories, scene, controls, messages."""

import numpy as np
import pytest
from dashboard.browser import free_port
from kinematics.robots import lwr_urdf

from intent_recognition.dashboard import page as page_module
from intent_recognition.dashboard.cell import (
    CellState,
    NodeHealth,
    PathMarkers,
    Posterior,
    PredictedMotion,
)
from intent_recognition.dashboard.commands import Commands
from intent_recognition.dashboard.page import DashboardPage
from intent_recognition.dashboard.scene_file import load_scene
from intent_recognition.dashboard.teaching_session import TeachingSession
from intent_recognition.dashboard.teleoperation import Teleoperation
from intent_recognition.kinematics.lwr import JOINT_NAMES

STEP_S = 0.2
LABELS = ("a", "b", "none"), ("a", "b", "c", "none")


class Watched:
    """A page without a browser, fed with a movement that never ends."""

    def __init__(self, harness):
        self.now_s = 0.0
        self.rng = np.random.default_rng(0)
        self.state = state = CellState(description=lwr_urdf())

        commands = Commands(harness.probe, lambda ok, text: self.page.show_message(ok, text))
        teleoperation = Teleoperation(harness.probe, state)
        session = TeachingSession(teleoperation, commands, self.rng)
        parts = state, commands, teleoperation, session
        given = {"bags": (), "models": tuple, "play": None, "stop": None}
        given |= {"scene": load_scene("toolbox"), "clock": lambda: self.now_s}
        self.page = DashboardPage("127.0.0.1", free_port(), *parts, **given)

    def observe(self, count: int) -> None:
        """So many observations, each followed by an update of the page."""
        state, rng = self.state, self.rng
        for k in range(count):
            self.now_s += STEP_S
            labels = LABELS[k // 40 % len(LABELS)]
            chances = rng.dirichlet(np.ones(len(labels)))
            state.take_joints(JOINT_NAMES, rng.normal(size=7), self.now_s)
            state.person.take_wrist(rng.normal(size=3), self.now_s)
            state.transfer.take_sensor(1.0, self.now_s)
            state.person.take_posterior(Posterior(labels, chances, chances), self.now_s)
            path = rng.normal(size=(2 + k % 30, 3))
            state.person.drawn = PathMarkers(path, rng.normal(size=(30 * (1 + k % 7), 3)))
            state.person.predicted = PredictedMotion(
                "a", JOINT_NAMES, rng.normal(size=(2 + k % 50, 7))
            )
            state.person.drawn_at_s = state.person.predicted_at_s = self.now_s
            state.active, state.teaching = labels[k % 2], f"recorded {k}"
            state.nodes["arm"] = NodeHealth(k // 100 % 3, f"step {k}", {"rate x [Hz]": str(k)}, 0.0)
            if k % 50 == 0:
                self.page.show_message(True, f"remark {k}")
            self.page.update()

    def sizes(self) -> dict[str, int]:
        """How much of everything is kept, by the state and by viser."""
        server, state = self.page._server, self.state
        buffer = server._websock_server.get_message_buffer()
        return {
            "wrist path": len(state.person._wrist_past),
            "past posteriors": len(state.person.past),
            "forces": len(state.transfer.forces),
            "things in the scene": len(server.scene._handle_from_node_name),
            "controls": len(server.gui._gui_input_handle_from_uuid),
            "containers": len(server.gui._container_handle_from_uuid),
            "messages kept": len(buffer.message_from_id),
            "keys of messages": len(buffer.id_from_redundancy_key),
        }


@pytest.fixture
def watched(harness):
    """The page, closed afterwards."""
    watched = Watched(harness)
    yield watched
    watched.page.close()


@pytest.mark.slow
def test_the_page_keeps_no_more_after_many_observations(watched):
    watched.observe(480)
    before = watched.sizes()
    watched.observe(160)
    assert watched.sizes() == before
    assert before["things in the scene"] > 10


@pytest.mark.slow
def test_a_slow_browser_may_open_the_page_before_it_is_made(harness, monkeypatch):
    serve_page = page_module.serve_page

    def opened_at_once(*arguments):
        server = serve_page(*arguments)
        arguments[-1](True)
        return server

    monkeypatch.setattr(page_module, "serve_page", opened_at_once)
    watched = Watched(harness)
    try:
        watched.page.update()
        assert "/ambient" in watched.page._server.scene._handle_from_node_name
    finally:
        watched.page.close()
