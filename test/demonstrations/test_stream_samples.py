# SPDX-License-Identifier: Apache-2.0
"""Both agents' measurements of a recording, in the order they were recorded."""

from collections import Counter

import numpy as np
from bag_builder import LWR, POSE, START_NS, STEP_NS, joints, pose, write_bag, write_pairs
from model_builder import make_dofs

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.demonstrations.observations import Source, iter_observations, iter_samples

DOFS = make_dofs()


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
