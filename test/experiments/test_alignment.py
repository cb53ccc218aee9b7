# SPDX-License-Identifier: Apache-2.0
"""The experiment on alignment: its measures on maps made by hand, and that it runs."""

import numpy as np
import pytest

from experiments.alignment import experiment as alignment
from experiments.alignment.study import DTW, LOCAL, TRUE
from experiments.alignment.time_warping import (
    dtw_maps,
    left_out,
    smooth_maps,
    speed_ratio,
    steps,
    variance_removed,
    warped,
)
from experiments.alignment.timed import demonstrations
from experiments.settings import Settings

PHASE = np.linspace(0.0, 1.0, 101)
IDENTITY = np.tile(PHASE, (3, 1))


def test_measures_of_the_identity_and_of_maps_made_by_hand(rng):
    found = steps(IDENTITY)
    np.testing.assert_allclose(found, (1.0, 0.0, 0.0, 0.0), atol=1e-9)
    stairs = PHASE.copy()
    stairs[40:50] = stairs[40]
    found = steps(stairs[None])
    np.testing.assert_allclose(found.largest, 10.0)
    np.testing.assert_allclose(found.flat, 9 / 100)
    np.testing.assert_allclose(found.longest_flat, 9 / 100)
    assert left_out(IDENTITY) == 0.0
    np.testing.assert_allclose(left_out(0.1 + 0.6 * IDENTITY), 0.4)
    assert left_out(-0.1 + 1.2 * IDENTITY) == 0.0
    values = rng.normal(size=(3, 101, 2))
    np.testing.assert_allclose(warped(values, IDENTITY), values, atol=1e-9)
    np.testing.assert_allclose(variance_removed(values, IDENTITY), 0.0, atol=1e-9)
    np.testing.assert_allclose(speed_ratio(values, IDENTITY), 1.0)


@pytest.mark.parametrize("method", [smooth_maps, dtw_maps])
def test_methods_map_a_trajectory_onto_itself(method):
    pytest.importorskip("dtaidistance")
    values = demonstrations(np.random.default_rng(3), n=1, n_samples=101).trajectories
    maps = method(np.concatenate([values, values]), 0)
    np.testing.assert_allclose(maps, IDENTITY[:2], atol=5e-3)


def test_free_ends_go_on_one_by_one():
    pytest.importorskip("dtaidistance")
    time = 6.0 * np.linspace(0.0, 1.2, 121)
    curve = np.stack([np.sin(time), np.cos(time)], axis=1)
    both = np.stack([curve[:101], curve[20:]])
    found = dtw_maps(both, 0, free_ends=25)[1]
    np.testing.assert_allclose(np.diff(found)[:15], 0.01, atol=1e-9)
    np.testing.assert_allclose(found[30:80], PHASE[30:80] - 0.2, atol=0.011)


def test_local_optimisation_neither_stands_nor_jumps():
    pytest.importorskip("dtaidistance")
    outcome = alignment.run(Settings(quick=True))
    known = outcome.numbers["known_timing"]
    assert known[LOCAL]["flat"] == 0.0
    assert known[LOCAL]["largest"] < known[DTW]["largest"]
    assert known[LOCAL]["velocity"] < 0.6 * known[DTW]["velocity"]
    assert known[TRUE]["median"] == 0.0
    assert all(finding.holds is not False for finding in outcome.findings)
