# SPDX-License-Identifier: Apache-2.0
"""Ways that are under way become slower as somebody comes, and quicker as they leave."""

from dataclasses import replace

import numpy as np
import pytest
from activation_world import World
from clearance_world import ARM, FAR_M, PATH, person

from intent_recognition.activation import Mode, PretriggerSettings
from intent_recognition.motion import Separation, SeparationSettings, SlowPlaces

SEPARATION = Separation(ARM)


def on_the_way_home(**settings):
    """After an interaction, with a person far away."""
    world = World(separation=SEPARATION, **settings)
    world.run(0.3)
    world.serve("plate")
    world.run(2.0)
    world.task = "idle"
    world.activation.take_people((person(FAR_M),))
    world.run_until(Mode.HOMING)
    return world


HALFWAY = ARM.forward_kinematics(PATH.spline(0.4))[:3, 3] + [0.0, 0.0, 0.05]


def test_a_person_who_comes_slows_the_way_that_is_under_way_and_who_leaves_quickens_it():
    world = on_the_way_home()
    world.run(0.25)
    n, unslowed_ns = len(world.commands), world.commands[-1].end_ns
    world.activation.take_people((person(HALFWAY),))
    world.run(0.3)
    brake, *_, slow = world.commands[n:]
    assert (brake.plan.kind, slow.plan.kind) == ("stop", "home")
    assert slow.end_ns > unslowed_ns + 500_000_000
    assert SEPARATION.excess(slow.plan, slow.start_ns, person(HALFWAY)) <= 1.0
    world.activation.take_people((person(FAR_M),))
    world.run(0.1)
    assert world.commands[-1].end_ns < slow.end_ns - 200_000_000
    world.go_home()


@pytest.mark.parametrize("places", [None, SlowPlaces(ARM, np.array([[*FAR_M, 0.1, 0.05]]))])
def test_a_slowed_way_stays_slow_where_people_are_unknown(places):
    world = on_the_way_home(slow_places=places)
    world.activation.take_people((person(HALFWAY),))
    world.run(0.5)
    slow = world.commands[-1]
    assert slow.way.slowed
    world.activation.take_people(())
    world.run(0.3)
    assert world.commands[-1] is slow


def test_a_way_that_is_under_way_is_slow_at_the_places_of_an_arm_described_anew():
    world = World()
    world.run(0.3)
    world.serve("plate")
    world.run(2.0)
    world.task = "idle"
    world.run_until(Mode.HOMING)
    world.run(0.25)
    n, places = len(world.commands), SlowPlaces(ARM, np.array([[*HALFWAY, 0.15, 0.05]]))
    assert places.excess(world.commands[-1].plan) > 2.0
    world.activation.change(replace(world.activation._settings, slow_places=places))
    world.run(1.0)
    assert {command.plan.kind for command in world.commands[n:]} <= {"stop", "home"}
    slow = world.commands[-1]
    assert slow.plan.kind == "home" and places.excess(slow.plan) <= 1.0
    world.go_home()


def test_an_arm_at_rest_beside_a_person_goes_home_however_slowly():
    separation = Separation(ARM, SeparationSettings(least_speed_m_s=0.01))
    world = World(separation=separation)
    world.serve("plate")
    world.run(2.0)
    world.task = "idle"
    world.activation.take_people((person(HALFWAY),))
    world.run_until(Mode.HOMING)
    world.run(1.0)  # it may brake before
    home = world.commands[-1]
    assert home.plan.kind == "home" and home.plan.duration_s > 30.0
    assert separation.excess(home.plan, home.start_ns, person(HALFWAY)) <= 1.0


def test_an_arm_beside_a_person_joins_a_path_it_is_off_however_slowly():
    """Such as that of a task which begins near a position limit, where paths are bent inside."""
    separation = Separation(ARM, SeparationSettings(least_speed_m_s=0.05))
    world = World(separation=separation)
    world.push = np.full(7, 0.1)
    world.activation.take_people((person(HALFWAY),))
    world.run(0.2)
    world.begin("plate")
    world.until(lambda: world.commands or world.rejected)
    (begun,) = world.commands
    assert not world.rejected and world.activation.counts["slowed by person"]
    assert 0.5 < separation.excess(begun.plan, begun.start_ns, person(HALFWAY)) <= 1.0


@pytest.mark.parametrize(
    ("people", "least"),
    [
        (lambda k: (person(HALFWAY + [0.0, 0.0, 0.002 * k], 0.02),), 2),
        (lambda _: (person(HALFWAY),), 1),
        (lambda _: (person(HALFWAY, 0.02), person(FAR_M)), 1),
    ],
    ids=["they move in small steps", "where they are is surer", "somebody else comes"],
)
def test_a_slowed_way_is_planned_again_when_people_change_not_while_they_rest(people, least):
    world, rng = on_the_way_home(), np.random.default_rng(1)

    def sent(seconds, people):
        n = len(world.commands)
        for k in range(round(seconds * 100)):
            world.activation.take_people(people(k))
            world.step()
        return len(world.commands) - n

    def resting(_):
        return (person(HALFWAY + rng.normal(0.0, 1e-3, 3), 0.02),)

    sent(0.5, resting)
    assert world.commands[-1].way.slowed
    assert sent(1.0, resting) == 0 and sent(0.2, people) >= least


def test_going_ahead_slows_near_the_person():
    start = PATH.spline(0.8)
    settings = PretriggerSettings(0.5, 3.0, {"screw": start})
    world = World(separation=SEPARATION, pretrigger=settings)
    world.serve("plate")
    world.task = "idle"
    world.run_until(Mode.HOMING)
    world.activation.take_people((person(HALFWAY),))
    world.activation.pretrigger.take_expectation(world.now_ns, ["screw"], np.ones(1))
    world.run_until(Mode.PRETRIGGERED)
    (ahead,) = (each for each in world.commands if each.plan.kind == "pretrigger")
    assert SEPARATION.excess(ahead.plan, ahead.start_ns, person(HALFWAY)) <= 1.0
    world.run(6.0)
    np.testing.assert_allclose(ahead.plan.end, start, atol=1e-9)
    world.check_continuous()


def test_the_reaction_time_includes_the_lead_of_commands():
    """Somebody is known from the start, not so near that the least speed counts."""
    beside = person(HALFWAY + [0.0, 0.0, 0.6])
    world = World(separation=SEPARATION, lead_s=0.3)
    world.activation.take_people((beside,))
    world.begin("plate", already_s=0.3)
    world.run(2.0)
    slow = Separation(ARM, SeparationSettings(reaction_s=0.34))
    assert world.activation.counts["slowed by person"] > 0
    assert max(slow.excess(c.plan, c.start_ns, beside) for c in world.commands) <= 1.0 + 1e-6
