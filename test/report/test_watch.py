# SPDX-License-Identifier: Apache-2.0
"""The watch over a movement decides as the nodes do."""

from types import SimpleNamespace

import numpy as np
import pytest

from intent_recognition.promp.bank import Hypotheses
from intent_recognition.report.evaluation_novel import Watch


@pytest.mark.parametrize(("none_evidence", "activated"), [(-3.0, "a"), (2.0, "")])
def test_a_movement_that_speaks_for_none_activates_nothing_however_probable(
    none_evidence, activated
):
    log_prior = np.log([0.9989, 0.0001, 0.001])
    run = SimpleNamespace(
        hypotheses=Hypotheses(1, np.ones(3), log_prior),
        log_evidence=np.array([1.0, -5.0, none_evidence]),
        forecasts=SimpleNamespace(end_std=lambda task: 0.01),
    )
    watch = Watch(SimpleNamespace(labels=("a", "b")))
    for k in range(10):
        watch.observe(run, 0.1 * k)
    assert watch.outcome("a").above_threshold
    assert watch.outcome("a").activated == activated
