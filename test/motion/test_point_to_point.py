# SPDX-License-Identifier: Apache-2.0
"""Ways home and brakes: limited jerk, smooth from a moving start, acceptable to the arm."""

import numpy as np
import pytest
from activation_world import HOME, LIMITS
from clearance_world import accept
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.errors import TrajectoryError
from intent_recognition.motion.plan import JointPlan, JointReference, within
from intent_recognition.motion.point_to_point import RISE_TIME_S, brake_plan, posture_plan

JERK = LIMITS.acceleration / RISE_TIME_S
few = settings(max_examples=30, deadline=None)
seeds = st.integers(0, 10_000)


def posture(rng) -> np.ndarray:
    return rng.uniform(0.95 * LIMITS.lower, 0.95 * LIMITS.upper)


def on_its_way(seed: int) -> tuple[JointPlan, JointReference]:
    """A plan from rest to rest, and its reference at some time."""
    rng = np.random.default_rng(seed)
    plan = posture_plan(JointReference.at_rest(posture(rng)), posture(rng), LIMITS)
    assert plan is not None
    return plan, plan.at(rng.uniform(0.0, plan.duration_s))


def check_accepted(plan: JointPlan) -> None:
    accept(plan)
    assert within(plan.times_s, plan.positions, plan.velocities, LIMITS)


@few
@given(seeds)
def test_from_rest_it_is_straight_with_limited_jerk(seed):
    plan, _ = on_its_way(seed)
    check_accepted(plan)
    h = plan.times_s[1]
    jerk = np.diff(plan.velocities, n=2, axis=0) / h**2  # a weighted mean over two steps
    used = (
        plan.velocities / LIMITS.velocity,
        np.diff(plan.velocities, axis=0) / h / LIMITS.acceleration,
    )
    for share, most in zip((*used, jerk / JERK), (0.6, 0.6, 1.0), strict=True):
        assert np.abs(share).max() == pytest.approx(most)  # of the joint that has the longest way
    way = plan.end - plan.positions[0]
    share = (plan.positions - plan.positions[0]) @ way / (way @ way)
    np.testing.assert_allclose(plan.positions, plan.positions[0] + np.outer(share, way), atol=1e-6)
    assert np.all(np.diff(share) >= -1e-9)


@few
@given(seeds)
def test_a_new_way_home_goes_on_smoothly_and_is_accepted(seed):
    _, start = on_its_way(seed)
    plan = posture_plan(start, HOME, LIMITS)
    assert plan is not None and plan.kind == "home" and not plan.phase.any()
    check_accepted(plan)
    np.testing.assert_allclose(plan.positions[0], start.position, atol=1e-12)
    np.testing.assert_allclose(plan.velocities[0], start.velocity, atol=1e-12)
    jump = np.abs(plan.at(0.0).acceleration - start.acceleration)
    assert np.all(jump <= 2.0 * JERK * plan.times_s[1])


@few
@given(seeds)
def test_a_brake_ends_near_and_is_accepted(seed):
    _, start = on_its_way(seed)
    plan = brake_plan(start, 0.2, LIMITS)
    check_accepted(plan)
    assert plan.clamped == () and np.all(plan.phase == 0.2)
    longest = (np.abs(start.velocity) / LIMITS.acceleration).max() + 2.0 * RISE_TIME_S
    assert plan.duration_s <= longest
    assert np.all(np.abs(plan.end - start.position) <= np.abs(start.velocity).max() * longest)


def test_at_home_it_stays_and_a_home_outside_the_limits_is_clamped_or_refused():
    plan = posture_plan(JointReference.at_rest(HOME), HOME, LIMITS)
    np.testing.assert_allclose(plan.positions, np.tile(HOME, (len(plan.times_s), 1)), atol=1e-12)
    plan = posture_plan(JointReference.at_rest(HOME), HOME + np.eye(7)[1] * 9.0, LIMITS)
    assert plan.clamped == (1,) and plan.end[1] == pytest.approx(LIMITS.upper[1], abs=1e-5)
    with pytest.raises(TrajectoryError, match="finite"):
        posture_plan(JointReference.at_rest(np.full(7, np.nan)), HOME, LIMITS)
