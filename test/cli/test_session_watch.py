# SPDX-License-Identifier: Apache-2.0
"""The demo notices a node that hangs: one that runs and says nothing."""

import pytest

from intent_recognition.cli.session_watch import HUNG_S, Heartbeats
from intent_recognition.errors import IntentError


class Watched:
    """Heartbeats looked at every tenth of a second."""

    def __init__(self):
        self.now_s = 100.0
        self.heartbeats = Heartbeats(lambda: self.now_s)

    def run(self, seconds, speaking, running, step_s=0.1):
        for _ in range(round(seconds / step_s)):
            self.now_s += step_s
            for name in speaking:
                self.heartbeats.hear(name)
            self.heartbeats.check(running)


def test_a_node_that_falls_silent_is_named():
    watched = Watched()
    watched.run(60.0, ["arm", "ingest"], ["arm", "ingest", "starting"])
    watched.run(HUNG_S - 1.0, ["ingest"], ["arm", "ingest", "starting"])
    with pytest.raises(IntentError, match=r"node arm: expected reports on /diagnostics"):
        watched.run(2.0, ["ingest"], ["arm", "ingest", "starting"])


def test_a_node_that_has_ended_is_not_missed():
    watched = Watched()
    watched.run(1.0, ["coworker", "arm"], ["coworker", "arm"])
    watched.run(60.0, ["arm"], ["arm"])


def test_nobody_hangs_because_the_demo_was_stopped():
    watched = Watched()
    watched.run(1.0, ["arm"], ["arm"])
    watched.run(3600.0, [], ["arm"], step_s=3600.0)
    watched.run(10.0, [], ["arm"])


def test_who_was_not_waited_for_is_remembered():
    heartbeats = Heartbeats()
    heartbeats.hear("lwr_sim", "intent_estimator")
    heartbeats.hear("mocap_ingest")
    assert heartbeats.unanswered == "intent_estimator"
