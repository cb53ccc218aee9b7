# SPDX-License-Identifier: Apache-2.0
"""What may have begun at a stop is followed for as long as a movement takes."""

import numpy as np

from intent_recognition.recognition import IntentEstimator

STEP_S = 0.02


def test_a_hand_that_never_rests_again_is_not_followed_for_ever(library):
    estimator, angle, n_used = IntentEstimator(library), 0.0, []
    for t in np.arange(0.0, 40.0, STEP_S):
        if t > 0.5 and not 8.0 <= t < 8.2:  # a circle, and one stop
            angle += STEP_S * 0.8 * np.pi
        estimator.observe(100.0 + t, 0.4 * np.array([np.cos(angle), np.sin(angle), 0.0]))
        n_used.append([each.n_used for each in estimator._movements._after_stop])
    assert n_used[-1] == n_used[len(n_used) // 2] and min(n_used[-1]) > 50
