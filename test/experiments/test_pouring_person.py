# SPDX-License-Identifier: Apache-2.0
"""How a person pours, without physics."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from experiments.pouring.person import SAMPLE_S, draw_habit, plan_pour
from intent_recognition.warping import References, to_warped

CUP = References(0.043, 4.5e-4, 0.095, 0.8)
BOWL = References(0.069, 5.8e-4, 0.066, 0.34)


@given(st.integers(0, 1000))
def test_from_rest_to_rest_and_over_the_opening_while_pouring(seed):
    habit = draw_habit(np.random.default_rng(seed))
    path = plan_pour(habit, CUP, BOWL)
    warped = to_warped(path.offset_m, path.tilt_rad, CUP, BOWL)
    np.testing.assert_allclose(warped[0], habit.start, atol=1e-9)
    assert path.tilt_rad.max() == np.clip(path.tilt_rad.max(), 1.9, 2.8)
    pouring = warped[:, 3] > 1.2
    assert np.all(np.hypot(warped[pouring, 0], warped[pouring, 1])[:-1] < 3.0)
    first = np.argmax(pouring)
    assert np.hypot(*warped[first, :2]) < 1.0
    step = np.abs(np.diff(path.offset_m, axis=0)).max(axis=1) / SAMPLE_S
    assert step[0] < 0.02
    assert step[-1] < 0.02
    assert abs(path.times_s[-1] - habit.duration_s) < 1e-9
