# SPDX-License-Identifier: Apache-2.0
"""Physical transfers: a small version of `python -m benchmarks.transfer`."""

import numpy as np
import pytest

from benchmarks.transfer import plan, results
from benchmarks.transfer_trials import DISTURBANCES, TransferOutcome, TransferTrial, run_trial
from intent_recognition.transfer import Holding
from sim_bridge.physics import end_world, start_world

LARGEST_N, RELEASE_S, NOTICED_S = 15.0, 0.3, 0.05


def test_fewer_trials_are_the_first_of_many():
    few, many = plan(30), plan(200)
    assert all(few[name] == many[name][: len(few[name])] for name in many)
    assert {trial.thing for trial in few["transfers"]} == {"box", "plate", "bottle"}
    assert {trial.kind for trial in few["disturbances"]} == set(DISTURBANCES)


@pytest.mark.parametrize("bad", ["", "transfers", "disturbances", "wet"])
def test_one_bad_trial_falls_short(bad):
    good = TransferOutcome(True, False, 9.0, 0.1, 0.03, Holding.EMPTY, [])
    outcomes = {name: [good] * len(chosen) for name, chosen in plan(30).items()}
    if bad:
        outcomes[bad][3] = good._replace(success=False, peak_n=16.0, release_s=0.4, slip_s=np.inf)
    short = {one.name.split()[0] for one in results(outcomes) if one.verdict != "ok"}
    named = {"transfers": {"transfers:", "robot"}, "disturbances": {"bumps,"}, "wet": {"wet"}}
    assert short - {"released"} == named.get(bad, set())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "thing", "robot"),
    [("give", "bottle", "panda"), ("take", "rod", "lwr")],
)
def test_objects_change_hands(kind, thing, robot):
    outcome = run_trial(TransferTrial(kind, thing, robot, 7))
    assert outcome.success
    assert not outcome.dropped
    assert outcome.peak_n < LARGEST_N
    assert outcome.release_s < RELEASE_S or kind == "take"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "thing"), list(zip(DISTURBANCES, ["box", "bottle"] * 3, strict=True))
)
def test_bumps_and_false_pulls_get_nothing_and_the_object_is_brought_back(kind, thing):
    outcome = run_trial(TransferTrial(kind, thing, "lwr", 8))
    assert outcome.success
    assert outcome.end is Holding.EMPTY  # put down on its stand
    opened = [s for s in outcome.samples if s.output.holding is Holding.RELEASING]
    assert opened[0].time_s > 4.0


@pytest.mark.slow
def test_a_wet_bottle_is_gripped_before_it_is_lost_and_again_after_another_world():
    """PyBullet has one threshold of contacts for all worlds of a process."""
    trial = TransferTrial("slippery", "bottle", "lwr", 103)
    outcome = run_trial(trial)
    assert outcome.success
    assert outcome.slip_s <= NOTICED_S
    other = start_world()
    other.setPhysicsEngineParameter(contactBreakingThreshold=0.001)
    end_world(other)
    second = run_trial(trial)
    assert [s.time_s for s in second.samples] == [s.time_s for s in outcome.samples]
    np.testing.assert_array_equal(second.samples[-1].object_m, outcome.samples[-1].object_m)


def test_by_the_clock_an_object_is_dropped():
    """With the load signal off, as the toolbox's gripper opens a quarter of a second after rest."""
    outcome = run_trial(TransferTrial("give", "bottle", "lwr", 1, clock_s=0.25))
    assert outcome.dropped
