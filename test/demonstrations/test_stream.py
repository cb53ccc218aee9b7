# SPDX-License-Identifier: Apache-2.0
"""The stream of a recording is what the running nodes would see of it."""

from collections import Counter

import numpy as np
import pytest
from bag_builder import LWR, POSE, START_NS, STEP_NS, joints, pose, write_bag, write_pairs
from model_builder import GLOVE, TOOL, WRIST, make_dofs, perform, true_library, write_recording

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.demonstrations import (
    DofEntry,
    Source,
    iter_observations,
    iter_samples,
    read_demonstrations,
)
from intent_recognition.signals.observation import merge
from intent_recognition.tracking import IngestSettings

DOFS = make_dofs(WRIST)


def stream(path, dofs=DOFS, settings=None, rejected=None):
    return list(iter_observations(BagReader(path), dofs, settings, rejected))


@pytest.mark.parametrize("name", ["plate_handover_00", "hold_screwdriver_01"])
def test_it_is_what_training_reads(repository, name):
    bag = repository / "bags/toolbox/test" / name
    (demonstration,), rejections = read_demonstrations(bag, DOFS)
    assert not rejections
    trained_on = list(merge(demonstration.observed))
    seen = stream(bag)
    assert [o.stamp_ns for o in seen] == [o.stamp_ns for o in trained_on]
    np.testing.assert_array_equal([o.values for o in seen], [o.values for o in trained_on])


def test_topics_of_several_kinds_come_in_the_order_of_the_recording(tmp_path):
    dofs = make_dofs(TOOL, GLOVE, WRIST)
    recording = perform(true_library(dofs), 0, 3)
    bag = write_recording(tmp_path / "bag", recording, dofs)
    seen = stream(bag, dofs)
    expected = list(merge(recording.observed))
    assert [(o.stamp_ns, o.group) for o in seen] == [(o.stamp_ns, o.group) for o in expected]
    for ours, theirs in zip(seen, expected, strict=True):
        np.testing.assert_array_equal(ours.values, theirs.values)
        assert (ours.covariance is None) == (ours.group != 2)


def test_two_entries_of_one_topic_share_its_messages(tmp_path):
    halves = [
        DofEntry(WRIST.topic, WRIST.type, fields=fields, unit="m")
        for fields in (WRIST.fields[:1], WRIST.fields[1:])
    ]
    bag = write_bag(tmp_path / "bag", count=10)
    seen = stream(bag, make_dofs(*halves))
    assert [o.group for o in seen] == [0, 1] * 10
    whole = stream(bag)
    for k, observation in enumerate(whole):
        parts = np.r_[seen[2 * k].values, seen[2 * k + 1].values]
        np.testing.assert_array_equal(parts, observation.values)
        np.testing.assert_array_equal(seen[2 * k + 1].covariance, observation.covariance[1:, 1:])


def test_a_message_without_one_joint_tells_of_the_other_and_one_without_any_is_counted(tmp_path):
    human = DofEntry("joint_states", GLOVE.type, joints=("lwr_a1_joint", "lwr_a2_joint"), unit="r")
    with BagWriter(tmp_path / "bag") as writer:
        for i in range(10):
            names = ["lwr_a2_joint", "lwr_a1_joint"]
            if i % 5 >= 3:
                names = ["lwr_a2_joint"] if i % 5 == 3 else ["other"]
            message = joints(i, names=names, positions=[2.0, 1.0][: len(names)])
            writer.write_message("joint_states", GLOVE.type, message, message["header"]["stamp"])
    counted = Counter()
    seen = stream(tmp_path / "bag", type(DOFS)((human,), ()), rejected=counted)
    assert counted == {"missing_dof": 2} and len(seen) == 8
    whole, part = ([1.0, 2.0], None), ([2.0], (1,))
    assert [(list(o.values), o.dofs) for o in seen] == 2 * [whole, whole, whole, part]


def test_extrinsics_turn_values_and_covariance(tmp_path):
    half = 0.5**0.5
    settings = IngestSettings(
        extrinsics={"tracker": (np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, half, half]))},
        position_std_m=np.array([0.001, 0.002, 0.003]),
    )
    with BagWriter(tmp_path / "bag") as writer:
        message = pose(1, x=0.5, frame_id="tracker")
        writer.write_message(WRIST.topic, WRIST.type, message, message["header"]["stamp"])
    (seen,) = stream(tmp_path / "bag", settings=settings)
    np.testing.assert_allclose(seen.values, [0.8, 2.5, 4.0], atol=1e-12)
    np.testing.assert_allclose(seen.covariance, np.diag([4e-6, 1e-6, 9e-6]), atol=1e-15)


def test_both_agents_in_order_and_the_human_s_as_without_the_other(tmp_path):
    reader = BagReader(write_bag(tmp_path / "bag", count=10))
    samples = list(iter_samples(reader, DOFS))
    assert [s.source for s in samples] == [Source.OBSERVED, Source.CONTROLLED] * 10
    human = [s.observation for s in samples if s.source is Source.OBSERVED]
    for ours, alone in zip(human, iter_observations(reader, DOFS), strict=True):
        assert ours.stamp_ns == alone.stamp_ns
        np.testing.assert_array_equal(ours.values, alone.values)
    arm = [s.observation for s in samples if s.source is Source.CONTROLLED]
    assert [o.group for o in arm] == [0] * 10
    np.testing.assert_array_equal(arm[3].values, 0.03 + np.arange(7))
    assert arm[3].stamp_ns == START_NS + 3 * STEP_NS


def test_an_arm_that_is_missing_or_incomplete_leaves_the_human(tmp_path):
    with BagWriter(tmp_path / "human") as writer:
        for k in range(5):
            writer.write_message("mocap/wrist/pose", POSE, pose(k), START_NS + k * STEP_NS)
    assert len(list(iter_samples(BagReader(tmp_path / "human"), DOFS))) == 5
    short = [joints(k, names=LWR[:6], positions=[0.0] * 6) for k in range(5)]
    six = write_pairs(tmp_path / "six", map(pose, range(5)), short)
    rejected = Counter()
    samples = list(iter_samples(BagReader(six), DOFS, rejected=rejected))
    assert len(samples) == 5 and rejected == {"missing_dof": 5}
