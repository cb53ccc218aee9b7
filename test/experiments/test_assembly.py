# SPDX-License-Identifier: Apache-2.0
"""The box assembly: folds, certainty, single observations, and the whole of it, quickly."""

import json
from dataclasses import replace
from math import inf

import numpy as np
import pytest

from experiments.assembly import experiment as assembly
from experiments.assembly.aligned import aligned_evidence, spread_rows
from experiments.assembly.scores import (
    at_phase,
    observations_to_certainty,
    phases_of,
    single_evidence,
    spread_observations,
    watch,
)
from experiments.assembly.study import arrival_s, study
from experiments.settings import Settings
from intent_recognition.filtering.grid import fixed_prior_grid
from intent_recognition.gaussian.normal import Gaussian, log_density
from intent_recognition.promp.phase_deviation import STEADY
from sim_bridge.scenarios.assembly.styles import TASKS

pytestmark = pytest.mark.slow  # the whole experiment runs first, in its quick form


@pytest.fixture(scope="module")
def found():
    """A quick study, once."""
    return study(Settings(quick=True))


def test_outcome_is_of_demonstrations_left_out_says_why_and_can_be_written(found, monkeypatch):
    monkeypatch.setattr(assembly, "study", lambda settings: found)
    outcome = assembly.run(Settings(quick=True))
    json.dumps(outcome.numbers)
    assert all(finding.remark or finding.holds for finding in outcome.findings)
    assert len(outcome.blocks) == 7
    assert outcome.numbers["demonstrations"] == len(found.scored)
    assert outcome.numbers["aligned_right_at_end"] == len(found.scored)
    learned = {d.name for d in found.first.training}
    assert learned.isdisjoint(d.name for d in found.first.left_out)
    assert set(found.first.library.provenance.get("bags", ())).isdisjoint(
        d.name for d in found.first.left_out
    )


def test_first_observation_by_itself_is_the_first_of_all(found):
    library, recorded = found.first.library, found.first.left_out[0]
    library = replace(
        library, phase_deviation=STEADY, evidence_freedom=inf, task_evidence=1.0
    )  # as in Eq. 10
    observations = spread_observations(recorded)
    duration_s = (recorded.end_ns - recorded.start_ns) * 1e-9
    _, evidence = watch(library, fixed_prior_grid(library, duration_s), recorded, observations[:1])
    single = single_evidence(library, recorded, observations[:1])[0]
    np.testing.assert_allclose(evidence[1] - evidence[0], single, atol=1e-8)
    (phase,) = phases_of(recorded, observations[:1])
    assert single[0] == pytest.approx(
        log_density(at_phase(library, 0, phase), observations[0].values)
    )


def test_aligned_evidence_is_the_density_of_all_observations_together(found):
    fold, recorded = found.first, found.first.left_out[1]
    (warp,) = fold.timing.warps([recorded])
    steps = aligned_evidence(fold.aligned, warp, recorded, 6)
    assert np.all(steps[0] == 0.0)
    (signal,) = recorded.observed
    share = (signal.stamps_ns - recorded.start_ns) / (recorded.end_ns - recorded.start_ns)
    phases = warp.inverse(share)
    rows = spread_rows(phases, 6)
    design = np.vstack(
        [np.kron(np.eye(3), row) for row in fold.aligned.basis.design_matrix(phases[rows])[:, None]]
    )
    size = fold.aligned.n_observed_weights
    for task in range(fold.library.n_tasks):
        prior = fold.aligned.weight_covariance[task, :size, :size]
        noise = np.tile(fold.aligned.noise_variance[:3] * fold.aligned.noise_scale, 6)
        joint = Gaussian(
            design @ fold.aligned.weight_mean[task, :size],
            design @ prior @ design.T + np.diag(noise),
        )
        assert steps[-1, task] == pytest.approx(log_density(joint, signal.values[rows].ravel()))


def test_spread_rows_certainty_and_arrivals():
    phases = np.r_[np.linspace(0.0, 0.3, 31), np.linspace(0.7, 1.0, 31)]
    rows = spread_rows(phases, 15)
    assert np.all(np.diff(rows) > 0)
    even = np.linspace(0.0, 1.0, 301)
    np.testing.assert_allclose(even[spread_rows(even, 15)], (np.arange(15) + 0.5) / 15, atol=0.01)
    sure, doubt = [0.995, 0.005], [0.6, 0.4]
    assert observations_to_certainty(np.array([doubt, doubt, sure, sure]), 0) == 2
    assert observations_to_certainty(np.array([doubt, sure, doubt, sure]), 0) == 3
    assert observations_to_certainty(np.array([doubt, sure, doubt]), 0) is None
    assert observations_to_certainty(np.array([sure, sure]), 0) == 0
    times = np.arange(200) * 0.01
    path = np.zeros((200, 3))
    path[:, 0] = np.where(times < 0.995, 0.0, 0.5)
    assert arrival_s(times, path) == pytest.approx(1.0)
    assert arrival_s(times, np.zeros((200, 3))) == 0.0


def test_arm_follows_its_commands_and_takes_part_in_each_task(found):
    assert [e.task for e in found.executed] == list(dict.fromkeys(e.task for e in found.executed))
    assert {e.task for e in found.executed} == set(TASKS)
    for executed in found.executed:
        assert executed.run.tasks[-1:] == (executed.task,)
        assert executed.followed_m < 0.02
        assert executed.run.largest_torque < 1.0
        assert executed.end_m < 0.1
