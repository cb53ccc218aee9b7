# SPDX-License-Identifier: Apache-2.0
"""Physical transfers: a small version of `python -m benchmarks.transfer`."""

import numpy as np
import pytest

from benchmarks.transfer_trials import DISTURBANCES, TransferTrial, run_trial
from intent_recognition.transfer import Holding
from sim_bridge.scenarios.transfer import OBJECTS

LARGEST_N, RELEASE_S, NOTICED_S = 15.0, 0.3, 0.05


def test_a_plate_is_given_by_load_and_each_run_is_the_same():
    outcome = run_trial(TransferTrial("give", "plate", "lwr", 1))
    assert outcome.success
    assert outcome.peak_n < LARGEST_N
    assert outcome.release_s < RELEASE_S
    again = run_trial(TransferTrial("give", "plate", "lwr", 1))
    assert [s.time_s for s in again.samples] == [s.time_s for s in outcome.samples]
    np.testing.assert_array_equal(again.samples[-1].object_m, outcome.samples[-1].object_m)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["lwr", "panda"])
@pytest.mark.parametrize("thing", OBJECTS)
@pytest.mark.parametrize("kind", ["give", "take"])
def test_objects_change_hands(kind, thing, robot):
    outcome = run_trial(TransferTrial(kind, thing, robot, 7))
    assert outcome.success
    assert not outcome.dropped
    assert outcome.peak_n < LARGEST_N
    assert not outcome.release_s >= RELEASE_S  # a taken object has no release of the robot


@pytest.mark.slow
@pytest.mark.parametrize("thing", ["box", "bottle"])
@pytest.mark.parametrize("kind", DISTURBANCES)
def test_bumps_and_false_pulls_get_nothing_and_the_object_is_brought_back(kind, thing):
    outcome = run_trial(TransferTrial(kind, thing, "lwr", 8))
    assert outcome.success
    assert outcome.end is Holding.EMPTY  # put down on its stand
    opened = [s for s in outcome.samples if s.output.holding is Holding.RELEASING]
    assert opened[0].time_s > 4.0


@pytest.mark.slow
def test_a_wet_bottle_is_gripped_before_it_is_lost():
    outcome = run_trial(TransferTrial("slippery", "bottle", "lwr", 103))
    assert outcome.success
    assert outcome.slip_s <= NOTICED_S


@pytest.mark.parametrize("thing", OBJECTS)
def test_by_the_clock_an_object_is_dropped(thing):
    """With the load signal off, as the toolbox's gripper opens a quarter of a second after rest."""
    outcome = run_trial(TransferTrial("give", thing, "lwr", 1, clock_s=0.25))
    assert outcome.dropped
