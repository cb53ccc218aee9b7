# SPDX-License-Identifier: Apache-2.0
"""Whatever of the observed agent is measured, whenever: the nodes give what replay gives."""

import copy
from collections import Counter
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import yaml
from bag_builder import POSE
from model_builder import GLOVE, WRIST, learned_model, make_dofs, message_of, perform, true_library
from rclpy.serialization import deserialize_message

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.evaluation.replaying import replay
from intent_recognition.model.file import Model, load_model, save_model
from intent_recognition.nodes.conversions import message_class, stamp_ns
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.signals.observation import merge

FLAT = replace(WRIST, fields=("pose.position.x", "pose.position.z"))
ELBOW = DofEntry("mocap/elbow/pose", POSE, fields=("pose.position.y",), unit="m")
ODOMETRY = "nav_msgs/msg/Odometry"
HAND = DofEntry(
    "tracker/hand", ODOMETRY, fields=tuple(f"pose.pose.position.{a}" for a in "xyz"), unit="m"
)
HAND_RATE = DofEntry(
    HAND.topic,
    ODOMETRY,
    fields=tuple(f"twist.twist.linear.{a}" for a in "zx"),
    unit="m/s",
    of=(HAND.names[2], HAND.names[0]),
)
MS = 1_000_000


class Subject:
    """A model of one DOF file, and bags made of messages of one's own."""

    def __init__(self, folder, dofs):
        self.folder, self.dofs, self.truth = folder, dofs, true_library(dofs)
        self.model = learned_model(replace(dofs, velocities=()), self.truth)
        self.path = folder / "model.npz"
        save_model(self.path, Model(self.model.library, dofs))

    def observations(self, task=1, seed=90):
        return list(merge(perform(self.truth, task, seed).observed))

    def record(self, messages):
        """A bag of (log time, entry, fields), in the order of log times."""
        with BagWriter(self.folder / "bag", {}) as writer:
            for log_ns, entry, fields in sorted(messages, key=lambda m: m[0]):
                writer.write_message(entry.topic, entry.type, fields, log_ns)
        return self.folder / "bag"


class Nodes:
    """Ingest and estimator, which takes what ingest makes of a bag's messages."""

    def __init__(self, harness, subject, ingest=None, **parameters):
        self.harness, self.dofs = harness, subject.dofs
        self.ingest = ingest or harness.node(MocapIngest)
        parameters = {"model": str(subject.path), **parameters}
        self.estimator = harness.node(IntentEstimatorNode, **parameters)
        self.tasks = harness.said(self.estimator, "intent/tasks")
        for body, publisher in self.ingest._outputs.items():
            if f"/human/{body}" in self.heard():
                publisher.publish = partial(harness.hear, self.estimator, f"human/{body}")

    def heard(self):
        return {s.topic_name for s in self.estimator.subscriptions}

    def feed(self, bag):
        entries = (*self.dofs.observed, *self.dofs.controlled)
        types = {e.topic: message_class(e.type) for e in entries}
        for raw in BagReader(bag).raw_messages(types):
            topic = raw.topic.lstrip("/")
            node = self.ingest if topic.startswith("mocap/") else self.estimator
            self.harness.hear(node, topic, deserialize_message(raw.data, types[topic]))
            # poses in a frame that may still come to /tf wait, and all that follow
            self.harness.spin_until(lambda: not any(self.ingest._waiting.values()), what="frames")

    def rejected(self):
        return self.ingest._diagnostics._counts + self.estimator._diagnostics._counts


def check_replay(nodes, bag, model):
    """Estimates of nodes and replay, stamp by stamp; the rows of replay."""
    counted = Counter()
    rows = list(replay(BagReader(bag), model, counted))
    assert [stamp_ns(m) for m in nodes.tasks] == [row["stamp"] for row in rows]
    for message, row in zip(nodes.tasks, rows, strict=True):
        for ours, theirs in ((message.position, "probabilities"), (message.velocity, "phase")):
            np.testing.assert_allclose(ours, list(row[theirs].values()), rtol=0.0, atol=1e-9)
    of_posture = {"start_posture_unknown", "start_posture_outside"}
    assert counted == {why: n for why, n in nodes.rejected().items() if why not in of_posture}
    return rows


def winner(rows):
    """The task while it was last under way."""
    moving = [row for row in rows if row["probabilities"]["none"] < 1.0]
    return max(moving[-1]["probabilities"], key=moving[-1]["probabilities"].get)


def plain(subject, observations, delay_ns=lambda group: 0):
    """Messages of complete observations, some topics recorded later than measured."""
    for o in observations:
        entry = subject.dofs.observed[o.group]
        fields = message_of(entry, o.stamp_ns, o.values)
        yield o.stamp_ns + delay_ns(o.group), entry, fields


def run(harness, subject, messages, *bodies):
    bag = subject.record(messages)
    nodes = Nodes(harness, subject, harness.node(MocapIngest, bodies=[*(bodies or ("wrist",))]))
    nodes.feed(bag)
    return check_replay(nodes, bag, load_model(subject.path)), nodes


def shifted(observations, group, by_ns):
    return [
        o._replace(stamp_ns=o.stamp_ns + by_ns) if o.group == group else o for o in observations
    ]


@pytest.fixture
def bodies(tmp_path):
    return Subject(tmp_path, make_dofs(FLAT, ELBOW))


FAULTS = {
    "not_finite": lambda fields: fields["pose"]["position"].update(x=float("nan")),
    "zero_stamp": lambda fields: fields["header"].update(stamp=0),
    "jump": lambda fields: fields.update(
        pose={"position": {"z": 9.0}, "orientation": {"w": 1.0}},
        header=fields["header"] | {"stamp": fields["header"]["stamp"] + MS},
    ),
    "unknown_frame": lambda fields: fields["header"].update(frame_id="elsewhere"),
    "stamp_not_increasing": lambda fields: None,  # it comes a second time
}


@pytest.mark.slow
def test_some_fields_of_two_bodies_one_slow_and_silent_for_a_while_and_spoiled_ones(
    harness, bodies
):
    """What is spoiled is dropped alike and counted alike."""
    seen = shifted(bodies.observations(), 1, 3 * MS)
    begin = seen[0].stamp_ns
    seen = [
        o
        for k, o in enumerate(seen)
        if o.group == 0 or (k % 3 and not 1.2 < (o.stamp_ns - begin) * 1e-9 < 1.9)
    ]
    messages, faults = list(plain(bodies, seen)), Counter()
    wrist = [one for one in messages if one[1] is bodies.dofs.observed[0]]
    for k, (log_ns, entry, fields) in enumerate(wrist[5::6]):
        fault = [*FAULTS][k % len(FAULTS)]
        spoiled = copy.deepcopy(fields)
        FAULTS[fault](spoiled)
        messages.append((log_ns + 1, entry, spoiled))
        faults[fault] += 1
    rows, nodes = run(harness, bodies, messages, "wrist", "elbow")
    assert len(rows) == len(seen) and winner(rows) == "task_1"
    assert nodes.rejected() == faults and min(faults.values()) >= 4
    assert nodes.heard() >= {"/human/wrist", "/human/elbow"}
    totals = nodes.estimator._diagnostics._totals
    assert totals["human/wrist"] + totals["human/elbow"] == len(seen)


@pytest.mark.slow
def test_joints_that_are_missing_or_nan_leave_the_others(harness, tmp_path):
    subject = Subject(tmp_path, make_dofs(GLOVE))
    messages = []
    for k, (log_ns, entry, fields) in enumerate(plain(subject, subject.observations())):
        if 80 <= k < 110:
            fields = fields | {"name": ["index"], "position": fields["position"][1:]}
        elif k % 7 == 3:
            fields = fields | {"position": [fields["position"][0], float("nan")]}
        elif k % 50 == 5:
            fields = fields | {"position": [float("nan")] * 2}
        elif k % 50 == 6:
            fields = fields | {"position": [float("inf"), fields["position"][1]]}
        elif k % 50 == 8:
            fields = fields | {"name": ["a", "b"]}
        messages.append((log_ns, entry, fields))
    rows, nodes = run(harness, subject, messages)
    assert winner(rows) == "task_1"
    counts = nodes.rejected()
    assert set(counts) == {"not_finite", "missing_dof"} and min(counts.values()) >= 2
    in_part = nodes.estimator._diagnostics._totals[f"{GLOVE.topic}, in part"]
    assert in_part >= 45 and len(rows) + counts.total() == len(messages)


def odometry(stamp, position, velocity, position_std, velocity_std):
    def diagonal(*stds):
        return np.diag(np.square(stds)).ravel().tolist()

    return {
        "header": {"stamp": stamp, "frame_id": "world"},
        "pose": {
            "pose": {
                "position": dict(zip("xyz", map(float, position), strict=True)),
                "orientation": {"w": 1.0},
            },
            "covariance": diagonal(*[position_std] * 3, 0.1, 0.1, 0.1),
        },
        "twist": {
            "twist": {"linear": dict(zip("xyz", map(float, velocity), strict=True))},
            "covariance": diagonal(*[velocity_std] * 3, 0.1, 0.1, 0.1),
        },
    }


def moving_hand(subject):
    """Odometry with its own velocities, each message with a covariance of its own."""
    (signal,) = perform(subject.truth, 1, 90).observed
    seconds = signal.seconds(int(signal.stamps_ns[0]))
    smooth = np.apply_along_axis(np.convolve, 0, signal.values, np.ones(5) / 5, "same")
    speed = np.gradient(smooth, seconds, axis=0)
    speed[:4] = speed[-4:] = 0.0
    for k, stamp in enumerate(signal.stamps_ns.tolist()):
        stds = 0.002 * (1 + k % 4), 0.05 * (1 + k % 3)
        yield stamp, HAND, odometry(stamp, signal.values[k], speed[k], *stds)


@pytest.mark.slow
@pytest.mark.parametrize("by", ["model", "dofs"])
def test_velocities_measured_beside_the_positions(harness, tmp_path, by):
    """The DOF file of the model names them, or that of the node alone."""
    dofs = replace(make_dofs(HAND), velocities=(HAND_RATE,))
    subject, given = Subject(tmp_path, dofs if by == "model" else make_dofs(HAND)), {}
    if by == "dofs":
        (tmp_path / "dofs.yaml").write_text(yaml.safe_dump(dofs.to_dict()))
        given = {"dofs": str(tmp_path / "dofs.yaml")}
    messages = list(moving_hand(subject))
    for k, (_, _, fields) in enumerate(messages):
        if k % 10 == 4:  # no position: the velocities alone
            fields["pose"]["pose"]["position"]["y"] = float("nan")
        if k % 10 == 6:  # one velocity
            fields["twist"]["twist"]["linear"]["x"] = float("nan")
        if k % 10 == 8:  # velocities without a covariance
            fields["twist"]["covariance"] = [0.0] * 36
    bag, nodes = subject.record(messages), Nodes(harness, subject, **given)
    nodes.feed(bag)
    rows = check_replay(nodes, bag, replace(load_model(subject.path), dofs=dofs))
    tenth = [len(range(k, len(messages), 10)) for k in range(10)]
    assert nodes.rejected() == {"not_finite": tenth[4], "no_covariance": tenth[8]}
    assert len(rows) == 2 * len(messages) - tenth[4] - tenth[8]
    assert winner(rows) == "task_1"
    without = list(replay(BagReader(bag), subject.model))
    assert winner(without) == "task_1"
    surely = [max(r["probabilities"].values()) for r in (rows[len(rows) // 2], without[-60])]
    assert surely[0] != surely[1]
