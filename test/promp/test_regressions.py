# SPDX-License-Identifier: Apache-2.0
"""Regressions are computed when asked for, and few are kept."""

import numpy as np
import pytest
from simulation import make_library

from intent_recognition.gaussian.normal import regression
from intent_recognition.promp.library import N_KEPT


def test_every_task_s_regression_is_there_and_few_stay_in_memory(rng):
    library = make_library(rng, n_tasks=3 * N_KEPT, n_basis=4)
    regressions = library.regressions
    assert len(regressions) == library.n_tasks
    for task, found in enumerate(regressions):
        expected = regression(library.primitive(task).weights, library.n_observed_weights)
        for a, b in zip(found, expected, strict=True):
            assert np.array_equal(a, b)
        assert regressions[task] is found
        regressions[0]  # one that is asked for again and again stays
    assert len(regressions._kept) == N_KEPT
    assert 0 in regressions._kept
    assert regressions[-1] is regressions[library.n_tasks - 1]
    with pytest.raises(IndexError):
        regressions[library.n_tasks]
