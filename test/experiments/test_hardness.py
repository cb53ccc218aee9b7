# SPDX-License-Identifier: Apache-2.0
"""The shipped demonstrations are hard: where the wrist is does not say what it is up to."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.teaching.hardness import nearest_mean_labels
from intent_recognition.demonstrations import read_demonstrations
from intent_recognition.demonstrations.dofs import load_dofs
from intent_recognition.filtering import MovementFilter, fixed_prior_grid, task_posterior
from intent_recognition.learning import TrainingSettings, learn
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration, merge


class Accuracy(NamedTuple):
    """Share of recordings recognised, the phase known.

    Attributes:
        shortcut: by the nearest task mean of the wrist's position.
        library: by the interaction primitives.
    """

    shortcut: float
    library: float


def human_movement(demonstration: Demonstration) -> Demonstration:
    """The recording from the onset to the end of the coworker's reach, as its metadata say."""
    return replace(
        demonstration,
        start_ns=int(demonstration.metadata["human_onset_ns"]),
        end_ns=int(demonstration.metadata["human_end_ns"]),
    )


def compare(
    train: Sequence[Demonstration], test: Sequence[Demonstration], share: float = 0.3
) -> Accuracy:
    """Both classifiers after a share of the movement's time, trained on the same recordings."""
    train = [human_movement(d) for d in train]
    test = [human_movement(d) for d in test]
    library = learn(train, TrainingSettings(segmentation="recording", switching=False))
    truth = np.array([library.labels.index(d.task) for d in test])
    by_position = nearest_mean_labels(
        np.array([_position(d, share) for d in train]),
        np.array([library.labels.index(d.task) for d in train]),
        np.array([_position(d, share) for d in test]),
    )
    by_library = [_recognise(library, d, share) for d in test]
    return Accuracy(float(np.mean(by_position == truth)), float(np.mean(by_library == truth)))


def compare_folds(demonstrations: Sequence[Demonstration], folds: int, share: float) -> Accuracy:
    """The same, cross-validated: every `folds`-th recording is left out in turn."""
    right = np.zeros(2)
    for k in range(folds):
        rest = [d for index, d in enumerate(demonstrations) if index % folds != k]
        left_out = demonstrations[k::folds]
        right += np.array(compare(rest, left_out, share)) * len(left_out)
    return Accuracy(*(right / len(demonstrations)).tolist())


def _position(demonstration: Demonstration, share: float) -> NDArray[np.float64]:
    """Wrist position (3,) after a share of the movement."""
    signal = demonstration.observed[0]
    at = share * (demonstration.end_ns - demonstration.start_ns) * 1e-9
    times = signal.seconds(demonstration.start_ns)
    return np.array([np.interp(at, times, column) for column in signal.values.T])


def _recognise(library: TaskLibrary, demonstration: Demonstration, share: float) -> int:
    duration = (demonstration.end_ns - demonstration.start_ns) * 1e-9
    until = demonstration.start_ns + round(share * duration * 1e9)
    seen = [s.between(demonstration.start_ns, until) for s in demonstration.observed]
    hypotheses = fixed_prior_grid(library, duration)
    run = MovementFilter(library, hypotheses, demonstration.start_ns)
    for observation in merge(seen):
        run.observe(observation)
    posterior = task_posterior(run.log_evidence, hypotheses, share * duration)
    return int(np.argmax(posterior.probabilities[:-1]))


@pytest.fixture(scope="module")
def bags(repository):
    return {
        name: read_demonstrations(repository / "bags/toolbox" / name, load_dofs())[0]
        for name in ("train", "test")
    }


@pytest.mark.slow
@pytest.mark.usefixtures("few_basis_functions")
def test_a_shortcut_on_the_position_fails_where_the_library_does_not(bags):
    for accuracy in (compare(bags["train"], bags["test"]), compare_folds(bags["train"], 2, 0.3)):
        assert accuracy.shortcut <= 0.85
        assert accuracy.library >= accuracy.shortcut + 0.10
        assert accuracy.library >= 0.95
