# SPDX-License-Identifier: Apache-2.0
"""What reaches afresh take from tasks: how long a course moves, and how far its end tells it."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import make_library, minimum_jerk, nearly_known

from intent_recognition.filtering.rates import end_tells, moving_parts
from intent_recognition.promp import STEADY


@pytest.fixture
def library(rng):
    return make_library(rng, n_basis=6, correlation_time_s=0.05)


@pytest.mark.parametrize("part", [1.0, 0.75, 0.5])
@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_a_course_moves_until_it_holds_its_end(part, scale):
    done = minimum_jerk(np.clip(np.linspace(0.0, 1.0, 500) / part, 0.0, 1.0))
    shape = done[:, None] * np.array([0.3, -0.1 * scale, 0.5])
    library = nearly_known(shape, 0.001, STEADY)
    assert moving_parts(library, np.array([1.0, scale])) == pytest.approx([part], abs=0.02)


def test_an_end_that_tasks_share_tells_nothing_and_one_far_off_everything(library):
    n_basis, mean = library.basis.n_basis, library.weight_mean.copy()
    far = np.zeros_like(mean)
    far[2] = 10.0
    mean[1], covariance = mean[0], library.weight_covariance[[0, 0, 2]]
    alike = replace(library, weight_mean=mean + far, weight_covariance=covariance)
    np.testing.assert_allclose(end_tells(alike), [0.0, 0.0, 1.0], atol=1e-9)
    # of two normals of equal covariance: exp(-d^2 / 8), d the Mahalanobis distance of the ends
    row = np.kron(np.eye(3), library.basis.design_matrix(np.ones(1))[0])
    spread = row @ library.observed_covariance[0] @ row.T
    shift = 2.0 * np.linalg.cholesky(spread)[:, 0]
    mean[1, : 3 * n_basis] += np.repeat(shift, n_basis)
    apart = replace(library, weight_mean=mean + far, weight_covariance=covariance)
    np.testing.assert_allclose(end_tells(apart)[:2], 1.0 - np.exp(-0.5), rtol=1e-6)
