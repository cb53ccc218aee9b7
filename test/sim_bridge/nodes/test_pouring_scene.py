# SPDX-License-Identifier: Apache-2.0
"""The pouring scene tells what each execution spilled."""

from types import SimpleNamespace

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus

from intent_recognition.nodes.qos import FEEDBACK
from sim_bridge.nodes.pouring_scene import PouringScene
from sim_bridge.scenarios.pouring.live import LiveCounts


def test_an_execution_spilled_what_lies_beside_since_it_began(harness, monkeypatch):
    balls = SimpleNamespace(spilled=1)
    world = SimpleNamespace(look=lambda: LiveCounts(39 - balls.spilled, 1, balls.spilled, 0))
    monkeypatch.setattr("sim_bridge.scenarios.pouring.LivePouring", lambda *_: world)
    told = harness.collect(DiagnosticStatus, "intent/feedback", FEEDBACK)
    scene = PouringScene(harness.probe).begin(None, 0, Time)
    harness.spin_until(lambda: scene._feedback.get_subscription_count() > 0, what="a listener")
    for task, now in (("", 1), ("pouring", 1), ("pouring", 3), ("", 4), ("", 5), ("pouring", 5)):
        balls.spilled = now
        scene.set_task(task)
    scene.set_task("")
    harness.spin_until(lambda: len(told) == 2, what="two executions")
    values = [(one.name, one.values[0].key, one.values[0].value) for one in told]
    assert values == [("pouring", "spilled", "3"), ("pouring", "spilled", "0")]
