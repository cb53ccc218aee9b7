# SPDX-License-Identifier: Apache-2.0
"""The feedback experiment on a subset."""

import json

import numpy as np
import pytest

from experiments.feedback.experiment import run
from experiments.settings import Settings


@pytest.mark.slow
def test_the_arm_varies_as_the_primitive_and_is_softer_where_demonstrations_vary():
    outcome = run(Settings(quick=True))
    assert all(isinstance(f.holds, bool | None) for f in outcome.findings)
    numbers = json.loads(json.dumps(dict(outcome.numbers)))
    chance = 1.0 / np.sqrt(2.0 * (numbers["n_runs"] - 1))
    ratio = np.array(numbers["std_ratio_stochastic"])
    assert np.abs(ratio - 1.0).max() < 4.0 * chance
    assert np.mean(numbers["std_ratio_low_gain"]) < 0.5 * ratio.mean()
    assert max(numbers["mean_deviation_in_std_stochastic"]) < 5.0 / np.sqrt(numbers["n_runs"])
    assert numbers["linear_std_error"] < 5e-3
    assert numbers["saturated_steps"] == [0, 0]
    assert numbers["stiffness_std_rank_correlation"] < -0.5
    assert numbers["push_hand_std_m"][-1] > numbers["push_hand_std_m"][0]
    first, last = (pushed[0] for pushed in (numbers["push_deflection_m"][k] for k in (0, -1)))
    assert last > 2.0 * first
    assert np.median(numbers["stiffness_end_after_human_ratio"]) > 1.0
