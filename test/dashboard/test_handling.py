# SPDX-License-Identifier: Apache-2.0
"""Who holds which body, concluded from task, hand and wrist along whole handovers."""

from dataclasses import replace

import numpy as np

from intent_recognition.dashboard.handling import (
    GLIDE_S,
    BodyHolder,
    Handling,
    HandlingMoment,
    between,
)
from intent_recognition.dashboard.scene_file import PERSON, Body

GIVE, HOLD = "give", "hold"
HOME, GRASP, MEET = (np.array(p) for p in ([0.4, 0, 0.4], [0.5, -0.3, 0.3], [0.7, 0, 0.35]))
RESTS, REACHES = np.array([1.1, 0.0, 0.3]), np.array([0.85, 0.0, 0.35])
STEP_S = 0.04


def body(name, **values):
    at, grasp = (tuple((GRASP + [x, 0.0, 0.0]).tolist()) for x in (0.09, 0.0))
    given = {"task": GIVE, "grasp": grasp, "laid": (1.0, -0.3, 0.1)} | values
    return Body(name=name, xyz=at, parts=(), **given)


class Told:
    """A cell told in sentences; positions of hand and wrist change along straight lines."""

    def __init__(self, *bodies):
        self.handling = Handling(bodies)
        self.hand, self.wrist = HOME, RESTS
        self.now = HandlingMoment(0.0, "", "", pose_at(HOME), {"": RESTS})
        self.places = {b.name: [] for b in bodies}

    def goes(self, hand=None, wrist=None, seconds=1.0, **said):
        hand = self.hand if hand is None else hand
        wrist = self.wrist if wrist is None else wrist
        for share in np.linspace(0.0, 1.0, int(seconds / STEP_S)):
            said["hand"] = pose_at(self.hand + share * (hand - self.hand))
            at = {self.now.helped: self.wrist + share * (wrist - self.wrist)}
            said |= {"now_s": self.now.now_s + STEP_S, "wrists": {**self.now.wrists} | at}
            self.now = replace(self.now, **said)
            self.handling.update(self.now)
            for name, places in self.places.items():
                places.append(self.handling.pose(name)[:3, 3])
        self.hand, self.wrist = hand, wrist
        return self

    def largest_step(self, name):
        return np.linalg.norm(np.diff(self.places[name], axis=0), axis=1).max()


def pose_at(position):
    pose = np.eye(4)
    pose[:3, 3] = position
    return pose


def test_the_robot_takes_carries_and_gives_and_the_person_lays_down():
    told, plate = Told(body("plate")), "plate"
    assert told.goes(seconds=0.5).handling.holder(plate) is BodyHolder.PLACE
    told.goes(wrist=REACHES, active=GIVE, begun=GIVE)
    assert told.goes(hand=GRASP).handling.holder(plate) is BodyHolder.PLACE
    assert told.goes(hand=GRASP + 0.3 * (MEET - GRASP)).handling.holder(plate) is BodyHolder.ROBOT
    told.goes(hand=MEET)
    np.testing.assert_allclose(told.handling.pose(plate)[:3, 3] - MEET, [0.09, 0, 0], atol=0.02)
    assert told.goes(seconds=0.5).handling.holder(plate) is BodyHolder.PERSON
    before = told.handling.pose(plate)[:3, 3] - told.wrist
    told.goes(hand=HOME, wrist=RESTS, active="", begun="")
    np.testing.assert_allclose(told.handling.pose(plate)[:3, 3] - RESTS, before, atol=1e-12)
    assert told.goes(seconds=1.2).handling.holder(plate) is BodyHolder.LAID
    np.testing.assert_allclose(told.handling.pose(plate)[:3, 3], [1.0, -0.3, 0.1])
    assert told.largest_step(plate) < 0.08  # nothing jumps
    assert told.goes(active=GIVE, seconds=0.1).handling.holder(plate) is BodyHolder.PLACE


def test_who_never_comes_near_takes_nothing():
    driver = body("driver", task=HOLD, brought_by=PERSON, in_hand=(-0.1, 0.0, 0.0))
    told = Told(body("plate"), body("other", task=HOLD), driver)
    told.goes(hand=GRASP + [0.0, 0.0, 0.1], active=GIVE, begun=GIVE).goes(hand=MEET).goes()
    assert told.handling.holder("plate") is BodyHolder.PLACE
    told.goes(hand=GRASP).goes(hand=MEET)
    assert told.handling.holder("other") is told.handling.holder("driver") is BodyHolder.PLACE


def test_without_an_active_task_the_hand_takes_nothing_and_unknown_hands_neither():
    told = Told(body("plate"))
    told.goes(hand=GRASP, begun=GIVE).goes(hand=MEET)
    assert told.handling.holder("plate") is BodyHolder.PLACE
    handling = Handling([body("plate")])
    for k in range(50):
        handling.update(HandlingMoment(0.1 * k, GIVE, GIVE, None, {}))
    np.testing.assert_array_equal(handling.pose("plate"), body("plate").pose)


def test_what_was_given_to_somebody_stays_there_when_the_arm_helps_another():
    told = Told(body("plate"))
    told.goes(wrist=REACHES, active=GIVE, begun=GIVE, helped="anna")
    told.goes(hand=GRASP).goes(hand=GRASP + [0, 0.1, 0.05]).goes(hand=MEET).goes()
    assert told.handling.holder("plate") is BodyHolder.PERSON
    told.goes(active="", begun="")
    before = told.handling.pose("plate")
    told.now = replace(told.now, wrists={**told.now.wrists, "ben": RESTS})
    told.goes(wrist=RESTS - [0.0, 0.3, 0.0], active=HOLD, begun=HOLD, helped="ben")
    np.testing.assert_array_equal(told.handling.pose("plate"), before)


def test_what_was_taken_for_a_task_that_is_given_up_goes_back():
    told = Told(body("plate"))
    told.goes(active=GIVE, begun=GIVE).goes(hand=GRASP).goes(hand=GRASP + [0, 0.1, 0.05])
    assert told.handling.holder("plate") is BodyHolder.ROBOT
    told.goes(active=HOLD, begun=HOLD, seconds=GLIDE_S + 0.2)
    assert told.handling.holder("plate") is BodyHolder.PLACE
    np.testing.assert_array_equal(told.handling.pose("plate"), body("plate").pose)


def test_what_an_arm_that_is_guided_away_holds_was_not_given():
    told = Told(body("plate"))
    told.goes(wrist=REACHES, active=GIVE, begun=GIVE).goes(hand=GRASP)
    told.goes(hand=GRASP + 0.5 * (MEET - GRASP))
    assert told.now.together and told.handling.holder("plate") is BodyHolder.ROBOT
    told.goes(hand=GRASP + 0.6 * (MEET - GRASP), seconds=0.2, active="")
    assert told.handling.holder("plate") is BodyHolder.PLACE


def test_nothing_hangs_in_the_air_beside_who_holds_it():
    told = Told(body("plate"))
    told.goes(wrist=REACHES + [0.2, 0.0, 0.0], active=GIVE, begun=GIVE).goes(hand=GRASP)
    told.goes(hand=MEET).goes(seconds=GLIDE_S + 0.5)
    assert told.handling.holder("plate") is BodyHolder.PERSON
    from_wrist = told.handling.pose("plate")[:3, 3] - told.wrist
    np.testing.assert_allclose(np.linalg.norm(from_wrist), 0.1)
    assert told.largest_step("plate") < 0.08


def test_what_the_person_brings_is_taken_where_hands_meet():
    driver = body("driver", task=HOLD, brought_by=PERSON, in_hand=(-0.1, 0.0, 0.0))
    told = Told(driver)
    told.goes(wrist=REACHES, begun=HOLD)
    assert told.handling.holder("driver") is BodyHolder.PERSON
    np.testing.assert_allclose(told.handling.pose("driver")[:3, 3] - REACHES, [-0.1, 0, 0])
    told.goes(seconds=0.5, active=HOLD)
    assert told.handling.holder("driver") is BodyHolder.PERSON  # the hand rests, but at home
    told.goes(hand=MEET).goes(seconds=0.5)
    assert told.handling.holder("driver") is BodyHolder.ROBOT
    told.goes(seconds=0.2, active="", begun="")
    assert told.handling.holder("driver") is BodyHolder.PERSON
    assert told.goes(wrist=RESTS).goes(seconds=1.5).handling.holder("driver") is BodyHolder.LAID


def test_between_two_poses_both_ends_are_kept():
    end = pose_at(MEET)
    end[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    for share, expected in ((0.0, pose_at(HOME)), (1.0, end)):
        np.testing.assert_allclose(between(pose_at(HOME), end, share), expected, atol=1e-12)
