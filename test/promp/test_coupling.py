# SPDX-License-Identifier: Apache-2.0
"""The residuals' process against the conditional distribution of all of them together."""

import numpy as np
import pytest

from intent_recognition.promp.coupling import residual_weights


@pytest.mark.parametrize("n", [1, 2, 7])
def test_the_expected_residual_is_the_conditional_mean_of_the_process(rng, n):
    seen = np.sort(rng.uniform(0.0, 2.0, size=n))
    times = np.r_[-0.3, rng.uniform(0.0, 2.0, size=9), seen, 2.4, 90.0]
    covariance = np.exp(-np.abs(seen[:, None] - seen) / 0.3)
    cross = np.exp(-np.abs(times[:, None] - seen) / 0.3)
    expected = np.linalg.solve(covariance, cross.T).T
    weights, known = residual_weights(seen, times, 0.3)
    np.testing.assert_allclose(weights, expected, atol=1e-9)
    np.testing.assert_allclose(known, np.sum(expected * cross, axis=1), atol=1e-9)
