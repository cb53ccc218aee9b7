# SPDX-License-Identifier: Apache-2.0
"""Containers with balls: geometry, and what must hold of any pour."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.constraints.catching import catch, tilt
from sim_bridge.balls import BallWorld, Hollow, WallGuard, ball_radius_m, balls_in, settled
from sim_bridge.balls.collision import HULL_MARGIN_M, WALL_M, wall_pieces, write_obj
from sim_bridge.balls.hollow import offset

RADIUS_M = 0.008


def cup(radius_m=0.035, height_m=0.08, corners=24, flare=1.0):
    angles = 2.0 * np.pi * np.arange(corners) / corners
    ring = radius_m * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return Hollow(np.stack([ring, flare * ring]), np.array([0.0, height_m]))


@pytest.fixture
def world():
    with BallWorld(cup(), RADIUS_M) as made:
        yield made


@given(st.floats(0.5, 3.0))
def test_volume_of_a_frustum(flare):
    prism = cup().volume_m3
    expected = prism * (1.0 + flare + flare**2) / 3.0
    assert cup(flare=flare).volume_m3 == pytest.approx(expected)


def test_clearance_is_the_distance_from_the_wall_and_a_guard_watches_it():
    inradius = 0.035 * np.cos(np.pi / 24)
    points = np.array([[0.0, 0.0, 0.04], [0.02, 0.0, 0.04], [0.05, 0.0, 0.04]])
    found = cup().clearance_m(points)
    assert found[0] == pytest.approx(inradius)
    assert found[1] < found[0]
    assert found[2] < 0.0
    assert cup().holds(points).tolist() == [True, True, False]
    inside, beside = np.array([[0.0, 0.0, 0.02]]), np.array([[0.06, 0.0, 0.02]])
    above = np.array([[0.02, 0.0, 0.09]])
    through = WallGuard(cup(), RADIUS_M, inside)
    through.look(beside)
    assert through.count == 1
    over = WallGuard(cup(), RADIUS_M, inside)
    over.look(above)
    over.look(beside)
    assert over.count == 0
    floor = WallGuard(cup(), RADIUS_M, inside)
    floor.look(np.array([[0.0, 0.0, -0.02]]))
    assert floor.count == 1


@given(st.floats(0.0, 0.05))
def test_offset_moves_every_edge(by):
    rings = cup().rings_m
    grown = Hollow(offset(rings, by), cup().heights_m)
    middle = np.array([[0.0, 0.0, 0.01]])
    assert grown.clearance_m(middle) == pytest.approx(cup().clearance_m(middle) + by)


def test_wall_is_beyond_the_hollow(tmp_path):
    hollow = cup()
    pieces = wall_pieces(hollow)
    assert len(pieces) == 24 + 1
    for piece in pieces[:-1]:
        inside = hollow.clearance_m(piece)
        assert np.all(inside <= -0.99 * HULL_MARGIN_M)
        assert np.all(inside >= -1.2 * (HULL_MARGIN_M + WALL_M))
    write_obj(pieces, tmp_path / "walls.obj")
    lines = (tmp_path / "walls.obj").read_text().splitlines()
    assert sum(line.startswith("o ") for line in lines) == len(pieces)
    assert sum(line.startswith("v ") for line in lines) == 8 * 24 + 2 * 24


def test_a_full_container_holds_what_its_volume_says():
    radius = ball_radius_m(cup().volume_m3, 60)
    assert balls_in(cup().volume_m3, radius) == pytest.approx(60)
    with BallWorld(cup(), radius) as world:
        stayed = settled(world, 60, np.random.default_rng(1))
    assert 48 <= len(stayed) <= 60
    assert np.all(np.diff(stayed[:, 2]) >= 0.0)
    # Nothing hangs in the wall, the floor or another ball by more than Bullet's margin.
    assert cup().clearance_m(stayed).min() > radius - 0.0015
    assert stayed[:, 2].min() > radius - 0.0015
    gaps = np.linalg.norm(stayed[:, None] - stayed[None], axis=-1)[np.triu_indices(len(stayed), 1)]
    assert gaps.min() > 1.7 * radius  # with ten solver iterations they give way like gel


def test_upright_keeps_all_and_upside_down_none(world):
    balls = settled(world, 12, np.random.default_rng(2))
    kept = tilt(world, balls, 0.0)
    assert not kept.left.any()
    assert np.isnan(kept.exit_time_s).all()
    gone = tilt(world, balls, np.deg2rad(160.0), hold_s=1.0)
    assert gone.left.all()
    assert kept.through_wall == gone.through_wall == 0
    assert np.all(gone.exit_position_m[:, 2] < -RADIUS_M)
    assert np.all(gone.exit_velocity_m_s[:, 2] < 0.0)


def test_catching_depends_on_the_place(world):
    balls = settled(world, 8, np.random.default_rng(4))
    poured = tilt(world, balls, np.deg2rad(120.0), hold_s=0.8)
    assert poured.left.all()
    with BallWorld(cup(0.07, 0.06), RADIUS_M) as second:
        nothing = np.zeros((0, 3))
        over = catch(second, nothing, poured, np.array([-0.02, 0.0, 0.08]))
        beside = catch(second, nothing, poured, np.array([0.2, 0.0, 0.08]))
    assert over.success
    assert not beside.success
    assert over.through_wall == 0
