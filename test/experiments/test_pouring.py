# SPDX-License-Identifier: Apache-2.0
"""The pouring experiment on the shipped recordings, one pour repeated in physics."""

import numpy as np
import pytest

from experiments.pouring.experiment import PAIRS, run
from experiments.pouring.study import read_recorded
from experiments.settings import Settings
from intent_recognition.errors import BagError


@pytest.mark.slow
def test_warped_pours_spill_little_and_others_more_and_levels_are_met():
    numbers = run(Settings(quick=True)).numbers
    mean, unwarped = (np.array(numbers[f"spilled_{m}"]) for m in ("mean", "unwarped"))
    assert len(mean) == len(unwarped) == len(PAIRS)
    assert mean.mean() <= 2.0
    assert unwarped.sum() > mean.sum() + 10
    assert numbers["through_wall"] == 0
    assert numbers["carried_tilt_ratio"] < 1.0
    levels = numbers["levels"]
    emptied = [one for one in levels if one["pour"] == "empty"]
    assert len(emptied) == len(PAIRS)
    assert np.mean([one["spilled"] for one in emptied]) <= 0.2
    assert len(levels) > len(emptied)
    assert max(one["error"] for one in levels) <= 0.10


def test_no_recordings(tmp_path):
    with pytest.raises(BagError, match="recorded pours"):
        read_recorded(tmp_path)
