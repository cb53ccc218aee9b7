# SPDX-License-Identifier: Apache-2.0
"""A force beside a pose: from messages in a bag, by the shipped DOF file, to what is recognised."""

import numpy as np
import pytest
from bag_builder import JOINTS, LWR, POSE
from simulation import START_NS, gathered, minimum_jerk

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.evaluation.replaying import replay
from intent_recognition.learning import TrainingSettings
from intent_recognition.model import Model
from intent_recognition.share import share_path

WRENCH = "geometry_msgs/msg/WrenchStamped"
FORCES_N = {"take": (8.0, 0.0, 3.0), "press": (-8.0, 0.0, -1.0)}


@pytest.fixture(scope="module")
def dofs():
    return load_dofs(share_path("config/examples/wrench.dofs.yaml"))


def recorded(path, task, seed):
    """One way of the wrist for both tasks; the force comes half-way. Returns it as it was sent."""
    rng, times_s = np.random.default_rng([seed, task == "take"]), np.arange(0.0, 3.0, 0.02)
    reach = minimum_jerk((times_s - 0.6) / 1.6)[:, None]
    pulled = minimum_jerk((times_s - 1.2) / 0.8)[:, None]
    wrist = reach * ([0.4, 0.1, 0.2] + 0.03 * rng.normal(size=3))
    force = pulled * FORCES_N[task] * np.exp(0.1 * rng.normal())
    wrist, force = (p + s * rng.normal(size=p.shape) for p, s in ((wrist, 5e-4), (force, 0.2)))
    joints = 0.3 * reach + 1e-4 * rng.normal(size=(len(reach), 7))
    with BagWriter(path, {"task": task}) as bag:
        for k, at_s in enumerate(times_s):
            at_ns = START_NS + round(at_s * 1e9)
            header = {"stamp": at_ns, "frame_id": "world"}
            place, push = (dict(zip("xyz", row[k].tolist(), strict=True)) for row in (wrist, force))
            pose = {"position": place, "orientation": {"w": 1.0}}
            bag.write_message("mocap/wrist/pose", POSE, {"header": header, "pose": pose}, at_ns)
            message = {"header": header, "wrench": {"force": push}}
            bag.write_message("wrench", WRENCH, message, at_ns + 1)
            state = {"header": header, "name": LWR, "position": joints[k].tolist()}
            bag.write_message("joint_states", JOINTS, state, at_ns + 2)
    return force


def test_a_recorded_force_is_read_as_it_was_sent(tmp_path, dofs):
    force = recorded(tmp_path / "bag", "take", 0)
    (found,), rejections = read_demonstrations(tmp_path / "bag", dofs)
    assert not rejections
    np.testing.assert_array_equal(found.observed[1].values, force)
    assert found.observed[1].unit == "N"


def test_tasks_that_look_alike_are_told_apart_by_the_force_that_was_recorded(tmp_path, dofs):
    demonstrations = []
    for task in FORCES_N:
        for seed in range(6):
            recorded(tmp_path / f"{task}_{seed}", task, seed)
            demonstrations += read_demonstrations(tmp_path / f"{task}_{seed}", dofs)[0]
    settings = TrainingSettings(n_basis=8, n_aligned_basis=8)
    model = Model(gathered(demonstrations, settings).library, dofs)
    for task in FORCES_N:
        recorded(tmp_path / task, task, 77)
        rows = [row["probabilities"] for row in replay(BagReader(tmp_path / task), model)]
        at_most = rows[int(0.6 * len(rows))]
        assert max(at_most, key=at_most.get) == task
