# SPDX-License-Identifier: Apache-2.0
"""The compliant hand: equilibrium, slip, noise, and who takes and gives."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sim_bridge import GRAVITY_M_S2
from sim_bridge.arm import TIME_STEP_S
from sim_bridge.handover import (
    HELD_SHARE,
    CompliantHand,
    Giver,
    HandedThing,
    Manner,
    SeenRobot,
    Strength,
    Taker,
    TransferObject,
)
from sim_bridge.physics import end_world, start_world

STEP_S, MASS_KG = 0.001, 0.5
WEIGHT_N = MASS_KG * GRAVITY_M_S2
STILL, LEVEL = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])


class Falling:
    """A point mass in gravity that a hand holds."""

    def __init__(self, hand):
        self.hand, self.at_m, self.velocity_m_s = hand, hand.position_m.copy(), np.zeros(3)

    def run(self, length_s, act=lambda t, point: None):
        forces = []
        for k in range(round(length_s / STEP_S)):
            act(k * STEP_S, self.at_m)
            force, _ = self.hand.step(STEP_S, self.at_m, self.velocity_m_s, LEVEL, STILL, MASS_KG)
            forces.append(force.copy())
            self.velocity_m_s += STEP_S * (force / MASS_KG - [0.0, 0.0, GRAVITY_M_S2])
            self.at_m += STEP_S * self.velocity_m_s
        return np.array(forces)


def hand(seed=0, **strength):
    return CompliantHand(np.zeros(3), Strength(**strength), np.random.default_rng(seed))


def test_what_is_held_is_carried_and_the_arm_yields_by_its_stiffness():
    one = hand(stiffness_n_m=200.0)
    one.grasp(np.zeros(3), LEVEL)
    one.felt_n = WEIGHT_N
    forces = Falling(one).run(3.0)
    np.testing.assert_allclose(forces[-1000:].mean(0), [0, 0, WEIGHT_N], atol=0.05)
    assert one.position_m[2] == pytest.approx(-WEIGHT_N / 200.0, abs=0.003)
    assert one.felt_n == pytest.approx(WEIGHT_N, abs=0.4)
    assert one.holds


def test_a_long_object_is_held_level_at_one_end():
    one, client = hand(), start_world()
    client.setGravity(0.0, 0.0, -GRAVITY_M_S2)
    client.setTimeStep(TIME_STEP_S)
    rod = HandedThing(client, TransferObject(0.3, (0.01, 0.01, 0.2), 0.1), np.zeros(3))
    one.position_m = one.target_m = np.array([HELD_SHARE * 0.2, 0.0, 0.0])
    one.grasp(*rod.held_point())
    one.lift_n = one.felt_n = 0.3 * GRAVITY_M_S2
    for _ in range(1000):
        rod.act(one)
        client.stepSimulation()
    turned = Rotation.from_quat(rod.pose()[1]).magnitude()
    end_world(client)
    assert turned == pytest.approx(0.0, abs=0.02)  # the grip alone lets it hang by 0.1


def test_a_hand_that_expects_nothing_lets_a_sudden_weight_slip():
    one = hand()
    one.grasp(np.zeros(3), LEVEL, 0.0)
    body = Falling(one)
    body.velocity_m_s[2] = -1.5  # it falls into the hand
    body.run(1.0)
    assert not one.holds
    assert body.at_m[2] < -1.0


def test_no_arm_is_stronger_than_it_is():
    one = hand(stiffness_n_m=300.0, strongest_n=9.0)
    one.grasp(np.zeros(3), LEVEL)
    one.felt_n = 20.0
    one.target_m = np.array([1.0, 0.0, 0.0])
    forces = [one.step(STEP_S, STILL, STILL, LEVEL, STILL, MASS_KG)[0] for _ in range(2000)]
    assert np.mean(forces[-500:], axis=0)[0] == pytest.approx(9.0, abs=0.6)


def test_a_turned_object_is_turned_back():
    one = hand()
    start = Rotation.from_rotvec([0.3, -0.2, 0.5])
    one.grasp(np.zeros(3), start.as_quat())
    way = np.array([0.02, -0.03, 0.01])
    turned = (Rotation.from_rotvec(way) * start).as_quat()
    for quaternion in (turned, -turned):
        _, torque = one.step(STEP_S, STILL, STILL, quaternion, STILL, MASS_KG)
        np.testing.assert_allclose(torque, -4.0 * way, rtol=1e-3)


def test_a_taker_waits_for_rest_lifts_about_the_weight_and_leaves():
    manner = Manner.draw(np.random.default_rng(1), WEIGHT_N)
    one = hand()
    taker = Taker(one, manner)
    body = Falling(one)
    body.at_m = np.array([-0.3, 0.0, 0.1])
    place = body.at_m.copy()

    def act(t, point):
        taker.step(t, SeenRobot(place, LEVEL, rests=t > 0.5))
        if not one.holds or one.lift_n < 0.9 * manner.weight_n:  # the robot holds it
            body.at_m[:], body.velocity_m_s[:] = place, 0.0

    early = 0.5 + manner.reaction_s + manner.busy_s
    body.run(early, act)
    np.testing.assert_allclose(one.target_m, 0.0)
    body.run(4.0, lambda t, point: act(t + early, point))
    assert one.holds
    assert body.at_m[0] > place[0] + 0.15
    assert one.lift_n == pytest.approx(manner.weight_n)


MANNER = Manner.draw(np.random.default_rng(2), WEIGHT_N)
GIVEN_M = np.array([-0.2, 0.0, 0.0])


def giving():
    """A hand that holds an object, and who gives that."""
    one = hand()
    one.grasp(np.zeros(3), LEVEL)
    one.felt_n = WEIGHT_N
    return one, Giver(one, MANNER, GIVEN_M)


def test_a_giver_lets_go_only_of_what_the_robot_holds():
    for closed in (False, True):
        one, giver = giving()
        body = Falling(one)

        def act(t, point, giver=giver, body=body, closed=closed):
            holds = closed and t > 2.0
            giver.step(t, SeenRobot(point, LEVEL, rests=True, closed=holds))
            if holds:
                body.velocity_m_s[:] = 0.0

        body.run(4.0, act)
        assert one.holds is not closed


def test_a_giver_keeps_what_the_fingers_closed_on_and_opened_again():
    one, giver = giving()
    touched = (2.0, 2.1 + MANNER.reaction_s)

    def act(t, point):
        giver.step(t, SeenRobot(point, LEVEL, rests=True, closed=touched[0] < t < touched[1]))

    Falling(one).run(4.0, act)
    assert one.holds
    assert one.lift_n == pytest.approx(MANNER.weight_n)


def test_a_giver_takes_back_what_met_a_finger_and_brings_it_where_it_should_be():
    (one, giver), ways = giving(), []
    for t in np.arange(0.0, 5.0, STEP_S):
        one.felt_n = WEIGHT_N + (5.0 if 1.2 < t < 1.4 else 0.0)
        giver.step(t, SeenRobot(GIVEN_M, LEVEL, rests=True))
        ways.append(one.target_m @ MANNER.toward)
        if t <= 1.2:
            np.testing.assert_allclose(one.target_m[1:], 0.0)
    np.testing.assert_allclose(one.target_m, GIVEN_M - MANNER.miss_m)
    assert max(ways[1200:]) > ways[-1] + 0.04
