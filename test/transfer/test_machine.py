# SPDX-License-Identifier: Apache-2.0
"""The state machine of transfers, on forces that are made up."""

import numpy as np
import pytest

from intent_recognition.transfer import (
    LIGHTEST_N,
    PATIENCE_S,
    Holding,
    Request,
    Situation,
    TransferMachine,
    carrying_grip,
)
from intent_recognition.transfer.load import BANDWIDTH_RAD_S
from intent_recognition.transfer.machine import PRESENT_S
from intent_recognition.transfer.sharing import MOST_N

STEP_S, WEIGHT_N = 0.005, 6.0
AHEAD = np.array([1.0, 0.0, 0.0])


class Course:
    """Steps a machine through made-up time."""

    def __init__(self, noise_n=0.0):
        self.machine, self.time_s = TransferMachine(), 0.0
        self.rng, self.noise_n = np.random.default_rng(0), noise_n
        self.outputs = []

    def run(self, length_s, request, force=(0.0, 0.0, -WEIGHT_N), rise=None, **known):
        """The outputs while a force, or a function of time, is felt; `rise` is another of time."""
        begin = len(self.outputs)
        for k in range(round(length_s / STEP_S)):
            self.time_s += STEP_S
            felt = force(k * STEP_S) if callable(force) else force
            felt = np.array(felt) + self.noise_n * self.rng.standard_normal(3)
            state = {"moving": False, "speed_m_s": 0.0, "near": True, "toward": AHEAD} | known
            now = Situation(self.time_s, felt, **state)
            if rise is not None:
                now = now._replace(rise_m_s2=rise(k * STEP_S))
            self.outputs.append(self.machine.step(request, now))
        return self.outputs[begin:]

    def offer(self):
        """Up to the offer."""
        self.machine.carry()
        self.run(1.0, Request.GIVE, moving=True)
        self.run(0.3, Request.GIVE)
        return self


def states(outputs):
    return [one.holding for one in outputs]


def taking(t):
    """A person lifts within 0.3 s, and pulls."""
    return [2.0 * min(t, 0.5), 0.0, -WEIGHT_N * (1.0 - min(t / 0.3, 1.0))]


def test_the_weight_is_measured_on_the_way_and_the_object_offered_at_rest():
    last = Course(noise_n=0.5).offer().outputs[-1]
    assert last.holding is Holding.OFFERING
    assert last.weight_n == pytest.approx(WEIGHT_N, abs=0.3)


@pytest.mark.parametrize("noise_n", [0.0, 0.6])
def test_who_takes_over_the_load_gets_the_object_while_the_grip_falls(noise_n):
    course = Course(noise_n).offer()
    outputs = course.run(1.0, Request.GIVE, taking)
    released = states(outputs).index(Holding.RELEASING) * STEP_S
    assert 0.15 < released < 0.45  # the lift ends at 0.3 s
    assert outputs[-1].holding is Holding.EMPTY
    held = [one for one in outputs if one.holding is Holding.OFFERING]
    shares = np.array([one.share for one in held])
    grips = np.array([one.grip_n for one in held])
    assert np.corrcoef(shares, grips)[0, 1] < -0.99
    assert all(one.grip_n == 0.0 for one in outputs[round(released / STEP_S) :])


@pytest.mark.parametrize("force", [(8.0, 0.0, -1.0), (0.0, 0.0, 2.0), (-9.0, 3.0, -9.0)])
def test_on_the_way_nothing_opens_the_hand(force):
    course = Course()
    course.machine.carry(WEIGHT_N)
    outputs = course.run(3.0, Request.GIVE, force, moving=True)
    assert set(states(outputs)) == {Holding.CARRYING}
    assert min(one.grip_n for one in outputs) >= carrying_grip(WEIGHT_N)


@pytest.mark.parametrize("way", [[1, 0, 0], [0, 0, 1], [0.7, 0, 0.7], [-1, 0, 0], [0, 0, -1]])
def test_bumps_end_before_they_count(way):
    """Half a sine of 0.1 s and up to 20 N."""
    course = Course().offer()

    def bump(t):
        return np.array([0, 0, -WEIGHT_N]) + 20.0 * np.sin(np.pi * min(t / 0.1, 1.0)) * np.array(
            way
        )

    outputs = course.run(0.8, Request.GIVE, bump)
    assert set(states(outputs)) == {Holding.OFFERING}


@pytest.mark.parametrize("gap_s", [0.25, -1000.0], ids=["a gap", "a clock that was set back"])
def test_after_a_gap_one_load_opens_nothing_and_a_person_still_gets_the_object(gap_s):
    course = Course().offer()
    course.time_s += gap_s
    (after,) = course.run(STEP_S, Request.GIVE, (4.0, 0.0, 0.0))
    assert after.holding is Holding.OFFERING and after.share < 0.2
    assert Holding.RELEASING in states(course.run(1.0, Request.GIVE, taking))


@pytest.mark.parametrize("back_s", [0.3, 1000.0])
@pytest.mark.parametrize(
    ("gives_s", "request_after", "waits_s", "then"),
    [
        (0.0, Request.GIVE, PATIENCE_S, Holding.RETURNING),
        (0.4, Request.NOTHING, 0.3, Holding.EMPTY),
    ],
    ids=["offering", "releasing"],
)
def test_a_clock_that_was_set_back_ends_no_state_late(
    gives_s, request_after, waits_s, then, back_s
):
    course = Course().offer()
    course.run(gives_s, Request.GIVE, taking)
    before = course.machine.holding
    course.time_s -= back_s
    assert {*states(course.run(waits_s - 0.1, request_after))} == {before}
    assert course.run(0.2, request_after)[-1].holding is then


def test_who_begins_with_an_object_between_the_fingers_does_not_open_them():
    """A node that was restarted."""
    (first,) = Course().run(STEP_S, Request.NOTHING, half_opening_m=0.02)
    assert first.holding is Holding.CARRYING and first.grip_n > WEIGHT_N
    (open_,) = Course().run(STEP_S, Request.NOTHING, (0.0, 0.0, 0.0), half_opening_m=0.02)
    assert open_.holding is Holding.EMPTY and open_.grip_n == 0.0
    (wide,) = Course().run(STEP_S, Request.NOTHING, half_opening_m=0.04, open_m=0.04)
    assert wide.holding is Holding.EMPTY  # what weighs is not between the fingers
    course = Course()
    assert course.run(STEP_S, Request.NOTHING, half_opening_m=0.02)[0].grip_n > 0.0
    assert course.run(0.3, Request.NOTHING, half_opening_m=0.0)[-1].grip_n == 0.0


@pytest.mark.parametrize("share", [0.5, 0.85])
def test_a_hand_that_carries_a_part_and_one_that_is_not_there_get_nothing(share):
    course, left = Course().offer(), (0.0, 0.0, -WEIGHT_N * (1.0 - share))
    assert set(states(course.run(1.5, Request.GIVE, left))) == {Holding.OFFERING}
    course = Course().offer()
    outputs = course.run(1.0, Request.GIVE, (0.0, 0.0, 0.0), near=False)
    assert Holding.RELEASING not in states(outputs)


@pytest.mark.parametrize(
    ("pull_n", "angle_deg", "given"),
    [(8.0, 100.0, True), (8.0, 140.0, False), (0.9 * LIGHTEST_N, 100.0, False)],
    ids=["pull", "push", "too weak to be felt"],
)
def test_only_who_pulls_to_the_side_for_long_gets_the_object(pull_n, angle_deg, given):
    course, angle = Course().offer(), np.radians(angle_deg)
    pull = [pull_n * np.cos(angle), pull_n * np.sin(angle), -WEIGHT_N]
    assert {*states(course.run(1.0, Request.GIVE, pull))} == {Holding.OFFERING}
    outputs = course.run(0.6, Request.GIVE, pull)
    assert (Holding.RELEASING in states(outputs)) is given
    assert (max(one.share for one in outputs) > 0.0) is given


@pytest.mark.parametrize("bias", [[2.0, 0.0], [-2.0, 0.0], [0.0, 5.0], [5.0, 0.0]])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_biased_sensor_gives_nothing_by_itself_and_everything_to_a_person(bias, sign):
    """With the wrong sign of a sensor nobody gets the object, nor does it fall."""
    course, by_itself = Course(0.1), np.array([*bias, -sign * WEIGHT_N])
    course.machine.carry()
    course.run(1.0, Request.GIVE, by_itself, moving=True)
    rests = course.run(PATIENCE_S - 1.0, Request.GIVE, by_itself)
    assert {*states(rests)[100:]} == {Holding.OFFERING}
    lifted = np.array([0.0, 0.0, sign * WEIGHT_N])
    taken = course.run(1.5, Request.GIVE, lambda t: by_itself + lifted * min(t, 1.0))
    assert (Holding.RELEASING in states(taken)) == (sign > 0.0)


def test_what_was_pressed_onto_a_table_before_the_lift_weighs_the_same_and_is_given():
    course = Course(0.1)
    course.machine.carry()
    course.run(1.5, Request.NOTHING, [0.0, 0.0, 3.0])
    course.run(0.7, Request.GIVE, moving=True)
    assert course.run(0.3, Request.GIVE)[-1].weight_n == pytest.approx(WEIGHT_N, abs=0.3)
    assert Holding.RELEASING in states(course.run(1.0, Request.GIVE, taking))


def test_what_nobody_takes_is_brought_back_and_put_down():
    course = Course().offer()
    assert course.run(PATIENCE_S + 0.1, Request.GIVE)[-1].holding is Holding.RETURNING
    outputs = course.run(1.0, Request.GIVE, moving=True)
    assert min(one.grip_n for one in outputs) >= carrying_grip(WEIGHT_N)
    assert course.run(0.2, Request.PUT_DOWN, moving=True)[-1].holding is Holding.RETURNING
    assert course.run(0.5, Request.PUT_DOWN)[-1].holding is Holding.EMPTY


@pytest.mark.parametrize("way_s", [0.2, PATIENCE_S + 0.1])  # pulled out on the way, or brought back
def test_fingers_that_stand_closed_on_nothing_hold_nothing_and_take_the_next_object(way_s):
    course = Course().offer()
    held = course.run(way_s, Request.GIVE, half_opening_m=0.015)[-1].holding
    assert held is (Holding.RETURNING if way_s > PATIENCE_S else Holding.OFFERING)
    lost = course.run(0.3, Request.NOTHING, (0.0, 0.0, 0.0), half_opening_m=0.0)[-1]
    assert (lost.holding, lost.weight_n, lost.grip_n) == (Holding.EMPTY, 0.0, 0.0)
    taking = course.run(0.1, Request.TAKE, (0.0, 0.0, 0.0), half_opening_m=0.04)
    assert taking[-1].holding is Holding.RECEIVING


def test_what_a_person_holds_out_is_taken_when_the_person_lets_go():
    course = Course()
    take = Request.TAKE
    course.run(0.3, take, (0, 0, 0), near=False, half_opening_m=0.04)
    course.run(0.3, take, (0, 0, 0), person_m_s=0.4, half_opening_m=0.04)
    assert course.machine.holding is Holding.RECEIVING
    outputs = course.run(PRESENT_S + 0.3, take, (0, 0, 0), half_opening_m=0.03)
    assert states(outputs).count(Holding.RECEIVING) * STEP_S >= PRESENT_S  # it is being brought
    assert outputs[-1].holding is Holding.TAKING
    assert outputs[-1].grip_n > 0.0
    outputs = course.run(1.0, take, (0.3, 0, 0.2), half_opening_m=0.03)
    assert outputs[-1].holding is Holding.TAKING  # the person still has it
    outputs = course.run(1.2, take, half_opening_m=0.03)
    assert outputs[-1].holding is Holding.CARRYING
    assert outputs[-1].weight_n == pytest.approx(WEIGHT_N)


def test_fingers_that_still_open_close_on_nothing_and_who_goes_has_let_go():
    course, take = Course(), Request.TAKE
    for k in range(round(2.0 * PRESENT_S / STEP_S)):
        (last,) = course.run(STEP_S, take, (0, 0, 0), half_opening_m=0.01 + 1e-4 * k)
    assert last.holding is Holding.RECEIVING
    course.run(PRESENT_S + 0.3, take, (0, 0, 0), half_opening_m=0.03)
    swaying = course.run(1.0, take, lambda t: (3.0 * np.sin(9.0 * t), 0, 0), half_opening_m=0.03)
    assert swaying[-1].holding is Holding.TAKING
    (gone,) = course.run(STEP_S, take, half_opening_m=0.03, near=False)
    assert gone.holding is Holding.CARRYING


@pytest.mark.parametrize(
    ("carried", "length_s", "doubted", "slips"),
    [
        (0.6, 0.2, 0.0, True),
        (0.6, 0.2, 0.3, False),
        (0.0, STEP_S, 0.0, False),
        (0.7, 0.02, 0.0, False),
    ],
    ids=["slips", "may be an error", "a single load", "an impulse below 0.015 N s"],
)
def test_a_load_that_is_missing_for_long_and_surely_is_a_slip(carried, length_s, doubted, slips):
    course = Course()
    course.machine.carry(WEIGHT_N)
    way = {"moving": True, "near": False}
    course.run(0.1, Request.HOLD, **way)
    less, doubt_n = (0.0, 0.0, -carried * WEIGHT_N), doubted * WEIGHT_N
    course.run(length_s, Request.HOLD, less, **way, doubt_n=doubt_n)
    course.run(0.1, Request.HOLD, **way)
    assert any(one.slip for one in course.outputs) is slips


def test_an_arm_that_accelerates_lets_nothing_slip():
    """Up and down at 4.5 m/s^2: the load is half as much again, and half."""

    def rise(t):
        return 4.5 * np.sin(2.0 * np.pi * t / 0.4)

    def inertial(t):
        return [0.0, 0.0, -WEIGHT_N * (1.0 + rise(t) / 9.81)]

    course = Course(noise_n=0.3)
    course.machine.carry()
    outputs = course.run(2.0, Request.GIVE, inertial, rise, moving=True, near=False)
    assert not any(one.slip for one in outputs)
    assert outputs[-1].weight_n == pytest.approx(WEIGHT_N, abs=0.1)
    assert max(one.grip_n for one in outputs) <= carrying_grip(1.5 * WEIGHT_N + 1.0)


class Felt:
    """Loads as `LoadEstimator` feels them: a filter of differences of noisy velocities."""

    def __init__(self, std_n, seed=0):
        self.rng, self.std_n = np.random.default_rng(seed), std_n
        self.before, self.noise = np.zeros(3), np.zeros(3)

    def __call__(self, force):
        share = 1.0 - np.exp(-BANDWIDTH_RAD_S * STEP_S)
        now = self.std_n / share / np.sqrt(2.0 / (2.0 - share)) * self.rng.standard_normal(3)
        self.noise = (1.0 - share) * self.noise + share * (now - self.before)
        self.before = now
        return np.add(force, self.noise)


@pytest.mark.parametrize(
    ("times_s", "shares", "earliest_s", "latest_s"),
    [
        ((0.0, 3.0, 3.005), (0.0, 0.0, 1.0), 3.1, 4.5),
        ((0.0, 2.0), (0.12, 1.0), 2.0, 2.6),  # seen in simulation: a third of it after 0.45 s
        ((0.0, 0.4, 0.8, 0.805), (0.0, 0.33, 0.33, 1.0), 1.2, 1.8),  # seen in the cell
    ],
    ids=["at once", "slowly", "after a pause"],
)
def test_a_load_is_the_robots_once_the_person_has_let_go(times_s, shares, earliest_s, latest_s):
    """Whatever the noise of felt loads, and not on the first ones."""
    course, take, felt = Course(), Request.TAKE, Felt(1.0)
    course.run(PRESENT_S + 0.3, take, (0, 0, 0), half_opening_m=0.03)

    def given(t):
        return felt((0.0, 0.0, -WEIGHT_N * np.interp(t, times_s, shares)))

    outputs = course.run(times_s[-1] + 1.5, take, given, half_opening_m=0.03)
    assert earliest_s <= states(outputs).index(Holding.CARRYING) * STEP_S <= latest_s
    assert outputs[-1].weight_n == pytest.approx(WEIGHT_N, abs=0.5)


def test_slips_are_told_from_the_noise_of_felt_loads_and_gripped_against():
    """Of an object of which so much is held from a time on, as the estimator's filter shows it."""
    weight_n, times_s = 8.0, []
    way = {"request": Request.HOLD, "moving": True, "near": False}
    for seed in range(20):
        course, felt, held = Course(), Felt(0.8, seed), (0.45, 0.6, 0.6, 0.6)[seed % 4]
        course.machine.carry(weight_n)
        outputs = course.run(3.0, force=lambda t, felt=felt: felt((0, 0, -weight_n)), **way)
        assert not any(one.slip for one in outputs)

        def slipping(t, felt=felt, held=held):
            missing = (1.0 - held) * (1.0 - np.exp(-BANDWIDTH_RAD_S * (t + STEP_S)))
            return felt((0, 0, -weight_n * (1.0 - missing)))

        outputs = course.run(0.3, force=slipping, **way)
        times_s.append([one.slip for one in outputs].index(True) * STEP_S)
        assert 2.0 * carrying_grip(weight_n) <= outputs[-1].grip_n <= MOST_N
    assert max(times_s) <= 0.06 and np.quantile(times_s, 0.9) <= 0.05


class Opening(Course):
    """With fingers that take their time: 0.15 m/s to open, 0.1 m/s to close on nothing."""

    def __init__(self):
        super().__init__()
        self.half_m, self.openings_m = 0.04, []

    def receive(self, length_s):
        """The states of a time; notes how far open the fingers were when they began to close."""
        passed = []
        for _ in range(round(length_s / STEP_S)):
            output = self.run(STEP_S, Request.TAKE, (0, 0, 0), half_opening_m=self.half_m)[-1]
            if output.holding is Holding.CLOSING and passed[-1] is not Holding.CLOSING:
                self.openings_m.append(self.half_m)
            speed = 0.15 if output.grip_n == 0.0 else -0.1
            self.half_m = float(np.clip(self.half_m + speed * STEP_S, 0.0, 0.04))
            passed.append(output.holding)
        return passed


def test_fingers_that_closed_on_nothing_stand_open_before_they_close_again_for_as_long_as_patient():
    """What they closed in front of needs room, and time to come between them. The arm stays."""
    course = Opening()
    passed = course.receive(PATIENCE_S + 2.0)
    assert len(course.openings_m) > 1
    np.testing.assert_allclose(course.openings_m, 0.04)
    patient = round((PATIENCE_S - 0.1) / STEP_S)
    assert {*passed[:patient]} == {Holding.RECEIVING, Holding.CLOSING}
    assert passed[-1] is Holding.EMPTY


def test_nobody_who_gives_is_waited_for_longer_than_the_patience():
    course = Course()
    outputs = course.run(PATIENCE_S + 1.0, Request.TAKE, (0, 0, 0), near=False)
    received_s = states(outputs).count(Holding.RECEIVING) * STEP_S
    assert received_s == pytest.approx(PATIENCE_S, abs=0.1)
    assert outputs[-1].holding is Holding.EMPTY
    course.run(0.1, Request.NOTHING, (0, 0, 0), near=False)
    assert course.run(0.1, Request.TAKE, (0, 0, 0), near=False)[-1].holding is Holding.RECEIVING


def test_fingers_do_not_close_on_a_hand_that_is_passed():
    course = Course()
    course.run(0.2, Request.TAKE, (0, 0, 0), near=False)
    outputs = course.run(1.0, Request.TAKE, (0, 0, 0), moving=True)
    assert {*states(outputs)} == {Holding.EMPTY}
