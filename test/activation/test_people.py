# SPDX-License-Identifier: Apache-2.0
"""One arm for several people: whom it helps first, and that it helps one at a time."""

from itertools import permutations

import numpy as np
import pytest
from activation_world import GOALS, HOME, LABELS, START_NS, STEP_NS, World, prediction
from clearance_world import clearance
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.activation.people import HelpRequest, first_to_help
from intent_recognition.activation.states import Mode
from intent_recognition.kinematics import Box, hand_position

SECOND_NS = 1_000_000_000
PEOPLE = ("anna", "ben")
times = st.floats(-20.0, 20.0)


def request(person, needed_s=0.0, p=0.9, duration_s=2.0):
    return HelpRequest(person, p, START_NS + round(needed_s * 1e9), duration_s)


def expected_waiting(order, between_s):
    """Sum of p w^2 by simulating the arm, which comes when it is needed, or later."""
    free_s, total = 0.0, 0.0
    for one in order:
        needed_s = (one.needed_ns - START_NS) * 1e-9
        arrives_s = needed_s if free_s + one.duration_s <= needed_s else free_s + one.duration_s
        total += one.probability * (arrives_s - needed_s) ** 2
        free_s = arrives_s + between_s
    return total


@given(st.lists(st.tuples(times, st.floats(0.1, 1.0), st.floats(0.5, 4.0)), min_size=1, max_size=2))
def test_of_two_the_order_with_the_least_expected_waiting_is_chosen(drawn):
    requests = [request(f"p{k}", *one) for k, one in enumerate(drawn)]
    chosen = first_to_help(requests, START_NS, 1.0)
    cost = {order[0].person: expected_waiting(order, 1.0) for order in permutations(requests)}
    assert cost[chosen] <= min(cost.values()) + 1e-9


@given(st.lists(st.tuples(times, st.floats(0.1, 1.0)), min_size=2, max_size=5), st.randoms())
def test_the_order_of_the_requests_does_not_matter(drawn, random):
    requests = [request(f"p{k}", *one) for k, one in enumerate(drawn)]
    mixed = random.sample(requests, len(requests))
    assert first_to_help(requests, START_NS) == first_to_help(mixed, START_NS)


@given(st.integers(0, 10**6), st.integers(2, 4))
def test_nobody_starves_however_often_others_need_the_arm(seed, n):
    """The others ask anew at once with a shorter task, which minimal sums of waiting prefer."""
    rng = np.random.default_rng(seed)
    now_ns = START_NS
    slow = HelpRequest("slow", 0.6, now_ns, 4.0)
    others = {f"p{k}": HelpRequest(f"p{k}", 0.99, now_ns, 0.5) for k in range(n)}
    for _ in range(200):
        chosen = first_to_help([slow, *others.values()], now_ns, 0.5)
        if chosen == "slow":
            return
        now_ns += round((others[chosen].duration_s + 0.5) * 1e9)
        others[chosen] = HelpRequest(chosen, 0.99, now_ns, float(rng.uniform(0.3, 0.7)))
    raise AssertionError("it waited for 200 others")


class SharedWorld(World):
    """Two people before one arm; `needs` says what each does, and since when."""

    def __init__(self, **settings):
        super().__init__(**settings)
        self.needs = dict.fromkeys(PEOPLE, ("idle", 0))
        self.silent = set()
        self.helped = []

    def ask(self, person, task, already_s=0.8):
        self.needs[person] = task, self.now_ns - round(already_s * 1e9)

    def step(self):
        self.now_ns += STEP_NS
        self.activation.take_joint_state(self.now_ns, self.arm(), np.zeros(7))
        for person, (task, onset_ns) in self.needs.items():
            if person in self.silent:
                continue
            if task != "idle":
                self.activation.take_prediction(self.now_ns, prediction(task, onset_ns), person)
            self.task = task
            self.activation.take_tasks(
                self.now_ns, self.now_ns, LABELS, self.probabilities(), person=person
            )
        command = self.activation.step(self.now_ns)
        if command is not None:
            self.commands.append(command)
        now = self.activation.attended, self.activation.active_task
        if not self.helped or now != self.helped[-1]:
            self.helped.append(now)

    def rest(self):
        """Both hands rest where they are."""
        for person in PEOPLE:
            self.ask(person, "idle")

    def helps(self, person):
        return self.activation.attended == person


def both_ask(first_s=0.8, second_s=0.4):
    world = SharedWorld()
    world.run(0.5)
    world.ask("anna", "plate", first_s)
    world.ask("ben", "screw", second_s)
    return world


def helps_anna():
    """Both asked, and the arm is with anna."""
    world = both_ask()
    world.until(lambda: world.helps("anna"))
    world.run(1.2)
    return world


def test_the_one_who_needs_it_first_is_helped_whatever_the_name_and_the_other_after():
    world = helps_anna()
    world.rest()
    world.until(lambda: world.helps("ben"))
    assert [pair for pair in world.helped if pair[0]] == [("anna", "plate"), ("ben", "screw")]
    world.until(lambda: world.activation.mode is Mode.IDLE)
    world.run(2.0)
    assert world.activation.counts["started"] == 2
    world.check_continuous()
    world = both_ask(0.4, 0.8)
    world.until(lambda: world.activation.attended)
    assert world.activation.attended in world.activation.people.reasons
    assert world.helps("ben")


def test_who_waits_is_helped_if_another_task_was_more_probable_just_before_the_end():
    """Two observations withdraw no task, but change the newest prediction."""
    world = helps_anna()
    world.ask("ben", "plate")
    for _ in range(2):
        world.step()
    assert world.activation.people.of("ben").decision.active == "screw"
    world.rest()
    world.until(lambda: world.helps("ben"))
    assert world.helped[-1] == ("ben", "screw")


def test_a_task_that_a_caller_orders_is_begun_for_the_one_attended_to():
    world = SharedWorld()
    world.run(0.5)
    world.ask("anna", "plate")
    world.until(lambda: world.activation.mode is Mode.EXECUTING)
    world.rest()
    world.until(lambda: world.activation.mode is Mode.IDLE)
    world.activation.inbox.order(prediction("screw", world.now_ns))
    world.until(lambda: world.activation.counts["started"] == 2)
    world.check_continuous()


def test_who_comes_next_is_not_told_before_the_arm_begins(monkeypatch):
    world = helps_anna()
    interacting = world.activation._transitions.interacting
    monkeypatch.setattr(interacting, "begin", lambda now_ns: None)  # no way is clear
    world.rest()
    world.until(lambda: not world.activation.active_task)
    assert {pair for pair in world.helped if pair[1]} == {("anna", "plate")}


def test_who_waits_is_helped_once_a_way_is_found(monkeypatch):
    world = helps_anna()
    motions, tries = world.activation.motions, []
    with monkeypatch.context() as nothing:
        nothing.setattr(motions, "interact", lambda now_ns, *_: tries.append(now_ns))
        world.rest()
        world.until(lambda: world.activation.mode is Mode.IDLE)
        world.run(2.0)
    assert len(tries) > 5 and np.all(np.diff(tries) >= 0.25 * SECOND_NS)
    assert not world.helps("ben")
    world.until(lambda: world.helps("ben"))
    world.check_continuous()


def test_who_asks_for_what_another_one_waited_for_waits_anew():
    end = Box("cup", tuple(hand_position(HOME + GOALS["plate"])), (0.06,) * 3)
    world = SharedWorld(clearance=clearance(end))
    for number, person in enumerate(PEOPLE, 1):
        world.rest()
        world.run(0.3)
        world.ask(person, "plate")
        world.run(1.0)
        assert world.activation.counts["waited"] >= number and not world.commands


def test_who_finds_no_way_lets_another_one_go_first(monkeypatch):
    world = helps_anna()
    motions = world.activation.motions
    interact = motions.interact

    def but_for_ben(now_ns, prediction, *more):
        return None if prediction.label == "screw" else interact(now_ns, prediction, *more)

    monkeypatch.setattr(motions, "interact", but_for_ben)
    world.rest()
    world.until(lambda: world.activation.mode is Mode.IDLE)
    world.ask("anna", "plate")
    world.until(lambda: world.helps("anna"))


@pytest.mark.parametrize("leaves", ["moves", "vanishes"])
def test_somebody_who_waited_and_left_is_not_helped(leaves):
    world = helps_anna()
    world.rest()
    world.run(0.2)
    if leaves == "vanishes":
        world.silent.add("ben")
    else:
        now_ns, moves = world.now_ns, np.array([0.3, 0.3, 0.4])
        world.activation.take_tasks(now_ns, now_ns, LABELS, moves, person="ben")
    world.until(lambda: world.activation.mode is Mode.IDLE)
    world.silent.clear()
    world.run(3.0)
    assert {person for person, _ in world.helped} == {"anna", ""}


def test_what_somebody_asked_before_they_were_lost_counts_no_more():
    world = both_ask()
    world.until(lambda: world.helps("anna"))
    world.silent.add("ben")
    world.run(0.6)
    world.silent.clear()
    world.ask("ben", "idle")  # as an estimator that has begun anew says
    world.run(1.0)
    world.ask("anna", "idle")
    world.until(lambda: world.activation.mode is Mode.IDLE)
    world.run(1.0)
    assert {person for person, _ in world.helped} == {"anna", ""}


def stopped_for_want_of_anna(ben="idle"):
    """The arm helped anna, of whom nothing comes any more."""
    world = both_ask(0.4, 0.2)
    world.ask("ben", ben, 0.2)
    world.until(lambda: world.helps("anna"))
    world.run(0.5)
    world.silent.add("anna")
    world.until(lambda: world.activation.mode is Mode.STOPPED)
    return world


def test_the_arm_stops_when_the_one_it_helps_vanishes_and_goes_on_with_the_other():
    world = stopped_for_want_of_anna("screw")
    assert world.activation.stop_reason == "stream_stopped"
    world.until(lambda: world.helps("ben"))
    world.check_continuous()


def test_the_same_movement_is_resumed_and_another_begins_an_interaction():
    """The name may stand for somebody else by then."""
    world = stopped_for_want_of_anna()
    world.run(0.3)
    world.silent.clear()
    world.ask("anna", "plate", 0.1)
    world.until(lambda: world.activation.mode is Mode.EXECUTING)
    assert world.activation.counts["started"] == 2
    world.run(3.0)
    world.check_continuous()
    world = stopped_for_want_of_anna()
    world.silent.clear()
    world.until(lambda: world.activation.mode is Mode.EXECUTING)
    assert world.activation.counts["started"] == 1
