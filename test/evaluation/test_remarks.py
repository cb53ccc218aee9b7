# SPDX-License-Identifier: Apache-2.0
"""What an evaluation says beside its numbers: chance, and which recording is meant."""

import numpy as np
import pytest

from intent_recognition import Demonstration, evaluate
from intent_recognition.evaluation import remarks_on
from intent_recognition.learning import TrainingSettings, accumulate
from intent_recognition.signals import numbered


def test_chance_is_named():
    (remark,) = [line for line in remarks_on({"tasks": ["a", "b", "c", "d"]}) if "Chance" in line]
    assert "accuracy of 0.25 and a log loss of 1.39" in remark and "Early figures" in remark


@pytest.fixture
def unnamed():
    rng, times_s = np.random.default_rng(0), np.arange(0.0, 2.0, 0.02)
    found = []
    for k in range(10):
        way = np.clip(times_s - 0.4, 0.0, 1.0)[:, None] ** 2 * (0.4 + 0.3 * (k % 2))
        human = way + 0.001 * rng.normal(size=(100, 1))
        found.append(Demonstration.from_arrays(times_s, human, 1.0 - way, task=f"t{k % 2}"))
    return found


def test_demonstrations_without_a_name_are_numbered(unnamed):
    settings = TrainingSettings(n_basis=8)
    assert accumulate(unnamed, settings).used == tuple(f"demonstration_{k}" for k in range(10))
    named = Demonstration.from_arrays([0, 1, 2, 3], np.eye(4), np.eye(4), name="mine")
    assert [d.name for d in numbered([unnamed[0], named])] == ["demonstration_0", "mine"]
    wrong = [
        *unnamed,
        Demonstration.from_arrays(
            np.arange(0.0, 2.0, 0.02),
            human=unnamed[0].observed[0].values,
            robot=np.zeros((100, 2)),
            task="t0",
        ),
    ]
    left_out = evaluate(wrong, "kfold:3", settings)["left_out"]
    assert [one["recording"] for one in left_out] == ["demonstration_10"]
