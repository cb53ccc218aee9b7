# SPDX-License-Identifier: Apache-2.0
"""Learning as a user calls it: a library in one line, and one-line errors."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import make_library, simulate

from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.learning import TrainingSettings, learn, learn_components, learn_mixture
from intent_recognition.learning.unlabelled import label_by_components
from intent_recognition.signals import Demonstration

SETTINGS = TrainingSettings(n_basis=6, n_aligned_basis=6)


@pytest.fixture(scope="module")
def demonstrations() -> list[Demonstration]:
    """Four of each of two tasks."""
    rng = np.random.default_rng(3)
    truth = make_library(rng, n_tasks=2, n_basis=6)
    return [
        simulate(truth, task, rng, name=f"demo_{task}_{k}") for task in range(2) for k in range(4)
    ]


@pytest.mark.slow
def test_learn_mixture_ignores_labels(demonstrations):
    unlabelled = [replace(one, task=None) for one in demonstrations]
    library = learn_mixture(unlabelled, 2, SETTINGS)
    found = label_by_components(demonstrations, SETTINGS, np.random.default_rng(0), n_components=2)
    assert library.labels == ("component_1", "component_2")
    assert np.array_equal(
        library.weight_mean, learn_components(found, SETTINGS).library.weight_mean
    )


@pytest.mark.parametrize(
    ("wrong", "error", "text"),
    [
        (lambda all_: all_[:1], TrainingError, "at least two demonstrations"),
        (lambda all_: [], TrainingError, "at least two usable"),
        (lambda all_: [replace(one, task=None) for one in all_], TrainingError, "no label"),
        (lambda all_: all_[0], ArgumentError, "a list of Demonstration, .* Put it into a list"),
        (lambda all_: [all_[0], np.zeros((5, 3))], ArgumentError, r"demonstrations\[1\].*ndarray"),
    ],
)
def test_unusable_demonstrations_are_one_line_errors(demonstrations, wrong, error, text):
    with pytest.raises(error, match=text) as raised:
        learn(wrong(demonstrations), SETTINGS)
    assert "\n" not in str(raised.value)
