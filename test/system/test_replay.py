# SPDX-License-Identifier: Apache-2.0
"""`intent replay` gives the numbers of the running nodes, stamp by stamp."""

from collections import Counter
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
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
MOST = 220
"""So many poses are spoiled; the person moves in the last of them."""


def chain(harness, model):
    ingest = harness.node(MocapIngest)
    estimator = harness.node(IntentEstimatorNode, model=str(model))
    tasks = harness.collect(JointState, "intent/tasks", qos.STATE)
    harness.spin_until(lambda: ingest.count_subscribers("human/wrist"), what="the chain")
    harness.spin_until(
        lambda: (
            next(iter(ingest._outputs.values())).get_subscription_count()
            and estimator.people[""].output.tasks.get_subscription_count()
        ),
        what="the chain matched",
    )
    return ingest, estimator, tasks


def check_equal(messages, rows):
    assert [stamp_ns(message) for message in messages] == [row["stamp"] for row in rows]
    for message, row in zip(messages, rows, strict=True):
        assert list(message.name) == list(row["probabilities"]) == list(row["phase"])
        ours, theirs = list(row["probabilities"].values()), message.position
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9)
        ours, theirs = list(row["phase"].values()), message.velocity
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9)


def rejected(*nodes) -> Counter:
    """What the nodes have rejected, by reason."""
    return sum((node._diagnostics._counts for node in nodes), Counter())


def feed(harness, bag: Path, ingest, estimator, tasks) -> None:
    """The bag's own messages one after the other, each once the one before has had its effect."""
    publisher = harness.publisher(PoseStamped, "mocap/wrist/pose", qos.SENSOR)
    harness.connect(publisher)
    for raw in BagReader(bag).raw_messages(["mocap/wrist/pose"]):
        before = len(tasks) + rejected(ingest, estimator).total()
        publisher.publish(deserialize_message(raw.data, PoseStamped))
        harness.spin_until(
            lambda before=before: len(tasks) + rejected(ingest, estimator).total() > before,
            what="its effect",
        )


def test_replay_equals_the_nodes_on_a_spoiled_recording(
    harness, repository, toolbox_model, tmp_path
):
    """Outliers, NaN, repeated and unset stamps, another frame: dropped alike, counted alike."""
    source = BagReader(repository / "bags/toolbox/test/plate_handover_02")
    faults = Counter()
    with BagWriter(tmp_path / "spoiled", {"task": "plate_handover"}) as writer:
        for k, item in enumerate(islice(source.messages(["mocap/wrist/pose"]), MOST)):
            message = item.message
            p, header = message.pose.position, message.header
            pose = {
                "header": {"stamp": item.stamp_ns, "frame_id": header.frame_id},
                "pose": {"position": {"x": p.x, "y": p.y, "z": p.z}, "orientation": {"w": 1.0}},
            }
            if k % 10 == 5:
                fault = ("not_finite", "zero_stamp", "jump", "unknown_frame")[k // 10 % 4]
                faults[fault] += 1
                if fault == "not_finite":
                    pose["pose"]["position"]["x"] = float("nan")
                elif fault == "zero_stamp":
                    pose["header"]["stamp"] = 0
                elif fault == "jump":
                    pose["pose"]["position"]["z"] += 2.0
                else:
                    pose["header"]["frame_id"] = "elsewhere"
            writer.write_message(item.topic, item.type, pose, item.log_time_ns)
            if k % 10 == 7:
                faults["stamp_not_increasing"] += 1
                writer.write_message(item.topic, item.type, pose, item.log_time_ns + 1)
    ingest, estimator, tasks = chain(harness, toolbox_model)
    feed(harness, tmp_path / "spoiled", ingest, estimator, tasks)
    counted = Counter()
    rows = list(replay(BagReader(tmp_path / "spoiled"), load_model(toolbox_model), counted))
    check_equal(tasks, rows)
    assert rows[-1]["probabilities"]["none"] < 1.0
    assert counted == rejected(ingest, estimator) == faults


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
    """In the bag's own rhythm, where the nodes keep up with it."""
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
    assert not rejected(ingest, estimator)
    check_equal(tasks, rows)  # and none of the recorded ones
    reader = BagReader(original)
    now_ns = estimator.get_clock().now().nanoseconds
    assert abs(now_ns - reader.end_ns) < 1_000_000_000
