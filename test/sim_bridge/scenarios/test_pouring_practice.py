# SPDX-License-Identifier: Apache-2.0
"""Practising to pour: quick pours count balls as the arm's physics does, and stay in limits."""

from dataclasses import replace

import numpy as np
import pytest

from intent_recognition.promp import NormalizedRBFBasis
from intent_recognition.share import share_path
from intent_recognition.warping import WarpedPrimitive, tilts_to_level
from sim_bridge.practice import load_cost
from sim_bridge.scenarios.pouring import (
    PouringPractice,
    read_demonstrated,
    read_pour,
    seen_as,
)
from sim_bridge.scenarios.pouring.ball_pour import BallPours
from sim_bridge.scenarios.pouring.executed import container_named
from sim_bridge.scenarios.pouring.recordings import half_full_radius_m, true_references


@pytest.fixture(scope="module")
def primitive():
    """From the shipped demonstrations, by the containers' true references."""
    from intent_recognition.warping import to_warped

    shown = read_demonstrated(share_path("bags/pouring/train"))
    pair = [true_references(container_named(name)) for name in (shown.cup, shown.second)]
    paths = [to_warped(pour.offset_m, pour.tilt_rad, *pair) for pour in shown.pours]
    durations = [float(pour.times_s[-1]) for pour in shown.pours]
    return WarpedPrimitive.learn(paths, durations, NormalizedRBFBasis(20))


@pytest.mark.parametrize(
    ("name", "spilled", "kept"),
    [("tea_cup_paper_cup_mean", (0, 8), (5, 13)), ("mug_tumbler_mean", (0, 0), (0, 0))],
)
def test_quick_pours_end_as_those_that_the_arm_made(name, spilled, kept):
    path, labels = read_pour(share_path(f"bags/pouring/executed/{name}"))
    cup, second = (container_named(labels[key]) for key in ("cup", "second"))
    with BallPours(cup, second, half_full_radius_m(cup), 40) as pours:
        count = pours.pour(path, 0)
        assert pours.pour(path, 0) == count
    assert count.balls == 40 == count.caught + count.spilled + count.kept
    assert spilled[0] <= count.spilled <= spilled[1]
    assert kept[0] <= count.kept <= kept[1]


def test_a_rollout_is_logged_as_the_pour_it_was(primitive, tmp_path):
    with PouringPractice(primitive, "mug", "tumbler", wanted=30) as practice:
        space = practice.space
        assert practice.keeps_limits(space.mean)
        fast = PouringPractice.keeps_limits
        practice.primitive = replace(primitive, duration_s=0.5)
        assert not fast(practice, space.mean)
        practice.primitive = primitive
        assert not practice.keeps_limits(space.mean + 50.0)  # radii away: out of reach
        weights = space.weights(space.within(np.full(space.n_axes, 0.3)))
        rollout = practice.rollout(weights, np.random.default_rng(1))
        assert load_cost("level")(rollout) == abs(30.0 - rollout.outcome["caught"])
        practice.write(tmp_path / "000", rollout, {"rollout": "0"})
        path, labels = read_pour(tmp_path / "000")
        assert (labels["task"], labels["caught"]) == ("pouring", f"{rollout.outcome['caught']:g}")
        wanted = practice.path(weights)
    for axis in range(3):
        there = np.interp(path.times_s, wanted.times_s, wanted.offset_m[:, axis])
        np.testing.assert_allclose(path.offset_m[:, axis], there, atol=0.003)


def test_what_was_practised_pours_through_the_skill_as_it_was_practised(primitive):
    """To empty this cup, the levels ask for the tilts that the practised path has itself."""
    with PouringPractice(primitive, "tea_cup", "paper_cup") as practice:
        skill = practice.skill(practice.space.mean * 1.1, seed=1)
        path = practice.path(skill.primitive.mean)
    cup = seen_as("tea_cup", 1)
    ratios = path.tilt_rad / true_references(container_named("tea_cup")).tilt_rad
    tilts = tilts_to_level(ratios, skill.far, cup.emptying, 0.5, 0.0)
    assert tilts.max() == pytest.approx(ratios.max() * cup.references.tilt_rad, abs=1e-3)
