# SPDX-License-Identifier: Apache-2.0
"""`intent replay` gives the numbers of the nodes, and recognises people not learned from."""

from collections import Counter
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from simulation import minimum_jerk

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.evaluation.replaying import replay
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.model.file import Model, load_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.bag_player import BagPlayer
from intent_recognition.nodes.conversions import stamp_ns
from intent_recognition.nodes.graph import resolve
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest

pytestmark = pytest.mark.slow

LONG_S = 300.0


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


def n_taken(ingest, estimator):
    """Poses that have reached the estimator, and what the ingest refused."""
    totals = dict(estimator._diagnostics._totals)
    arrived = sum(n for stream, n in totals.items() if stream.startswith("human/"))
    return arrived + ingest._diagnostics._counts.total()


class PacedPlayer(BagPlayer):
    """Plays an observation when the one before has been taken: none is lost on the way."""

    def __init__(self, topics, ingest, estimator, **kwargs):
        self._observed, self._chain, self._n_sent = topics, (ingest, estimator), 0
        super().__init__(**kwargs)

    def _publish(self, message, *when):
        super()._publish(message, *when)
        if message.topic.lstrip("/") not in self._observed:
            return
        self._n_sent += 1
        while n_taken(*self._chain) < self._n_sent:
            if self._stopping.wait(0.001):
                return


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
        return harness.node(partial(kind, namespace=calls[name].namespace), **values)

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


def test_an_unknown_movement_is_none_of_the_tasks(repository, toolbox_model, tmp_path):
    """A smooth way through three random places to the side of and above the work cell."""
    reader = BagReader(repository / "bags/toolbox/test/plate_handover_00")
    at = next(iter(reader.messages(["mocap/wrist/pose"]))).message.pose.position
    rng, corners = np.random.default_rng(1), [np.array([at.x, at.y, at.z])]
    corners += [*(corners[0] + rng.uniform((0.1, 0.2, 0.2), (0.5, 0.6, 0.6), (3, 3)))]
    share = minimum_jerk(np.linspace(0.0, 1.0, 90))[:, None]
    legs = [a + share * (b - a) for a, b in pairwise(corners)]
    ends = [np.repeat(corners[k][None], n, axis=0) for k, n in ((0, 80), (-1, 100))]
    way = np.vstack([ends[0], *legs, ends[1]])
    way += 0.001 * rng.normal(size=way.shape)
    with BagWriter(tmp_path / "bag") as writer:
        for k, position in enumerate(way.tolist()):
            stamp_ns, place = 10**18 + k * 10**7, dict(zip("xyz", position, strict=True))
            fields = {"header": {"stamp": stamp_ns, "frame_id": "world"}}
            fields["pose"] = {"position": place, "orientation": {"w": 1.0}}
            kind = "geometry_msgs/msg/PoseStamped"
            writer.write_message("mocap/wrist/pose", kind, fields, stamp_ns)
    rows = list(replay(BagReader(tmp_path / "bag"), load_model(toolbox_model)))
    assert {row["active_task"] for row in rows} == {""}
    believed = [row["probabilities"] for row in rows]
    assert {max(one, key=one.get) for one in believed[150:350]} == {"none"}
    assert sum(one["none"] < 1.0 for one in believed) > 20  # it was seen as a movement


LEFT_OUT = ("demo_0003", "demo_0014", "demo_0022", "demo_0035")


@pytest.fixture(scope="module")
def learned(shared_data):
    """People with the YuMi arm: the folder, and a model of all but one recording of each task."""
    folder = shared_data / "hri_yumi"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    dofs = load_dofs(folder / "dofs.yaml")
    demonstrations, rejections = read_demonstrations(folder, dofs)
    assert len(demonstrations) == 28 and not rejections
    library = learn([d for d in demonstrations if d.name not in LEFT_OUT], TrainingSettings())
    return folder, Model(library, dofs)


@pytest.mark.parametrize("name", LEFT_OUT)
def test_a_person_never_seen_in_training_is_recognised(learned, name):
    """By `replay`, which gives the numbers of the nodes."""
    folder, model = learned
    reader = BagReader(folder / name)
    moving = [row for row in replay(reader, model) if row["probabilities"]["none"] < 1.0]
    late = [max(row["probabilities"], key=row["probabilities"].get) for row in moving]
    late = late[len(late) // 2 :]
    assert late and late.count(reader.custom_data["task"]) > 0.9 * len(late)
