# SPDX-License-Identifier: Apache-2.0
"""Paths planned anew: from the same start to the same end, clear, inside the limits."""

import numpy as np
import pytest
from activation_world import LIMITS
from clearance_world import (
    PATH,
    POSITIONS,
    TIMES,
    bodies_among,
    box_beside,
    clearance,
    plan_along,
)

from intent_recognition.kinematics import Box, hand_position
from intent_recognition.motion import Obstruction, bending, make_path
from intent_recognition.motion.plan import within

ENDS = np.array([0.0, 1.0])


def cluttered(seed, n_boxes=2):
    """Boxes about the middle of the path that leave both ends clear; one is in its way."""
    rng, boxes = np.random.default_rng(seed), [box_beside(0.02 + 0.01 * (seed % 3))]
    for _ in range(20):
        at = hand_position(PATH.spline(rng.uniform(0.3, 0.7))) + rng.normal(0.0, 0.1, 3)
        box = Box(f"box {len(boxes)}", tuple(at), tuple(rng.uniform(0.03, 0.08, 3)))
        near = bodies_among(box, clearance_m=0.04)
        if not any(near.contacts(end[None]) for end in PATH.spline(ENDS)):
            boxes.append(box)
        if len(boxes) == n_boxes:
            break
    return boxes


@pytest.mark.parametrize("seed", range(4))
def test_a_path_through_things_goes_around_them_from_start_to_end(seed):
    boxes = cluttered(seed)
    guard = clearance(*boxes, spreads={})
    assert guard.obstruction(plan_along(PATH)) is not None
    found = guard.clear(PATH, "plate", 0.0, LIMITS, tries=0)
    assert found.how == "replanned"
    np.testing.assert_allclose(found.path.spline(ENDS), PATH.spline(ENDS), atol=1e-9)
    plan = plan_along(found.path)
    assert guard.obstruction(plan) is None and plan.clamped == ()
    assert within(plan.times_s, plan.positions, plan.velocities, LIMITS)
    every_ms = plan.sampled(np.arange(0.0, plan.duration_s, 1e-3))[0]
    assert bodies_among(*boxes, clearance_m=0.0199).contacts(every_ms) == []


def test_joints_stay_inside_their_limits_around_a_thing():
    """The least detour turns joint 1 farther than its limit, once that is drawn in."""
    guard = clearance(box_beside(0.04), spreads={})
    free = guard.clear(PATH, "plate", 0.0, LIMITS)
    joint = int(np.abs(free.away).max(axis=0).argmax())
    outermost = free.path.spline(np.linspace(0.0, 1.0, 201))[:, joint]
    upper, lower = LIMITS.upper.copy(), LIMITS.lower.copy()
    middle = 0.5 * (outermost.max() + POSITIONS[:, joint].max())
    if middle > POSITIONS[:, joint].max() + 1e-3:
        upper[joint] = middle
    else:
        lower[joint] = 0.5 * (outermost.min() + POSITIONS[:, joint].min())
    narrow = LIMITS.__class__(lower, upper, LIMITS.velocity, LIMITS.acceleration, LIMITS.torque)
    found = guard.clear(PATH, "plate", 0.0, narrow, tries=0)
    assert found.how == "replanned" and found.path.clamped == ()
    q = found.path.spline(np.linspace(0.0, 1.0, 201))
    assert np.all(q < upper) and np.all(q > lower)


def test_on_the_way_a_path_goes_on_from_where_it_is():
    guard = clearance(box_beside(0.04), spreads={})
    found = guard.clear(PATH, "plate", 0.2, LIMITS)
    phases = np.linspace(0.0, 0.2, 9)
    np.testing.assert_allclose(found.path.spline(phases), PATH.spline(phases), atol=2e-3)
    moved = clearance(box_beside(0.04), box_beside(-0.02, 0.02), spreads={})
    later = moved.clear(make_path(TIMES, POSITIONS + 1e-3, LIMITS), "plate", 0.3, LIMITS, found)
    assert later.how == "replanned"
    k = int(0.3 * (len(later.away) - 1))
    np.testing.assert_allclose(later.away[: k + 1], found.away[: k + 1], atol=1e-9)


def test_where_the_end_touches_there_is_no_way_and_nothing_is_drawn():
    at = hand_position(PATH.spline(1.0))
    guard = clearance(
        Box("cup", tuple(at), (0.05, 0.05, 0.05)), clock=iter([0.0]).__next__
    )  # asked once, for the beginning
    found = guard.clear(PATH, "plate", 0.0, LIMITS, tries=0)
    assert isinstance(found, Obstruction) and found.bodies[1] == "cup"


def touching():
    """The path among a box, and the detours that may bend it."""
    bodies, phases = bodies_among(box_beside(0.03)), np.linspace(0.0, 1.0, 61)
    q, moves = PATH.spline(phases), bending.detours(phases, 7, 0.0)
    return bending.TouchingPath(bodies, q, moves, bodies.contacts(q), LIMITS)


def test_a_detour_that_is_clear_is_drawn_in_to_the_least_bend():
    path = touching()
    least = np.linalg.norm(bending.bend(path))
    found = bending.bend(path, start=1.5 * bending.bend(path))
    assert np.linalg.norm(found) == pytest.approx(least, rel=0.1)


@pytest.mark.parametrize("n_in_time, tries", [(0, 0), (2, 0), (9, 1), (9, None)])
def test_descents_are_counted_and_end_with_the_budget(monkeypatch, n_in_time, tries):
    """Other detours in the next search, the same in the same one; none where there is no time."""
    starts = []

    def finds_nothing(*_args, start=None):
        starts.append(start)

    monkeypatch.setattr(bending, "bend", finds_nothing)
    path, nearest = touching(), {}
    for one in path.contacts:
        nearest[one.pair] = min(one.distance_m, nearest.get(one.pair, np.inf))
    depth = sum(path.bodies.clearance_m - distance_m for distance_m in nearest.values())
    assert bending._depth(path, np.zeros(path.moves.shape[2])) == pytest.approx(depth, abs=1e-5)
    drawn = []
    for search in (tries, tries, 5):
        starts.clear()
        answers = iter([False] * n_in_time + [True] * 9)
        found = bending.replan(path, search, answers.__next__)
        assert found == (None, search is not None)
        assert starts[0] is None
        assert len(starts) == 1 + (0 if search is None else min(n_in_time, 4))
        drawn.append([start.tobytes() for start in starts[1:]])
    assert drawn[0] == drawn[1] and not set(drawn[1]) & set(drawn[2])
