# SPDX-License-Identifier: Apache-2.0
"""Simulated time goes on when all that was sent has been taken, whatever delays there are."""

from collections import Counter, deque

import numpy as np
import pytest

from intent_recognition.registry import NODES
from sim_bridge.arm.lock_step import ANSWERING, ARM, AT_WILL, EDGES, LockStep

CHAIN = EDGES[2:5]
"""From the person's pose to the estimate."""


def hear(lock: LockStep, node: str, **counts: int) -> None:
    lock.hear(node, {topic.replace("__", "/"): n for topic, n in counts.items()} | {"started": 1})


@pytest.mark.parametrize("seed", range(5))
def test_no_tick_before_all_of_the_one_before_was_processed(seed):
    """Messages and answers take random numbers of turns, in the order of each sender."""
    rng, lock = np.random.default_rng(seed), LockStep(ANSWERING)
    counts: dict[str, Counter] = {node: Counter() for node in ANSWERING}  # as nodes count them
    under_way: dict[tuple, deque] = {}
    processed = Counter()
    for node in ANSWERING:
        lock.hear(node, {"started": 1, AT_WILL: 0})

    def send(key, value):
        under_way.setdefault(key, deque()).append(value)

    def take(edge, tick):
        counts[edge.taker][edge.topic] += 1
        processed[edge.taker] = tick
        if edge in CHAIN or edge.topic == "/clock":
            following = [e for e in EDGES if e.sender == edge.taker]
            counts[edge.taker].update({e.topic for e in following})
            for own in following:
                send(own, tick)
        send(edge.taker, {"started": 1, **counts[edge.taker]})

    tick = turns = 0
    while tick < 40 and turns < 100_000:
        turns += 1
        if lock.missing() is None:
            assert tick == 0 or processed == Counter(dict.fromkeys(ANSWERING, tick))
            tick += 1
            for topic in ("/clock", "joint_states"):
                lock.note(topic)
            for edge in EDGES:
                if edge.sender == ARM:
                    send(edge, tick)
        waiting = [key for key, queue in under_way.items() if queue]
        key = waiting[rng.integers(len(waiting))]
        value = under_way[key].popleft()
        if key in EDGES and key.taker == ARM:
            lock.note(key.topic)
        elif key in EDGES:
            take(key, value)
        else:
            lock.hear(key, value)
    assert tick == 40


@pytest.mark.parametrize("seed", range(5))
def test_what_was_missed_before_the_first_answer_is_not_waited_for(seed):
    """However often a taker answers before its sender has told what it sent."""
    rng, lock = np.random.default_rng(seed), LockStep(["coworker_sim", "mocap_ingest"])
    for tick in range(1, 40):
        lock.note("/clock")
        answers = {"coworker_sim": {"/clock": tick, "mocap/wrist/pose": tick}}
        if tick > 3:  # the first three poses found nobody who listens
            answers["mocap_ingest"] = {"mocap/wrist/pose": tick - 3}
        first, *second = rng.permutation(list(answers))
        lock.hear(first, answers[first])
        if second and tick > 4:
            assert lock.missing().taker == second[0]
        for node in second:
            lock.hear(node, answers[node])
        assert lock.missing() is None


def test_only_who_has_answered_is_waited_for():
    lock = LockStep(["mocap_ingest", "primitive_activation"])
    lock.note("joint_states")
    assert lock.missing() is None
    hear(lock, "primitive_activation", joint_states=0)
    assert lock.missing() is None  # it started later
    lock.note("joint_states")
    assert lock.missing().taker == "primitive_activation"
    hear(lock, "primitive_activation", joint_states=1)
    assert lock.missing() is None


@pytest.mark.parametrize("how", ["leaves", "starts again"])
def test_a_node_that_is_gone_is_not_waited_for(how):
    lock = LockStep(["primitive_activation"])
    hear(lock, "primitive_activation", joint_states=0)
    assert lock.missing() is None
    for _ in range(3):
        lock.note("joint_states")
    hear(lock, "primitive_activation", joint_states=2)
    assert lock.missing()
    if how == "leaves":
        lock.leave("primitive_activation")
    else:
        hear(lock, "primitive_activation", joint_states=0)
    assert lock.missing() is None


def test_the_persons_prediction_is_waited_for_where_the_activation_hears_it():
    lock, topic = LockStep(["intent_estimator", "primitive_activation"]), "intent/human_trajectory"
    for heard in ({}, {topic: 0}):
        lock.hear("primitive_activation", {"started": 1, **heard})
        lock.hear("intent_estimator", {"started": 1, topic: 1})
        assert lock.missing() is None  # the first found nobody who listens
    lock.hear("intent_estimator", {"started": 1, topic: 2})
    assert lock.missing() == ("intent/human_trajectory", "intent_estimator", "primitive_activation")
    lock.hear("primitive_activation", {"started": 1, topic: 1})
    assert lock.missing() is None


def test_what_several_people_have_of_a_topic_is_added_up():
    lock = LockStep(ANSWERING)
    for node in ("coworker_sim", "mocap_ingest"):
        hear(lock, node)
    assert lock.missing() is None
    hear(lock, "coworker_sim", mocap__anna__wrist__pose=2, mocap__ben__wrist__pose=1)
    hear(lock, "mocap_ingest", mocap__anna__wrist__pose=2)
    assert lock.missing() == EDGES[2]
    hear(lock, "mocap_ingest", mocap__anna__wrist__pose=2, mocap__ben__wrist__pose=1)
    assert lock.missing() is None


def test_topics_go_from_node_to_node_as_registered():
    def names(topics):
        return {t.format(body="wrist", heard="human/wrist", sampled="") for t in topics}

    for edge in EDGES[1:]:  # the clock is every node's
        sender, taker = NODES.get(edge.sender or "arm_sim"), NODES.get(edge.taker or "arm_sim")
        assert sender is None or edge.topic in names(sender.publishes), edge
        assert taker is None or edge.topic in names(taker.subscribes), edge
