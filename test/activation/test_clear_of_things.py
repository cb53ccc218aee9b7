# SPDX-License-Identifier: Apache-2.0
"""The activation among boxes: it bends, refuses by name, goes back the way it came."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from activation_world import GOALS, HOME, World
from clearance_world import ARM, bodies_among, box_beside, clearance, primitive

from intent_recognition.activation.states import Mode
from intent_recognition.activation.things import SEARCH_EVERY_NS, Things
from intent_recognition.kinematics import Box, hand_position
from intent_recognition.motion import Obstruction, Spread


def way(world):
    """Everything the arm was asked for, every 5 ms (T, 7)."""
    times = range(world.commands[0].start_ns, world.commands[-1].end_ns, 5_000_000)
    return np.array([world.reference(t).position for t in times])


def interact(world):
    world.run(0.3)
    world.begin("plate")
    world.run(4.0)
    world.task = "idle"
    world.run(6.0)


@pytest.mark.slow
@pytest.mark.parametrize("depth_m", [0.01, 0.03])
def test_an_interaction_goes_around_a_box(depth_m):
    box = box_beside(depth_m)
    touches, clear = World(), World(clearance=clearance(box))
    for world in (touches, clear):
        interact(world)
        assert world.modes == [Mode.IDLE, Mode.EXECUTING, Mode.HOMING, Mode.IDLE]
    bodies = bodies_among(box, clearance_m=0.001)
    assert bodies.contacts(way(touches))
    assert bodies.contacts(way(clear)) == []
    clear.check_continuous()
    assert clear.activation.counts["bent"] > 0
    np.testing.assert_allclose(clear.commands[-1].plan.end, HOME, atol=1e-6)


@pytest.mark.slow
def test_an_arm_that_turned_about_its_hand_does_not_in_the_next_interaction():
    of_hand = {"plate": Spread.of(primitive(3), ARM)}
    elbow_m = ARM.skeleton((HOME + GOALS["plate"])[None])[0, 3]
    post = Box("post", tuple(elbow_m + [0.0, 0.12, 0.0]), (0.06,) * 3)
    world = World(clearance=clearance(post, spreads=of_hand))
    interact(world)
    n_turned = world.activation.counts["replanned"]
    assert n_turned and world.activation.mode is Mode.IDLE
    change(world, clearance=clearance(spreads=of_hand))
    interact(world)
    assert world.activation.counts["started"] == 2
    assert world.activation.counts["replanned"] == n_turned


def test_what_cannot_be_bent_is_refused_and_the_arm_stays_where_nothing_is_planned_anew():
    world = World(clearance=clearance(box_beside(0.03), largest=0.1, replan_budget_s=0.0))
    interact(world)
    assert world.commands == [] and world.modes == [Mode.IDLE]
    assert world.activation.counts["refused"] > 0 and "would_touch" in world.rejected


def arrived(**settings):
    """A world whose arm is at the end of its path."""
    world = World(clearance=clearance(), hold_s=3.0, **settings)
    world.run(0.3)
    world.serve("plate")
    world.run(2.5)
    return world


def change(world, **changes):
    world.activation.change(replace(world.activation._parts.settings, **changes))


@pytest.mark.slow
@pytest.mark.parametrize("under_way", [False, True])
def test_where_the_straight_way_home_is_blocked_it_goes_around(under_way):
    world = arrived()
    home = HOME + np.array([1.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    straight = hand_position(0.5 * (world.arm() + home))
    box = Box("post", tuple(straight), (0.04, 0.04, 0.04))
    change(world, home=home)
    world.task = "idle"
    if under_way:
        world.run_until(Mode.HOMING)
        world.run(0.2)
    change(world, clearance=clearance(box))
    world.run(10.0)
    assert world.commands[-1].plan.kind == "home" and world.activation.mode is Mode.IDLE
    assert bodies_among(box, clearance_m=0.001).contacts(way(world)) == []
    np.testing.assert_allclose(world.arm(), home, atol=0.05)
    assert world.activation.counts["braked for things"] == under_way
    assert world.activation.counts["replanned"] == 1 and not world.activation.counts["refused"]
    world.check_continuous()


def test_where_people_forbid_the_way_around_the_arm_stays_and_says_so(monkeypatch):
    world = arrived()
    home = HOME + np.array([1.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    box = Box("post", tuple(hand_position(0.5 * (world.arm() + home))), (0.04, 0.04, 0.04))
    change(world, home=home, clearance=clearance(box))
    world.task = "idle"
    monkeypatch.setattr(world.activation.motions, "_way_along", lambda *_: None)
    world.run_until(Mode.IDLE)
    assert "infeasible" in world.rejected and not world.activation.counts["refused"]


def test_where_no_way_home_is_clear_the_arm_stays_and_asks_once():
    world = arrived()
    at = world.arm()
    wall = Box("wall", tuple(hand_position(HOME + 0.5 * GOALS["plate"])), (0.5, 0.5, 0.02))
    change(world, clearance=clearance(wall))
    world.task = "idle"
    world.run(5.0)
    assert "home" not in {c.plan.kind for c in world.commands}
    assert world.activation.mode is Mode.IDLE
    np.testing.assert_allclose(world.arm(), at, atol=0.02)  # it follows until the person rests
    assert world.activation.counts["refused"] == 1


def test_a_way_that_takes_its_time_is_searched_at_rest_and_now_and_then():
    """Each search goes on with other draws, until an interaction begins."""
    tries, blocked = [], Obstruction(("arm", "box"), "at the end")
    searches = SimpleNamespace(clear=lambda *asked: tries.append(asked[-1]) or blocked)
    settings, arm = SimpleNamespace(clearance=searches, limits=None), SimpleNamespace()
    things = Things(SimpleNamespace(settings=settings, reject=None, counts={}), arm)
    for now_s, moves in ((1.0, True), (1.0, False), (1.2, False), (1.3, True), (1.3, False)):
        arm.under_way = lambda _, moves=moves: moves
        assert things.clear(round(1e9 * now_s), None, "plate", 0.0, None) is blocked
    assert tries == [None, 0, None, None, 1]


def blocked_end():
    """A box that no detour can avoid: at the end of the path."""
    at = hand_position(HOME + GOALS["plate"])
    return clearance(Box("cup", tuple(at), (0.06, 0.06, 0.06)))


def before_blocked_end(seconds):
    world = World(clearance=blocked_end())
    world.run(0.3)
    world.begin("plate")
    world.run(seconds)
    return world


@pytest.mark.slow
@pytest.mark.parametrize("rests_first", [False, True])
def test_it_waits_until_the_thing_is_gone(rests_first):
    """Also after the person's movement."""
    world = before_blocked_end(1.5)
    assert world.commands == [] and world.activation.mode is Mode.IDLE
    assert world.activation.waits_for.startswith("plate: lwr_a")
    assert world.activation.counts["waited"] == 1 and not world.activation.counts["refused"]
    if rests_first:
        world.task = "idle"
        world.run(1.0)
        assert world.commands == []
    change(world, clearance=clearance())
    world.run_until(Mode.EXECUTING, 0.5)
    assert not world.activation.waits_for
    world.run_until(Mode.HOMING)
    ended = [c for c in world.commands if c.plan.kind == "interaction"][-1].plan.end
    np.testing.assert_allclose(ended, HOME + GOALS["plate"], atol=0.05)
    world.check_continuous()


def test_what_waited_in_vain_is_refused_once():
    world, asked_ns = before_blocked_end(1.0), []
    guard = world.activation._parts.settings.clearance
    search = guard.clear
    guard.clear = lambda *way: asked_ns.append(world.now_ns) or search(*way)
    world.task = "idle"
    world.run(4.0)
    assert len(asked_ns) > 3 and np.diff(asked_ns).min() >= SEARCH_EVERY_NS
    counts = world.activation.counts
    assert (counts["waited"], counts["refused"]) == (1, 1) and not world.activation.waits_for
    change(world, clearance=clearance())
    world.run(1.0)
    assert world.commands == [] and world.activation.mode is Mode.IDLE


def test_what_waited_is_forgotten_by_a_reset():
    world = before_blocked_end(1.0)
    world.task = "idle"
    world.run(0.3)
    assert world.activation.waits_for
    world.activation.reset(world.now_ns)
    assert not world.activation.waits_for
    change(world, clearance=clearance())
    world.run(1.0)
    assert world.commands == [] and world.activation.mode is Mode.IDLE


def test_a_motion_begins_after_the_search_for_its_way():
    world = World(clearance=clearance())
    guard = world.activation._parts.settings.clearance
    search = guard.clear
    guard.clear = lambda *way: search(*way)._replace(later_s=0.25)
    world.serve("plate")
    assert world.commands[0].start_ns >= world.now_ns + 250_000_000


@pytest.mark.slow
@pytest.mark.parametrize("goes_away", [True, False])
def test_what_comes_in_the_way_of_a_motion_makes_it_brake_and_go_on(goes_away):
    world = World(clearance=clearance(), hold_s=0.5)
    world.run(0.3)
    world.serve("plate")
    world.run(0.2)
    change(world, clearance=blocked_end())
    world.run(1.5)
    assert world.activation.counts["braked for things"] == 1
    stopped = world.arm()
    assert np.abs(stopped - HOME - GOALS["plate"]).max() > 0.1
    world.task = "idle"
    world.run(1.0)
    if goes_away:
        change(world, clearance=clearance())
    world.run(8.0)
    ended = [c for c in world.commands if c.plan.kind != "home"][-1].plan.end
    arrives = np.abs(ended - HOME - GOALS["plate"]).max() < 0.05
    assert arrives == goes_away and world.activation.counts["refused"] == (not goes_away)
    assert world.activation.mode is Mode.IDLE
    np.testing.assert_allclose(world.arm(), HOME, atol=1e-3)
    world.check_continuous()


def test_an_arm_that_was_moved_after_a_brake_waits_for_a_way_and_goes_home():
    """The way of the next task is blocked, too."""
    boxes = [Box(goal, tuple(hand_position(HOME + GOALS[goal])), (0.06,) * 3) for goal in GOALS]
    world = World(clearance=clearance())
    world.duration_s = 5.0
    world.run(0.3)
    world.begin("plate")
    world.run_until(Mode.EXECUTING)
    world.run(0.2)
    change(world, clearance=clearance(*boxes))
    world.run(1.2)
    world.push = 0.1 * np.eye(7)[3]
    world.run(0.1)
    world.begin("screw", 0.5)
    world.run(1.5)
    assert world.activation.counts["waited"] == 1
    change(world, clearance=clearance())
    world.task = "idle"
    world.run(8.0)
    assert world.activation.mode is Mode.IDLE
    np.testing.assert_allclose(world.commands[-1].plan.end, HOME, atol=1e-6)
