# SPDX-License-Identifier: Apache-2.0
"""The coworker's habit, and the shipped sessions from which it is learned."""

import hashlib
from collections import Counter

import numpy as np
import pytest
from bag_builder import messages_in

from experiments.teaching.record_sessions import FIRST_SEED, INTERACTIONS, SESSIONS, record_session
from intent_recognition.bags.reader import BagReader
from intent_recognition.demonstrations import read_task_sequences
from intent_recognition.learning.transitions import count_transitions, smoothed_transitions
from sim_bridge.coworker.task_list import FIRST, FOLLOWS, TASKS, habitual_tasks


def test_the_habit_is_the_chain_it_says_and_that_of_shipped_sessions(repository):
    np.testing.assert_allclose(np.vstack([FOLLOWS, FIRST]).sum(axis=1), 1.0)
    sequences = [habitual_tasks(seed, 60) for seed in range(100)]
    counts = count_transitions(sequences, TASKS)
    shares = counts / counts.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(shares[:3], FOLLOWS, atol=0.03)
    np.testing.assert_allclose(shares[3], FIRST, atol=0.12)
    assert min(Counter(sequences[0]).values()) >= 10
    sequences, rejections = read_task_sequences([repository / "bags" / "sessions"], 60.0)
    assert rejections == [] and len(sequences) == SESSIONS
    for number, sequence in enumerate(sequences):
        assert sequence.tasks == habitual_tasks(FIRST_SEED + number, INTERACTIONS)
    prior = smoothed_transitions(count_transitions([s.tasks for s in sequences], TASKS))
    np.testing.assert_allclose(prior[:3], FOLLOWS, atol=0.1)


@pytest.mark.slow
def test_shipped_sessions_can_be_made_again(repository, tmp_path):
    shipped = repository / "bags" / "sessions"
    made = record_session(tmp_path, FIRST_SEED + 1, 1, INTERACTIONS)
    assert "task" not in BagReader(made).custom_data
    assert messages_in(made) == messages_in(shipped / made.name)
    listed = dict(
        reversed(line.split()) for line in (shipped / "SHA256SUMS").read_text().splitlines()
    )
    files = {
        str(path.relative_to(shipped)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in shipped.rglob("*")
        if path.is_file() and path.name != "SHA256SUMS"
    }
    assert files == listed
