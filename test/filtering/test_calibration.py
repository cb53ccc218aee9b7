# SPDX-License-Identifier: Apache-2.0
"""Uncertainty tested as uncertainty: what is simulated lies where the model says it does."""

import numpy as np
import pytest
from simulation import START_NS, make_library, simulate

from intent_recognition.filtering.filter import MovementFilter
from intent_recognition.filtering.grid import PriorGrid, fixed_prior_grid, make_prior_grid
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.signals import Demonstration, merge

WHOLE = TrainingSettings(n_basis=8, segmentation="recording", switching=False)
FRACTIONS = (0.25, 0.5, 1.0)


def standardised_errors(
    library: TaskLibrary, recording: Demonstration, fraction: float, known: bool, n_times: int = 12
) -> np.ndarray:
    """(truth - mean) / std of the controlled agent given its task, (n_times, Q)."""
    duration = (recording.end_ns - START_NS) * 1e-9
    hypotheses: PriorGrid = (
        fixed_prior_grid(library, duration) if known else make_prior_grid(library)
    )
    run = MovementFilter(library, hypotheses, START_NS)
    for observation in merge(recording.observed):
        if (observation.stamp_ns - START_NS) * 1e-9 <= fraction * duration:
            run.observe(observation)
    times = np.linspace(0.0, duration, n_times)
    mean, square = run.prediction(library.labels.index(recording.task)).mixture_at(times)
    std = np.sqrt(square - mean**2)
    signal = recording.controlled[0]
    columns = [np.interp(times, signal.seconds(START_NS), c) for c in signal.values.T]
    return (np.stack(columns, axis=1) - mean) / std


def truth_library(seed: int) -> TaskLibrary:
    options = {"n_tasks": 2, "groups": (2,), "n_basis": 8, "spread": 0.08, "noise_std": 0.004}
    return make_library(np.random.default_rng(seed), **options)


@pytest.mark.slow
def test_a_library_learned_from_many_covers_held_out_demonstrations():
    """Learned from 160 demonstrations, on 60 more of the same truth."""
    truth, rng = truth_library(2), np.random.default_rng(102)
    training = [simulate(truth, i % 2, rng, name=f"d{i}", n_samples=50) for i in range(160)]
    library = learn(training, WHOLE)
    held_out = [simulate(truth, i % 2, rng, n_samples=30) for i in range(60)]
    for known in (True, False):
        z = np.array(
            [
                standardised_errors(library, recording, FRACTIONS[i % 3], known)
                for i, recording in enumerate(held_out)
            ]
        )
        assert 0.93 < np.mean(np.abs(z) < 2.0) < 0.97
        assert np.mean(z**2) == pytest.approx(1.0, abs=0.25)
