# SPDX-License-Identifier: Apache-2.0
"""The pole: geometry, ways around it, shipped recordings, and the experiment on a subset."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.pole import experiment as pole
from experiments.pole.geometry import (
    HOME,
    LEFT,
    MIRROR,
    POINTING_HEIGHT_M,
    POLE_M,
    RIGHT,
    WAYS,
    fingertip,
    planned_clearance,
    way_of,
    winding,
)
from experiments.pole.plan import CLEARANCE_M, LEAST_CLEARANCE_M, REACHED_M, can_reach, plan_way
from experiments.pole.world import Pole, execute
from experiments.settings import Settings
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics.lwr import LWR_LIMITS
from intent_recognition.report.html import ReportPage, Section, render
from intent_recognition.share import share_path
from sim_bridge.arm.arm import SimulatedArm

SPOT = np.array([0.57, 0.0])
SHARES = np.linspace(0.0, 1.0, 60)


@given(st.floats(-3.0, 3.0), st.integers(3, 40))
def test_winding_of_an_arc_is_its_angle(angle, count):
    turn = np.linspace(0.0, angle, count)
    arc = POLE_M + 0.3 * np.column_stack((np.cos(turn), np.sin(turn)))
    assert winding(arc) == pytest.approx(angle, abs=1e-9)


def test_arms_are_mirrored_and_far_spots_reached_on_their_own_side_only():
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 7))
    np.testing.assert_allclose(fingertip(q * MIRROR), fingertip(q) * [1, -1, 1], atol=1e-12)
    np.testing.assert_allclose(planned_clearance(q * MIRROR), planned_clearance(q), atol=1e-12)
    far = np.array([0.57, 0.17])
    assert can_reach(far, LEFT) and not can_reach(far, RIGHT)
    assert can_reach(far * [1, -1], RIGHT) and not can_reach(far * [1, -1], LEFT)
    with pytest.raises(KinematicsError, match="by the right of the pole"):
        plan_way(far, RIGHT)


@pytest.mark.parametrize("way", WAYS)
def test_a_way_points_at_the_spot_on_its_side_and_stays_clear(way):
    path = plan_way(SPOT, way).at(SHARES)
    tip = fingertip(path)
    assert np.linalg.norm(tip[-1] - [*SPOT, POINTING_HEIGHT_M]) < REACHED_M
    assert way_of(tip) == way
    assert planned_clearance(path).min() >= LEAST_CLEARANCE_M
    assert np.all((path > LWR_LIMITS.lower) & (path < LWR_LIMITS.upper))
    np.testing.assert_array_equal(path[0], HOME)


def test_planned_clearance_is_a_cautious_estimate_of_that_in_physics():
    path = plan_way(SPOT, LEFT).at(SHARES[::4])
    with SimulatedArm(path[0]) as arm:
        pole = Pole(arm)
        for q, planned in zip(path, planned_clearance(path), strict=True):
            arm.reset(q)
            assert max(planned - 0.012, 0.5 * CLEARANCE_M) <= pole.clearance(q)


@pytest.mark.slow
def test_execution_tells_a_motion_beside_the_pole_from_one_through_it():
    times = 2.5 * SHARES
    ways = {way: plan_way(SPOT, way).at((1 - np.cos(np.pi * SHARES)) / 2) for way in WAYS}
    beside = execute(ways[LEFT], times, rest_s=0.3)
    assert not beside.touched and beside.clearance_m.min() > 0.02
    assert np.linalg.norm(fingertip(beside.positions_rad[-1]) - fingertip(ways[LEFT][-1])) < 0.01
    assert execute(np.mean(list(ways.values()), axis=0), times, rest_s=0.3).touched


pytestmark = pytest.mark.slow  # the whole experiment runs first, in its quick form


def test_shipped_demonstrations_are_unlabelled_and_go_where_their_metadata_say():
    demonstrations, rejections = read_demonstrations(
        share_path("bags/pole"), load_dofs(share_path("config/dofs_pole.yaml"))
    )
    assert len(demonstrations) == 28 and not rejections
    ways = [d.metadata["way"] for d in demonstrations]
    assert ways.count("left") == ways.count("right") == 14
    for d, way in zip(demonstrations, ways, strict=True):
        assert d.task is None
        q = d.controlled[0].values
        assert way_of(fingertip(q)) == way
        assert np.abs(np.diff(q, axis=0)).max() < 0.05  # no branch is changed
        assert way in d.metadata["reachable"].split()
        assert float(d.metadata["clearance_m"]) > 0.01


def test_one_gaussian_hits_the_pole_and_the_chosen_mixture_does_not_as_is_reported():
    outcome = pole.run(Settings(quick=True))
    numbers = outcome.numbers
    single, mixture, _, end = numbers["executed"]
    assert numbers["chosen"] > 1
    assert single["hits"] > 0
    assert mixture["hits"] == end["hits"] == 0
    assert numbers["purity"] == 1.0
    assert all(finding.holds is not False for finding in outcome.findings)
    page = render(ReportPage(outcome.title, outcome.source, (Section("x", outcome.blocks),)))
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert np.shape(numbers["tip_rms_m"]) == (len(numbers["components"]), 28)
