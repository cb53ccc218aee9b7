# SPDX-License-Identifier: Apache-2.0
"""The graph of replay.launch.py: what was measured is played, not the answers, on its own time."""

from functools import partial

import pytest
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from system.pacing import PacedPlayer

from intent_recognition.bags.reader import BagReader
from intent_recognition.bags.writer import BagWriter
from intent_recognition.evaluation.replaying import replay
from intent_recognition.model.file import load_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns
from intent_recognition.nodes.graph import resolve
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest

pytestmark = pytest.mark.slow

LONG_S = 300.0
KINDS = {"mocap_ingest": MocapIngest, "intent_estimator": IntentEstimatorNode}


def with_answers(bag, path):
    """A copy of a bag, with estimates as a session records them too."""
    with BagWriter(path, {}) as writer:
        for k, message in enumerate(BagReader(bag).raw_messages()):
            writer.write(message.topic, message.type, message.data, message.log_time_ns)
            if k % 50 == 0:
                header = {"stamp": message.log_time_ns, "frame_id": ""}
                fields = {"header": header, "name": ["stale"], "position": [1.0]}
                type_name = "sensor_msgs/msg/JointState"
                writer.write_message("intent/tasks", type_name, fields, message.log_time_ns)
    return path


def test_a_session_is_recognised_again_on_its_own_time(
    harness, repository, toolbox_model, tmp_path
):
    original = repository / "bags/toolbox/test/plate_handover_03"
    bag = with_answers(original, tmp_path / "session")
    given = {"bag": str(bag), "model": str(toolbox_model), "namespace": "again"}
    calls = {call.name: call for call in resolve("replay", given)}
    assert set(calls) == {*KINDS, "bag_player"}
    rows = list(replay(BagReader(original), load_model(toolbox_model)))
    tasks = harness.collect(JointState, "/again/intent/tasks", qos.STATE)

    def start(name, kind, **more):
        values = calls[name].parameters | more
        overrides = [Parameter(key, value=value) for key, value in values.items()]
        return harness.add(kind(namespace=calls[name].namespace, parameter_overrides=overrides))

    ingest, estimator = (start(name, kind) for name, kind in KINDS.items())
    harness.connect(estimator.people[""].output.tasks)
    paced = partial(PacedPlayer, {"mocap/wrist/pose"}, ingest, estimator)
    player = start("bag_player", paced, start_paused=True, exit_at_end=False)
    outputs = {topic: out.get_subscription_count for topic, out in player._outputs.items()}
    assert "/intent/tasks" not in outputs
    harness.spin_until(lambda: all(count() for count in outputs.values()), what="listeners")
    harness.connect(player._clock_publisher, subscribers=2)
    player._running.set()
    harness.spin_until(player.finished.is_set, LONG_S, "the end of the bag")
    harness.spin_until(lambda: len(tasks) >= len(rows), what="estimates")
    assert all("stale" not in message.name for message in tasks)
    assert [stamp_ns(message) for message in tasks] == [row["stamp"] for row in rows]
    best = dict(zip(tasks[-1].name, tasks[-1].position, strict=True))
    assert set(best) == set(rows[-1]["probabilities"])
    reader = BagReader(original)
    now_ns = estimator.get_clock().now().nanoseconds
    assert abs(now_ns - reader.end_ns) < 1_000_000_000
