# SPDX-License-Identifier: Apache-2.0
"""A simulated hand leads the arm in physics: it yields, stays there, and the task moves."""

import json

import numpy as np
import pytest

from experiments.execution import as_demonstration, execute
from experiments.reaches import toolbox_recordings, watch_reach
from experiments.settings import Settings
from experiments.skills import correcting_report, practising, practising_report
from experiments.skills.correcting import (
    CorrectingSession,
    CorrectingStudy,
    Corrects,
    correction_of,
)
from intent_recognition.kinematics import LWR_LIMITS, hand_position
from intent_recognition.learning import keep_correction, learn_with_report
from intent_recognition.motion import scaled_limits
from intent_recognition.nodes.activation_inputs import load_detector
from intent_recognition.report import TableBlock
from sim_bridge.coworker import PLATE
from sim_bridge.scenarios.toolbox import handover_point

LIMITS, MOVED_M = scaled_limits(LWR_LIMITS), np.array([0.0, 0.08, 0.0])


@pytest.fixture(scope="module")
def learned():
    """Learned from a fourth of the shipped demonstrations, once."""
    return learn_with_report(toolbox_recordings(Settings(quick=True)))


@pytest.mark.slow
def test_the_arm_stays_where_a_hand_led_it_and_the_task_moves_there(learned):
    trained, library = learned.trained, learned.trained.library
    watched = watch_reach(library, 0, np.random.default_rng([1, 91, 0]), LIMITS)
    place = handover_point(PLATE, watched.goal_m) + MOVED_M
    correction = correction_of(load_detector("lwr"), library)
    done = execute(watched, library, LIMITS, correction, np.random.default_rng(0), Corrects(place))
    assert done.counts["yielded"] == done.counts["corrected"] == 1
    assert np.linalg.norm(done.hand_m[-1] - place) < 0.01
    assert max(done.largest_jump) < 1e-9
    kept = as_demonstration(watched, done.corrected, library, "kept")
    moved = keep_correction(trained, kept).library
    k = library.labels.index(PLATE)
    before, after = _end(library, k), _end(moved, k)
    along = (after - before) @ MOVED_M / (MOVED_M @ MOVED_M)
    assert 0.7 < along < 1.3
    others = np.arange(library.n_tasks) != k
    assert np.array_equal(moved.weight_mean[others], library.weight_mean[others])
    assert np.array_equal(moved.observed_mean, library.observed_mean)


@pytest.mark.slow
def test_a_practised_task_is_compared_beside_others_and_in_physics(learned, monkeypatch):
    monkeypatch.setattr(practising, "learn_with_report", lambda recordings: learned)
    part = practising_report.run(Settings(quick=True))
    numbers = json.loads(json.dumps(dict(part.numbers)))
    by_time = [one for one in numbers["practised"] if one["cost"] == "time"]
    cma, rand = (one for one in by_time)
    assert cma["costs"][0] == rand["costs"][0] and cma["start"] == rand["start"] > 0.0
    assert cma["settled"] < cma["start"]
    (waited,) = numbers["in_physics"]
    assert [len(late) for late in waited["late_s"]] == [1, 1]
    assert len(part.findings) == 3 and len(part.blocks) == 2


def session(task, errors_m, others_changed=0.0):
    """One move of a task's rule: two executions after each of 0 to 3 corrections."""
    errors = np.repeat(np.array(errors_m)[:, None], 2, axis=1)
    led, without = np.full(6, 0.01), np.full(6, 0.06)
    return CorrectingSession(task, errors, led, without, others_changed, 0.0, 0.0, (9.0, 30.0))


def corrected(*sessions, n_lasting=0):
    return CorrectingStudy(load_detector("lwr"), 12, 1, 8, 3, n_lasting, sessions)


def test_the_report_of_corrections_says_how_far_the_error_falls(monkeypatch):
    study = corrected(session("plate", (0.08, 0.04, 0.02, 0.01)), session("screw", (0.08, 0, 0, 0)))
    monkeypatch.setattr(correcting_report, "investigate", lambda settings: study)
    part = correcting_report.run(Settings())
    falls = json.loads(json.dumps(dict(part.numbers)))["fall"]
    assert falls == {"plate": pytest.approx(1 - 0.01 / 0.08), "screw": 1.0}
    assert part.findings[0].ours == "93.8 (87.5 to 100.0)"
    assert all(finding.holds in (True, None) for finding in part.findings)
    (table,) = (block for block in part.blocks if isinstance(block, TableBlock))
    assert [row[0] for row in table.rows] == ["plate", "screw"]


def _end(library, task):
    """Where the hand of a task's mean ends (3,)."""
    means = library.weight_mean[task].reshape(-1, library.basis.n_basis)[library.n_observed :]
    return hand_position(means @ library.basis.design_matrix(np.ones(1))[0])
