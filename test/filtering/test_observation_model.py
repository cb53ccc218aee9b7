# SPDX-License-Identifier: Apache-2.0
"""Which observations are used, and with which noise."""

import numpy as np
import pytest
from simulation import START_NS, make_library

from intent_recognition.errors import ArgumentError
from intent_recognition.filtering.observation_model import ObservationModel
from intent_recognition.signals.observation import Observation

CORRELATION_S = 0.1


@pytest.fixture
def library(rng):
    return make_library(rng, groups=(2, 1), n_basis=6, correlation_time_s=CORRELATION_S)


@pytest.fixture
def model(library) -> ObservationModel:
    return ObservationModel(library, START_NS)


def seen(elapsed_s: float, group: int = 0, dofs=None, covariance=None, *, derivative=False):
    size = len(dofs) if dofs is not None else (2, 1)[group]
    stamp_ns = START_NS + round(elapsed_s * 1e9)
    return Observation(stamp_ns, group, np.zeros(size), covariance, dofs, derivative)


def dense_stream() -> list[Observation]:
    """Two signals, at 100 and at 25 per second, and velocities of the first."""
    observations = []
    for k in range(100):
        observations.append(seen(0.01 * k))
        observations.append(seen(0.01 * k, covariance=np.eye(2), derivative=True))
        if k % 4 == 0:
            observations.append(seen(0.01 * k, 1))
    return observations


def test_each_signal_is_used_twice_per_correlation_time_at_intervals_of_any(model):
    used = [o for o in dense_stream() if model.measurement(o) is not None]
    for group, derivative, every_ms in ((0, False, 50), (0, True, 50), (1, False, 80)):
        stamps = [
            round((o.stamp_ns - START_NS) * 1e-6)
            for o in used
            if (o.group, o.derivative) == (group, derivative)
        ]
        assert stamps == list(range(0, 1000, every_ms))


def test_a_stamp_may_jitter_and_what_is_not_used_is_checked_all_the_same(model):
    stamps = [0.05 * k + (-1) ** k * 1e-6 for k in range(20)]
    assert all(model.measurement(seen(stamp)) is not None for stamp in stamps)
    model.measurement(seen(0.0))
    with pytest.raises(ArgumentError, match="finite"):
        model.measurement(seen(0.96)._replace(values=np.array([np.nan, 0.0])))


def test_a_part_of_a_signal_is_thinned_for_itself_its_noise_counts_each_dof(library, model):
    """One that is seen for the first time beside one just seen is as crowded as that one."""
    assert model.measurement(seen(0.0, dofs=(0,))) is not None
    assert model.measurement(seen(0.02, dofs=(0,))) is None
    other = model.measurement(seen(0.02, dofs=(1,)))
    np.testing.assert_allclose(other.noise_covariance, [[library.noise_variance[1]]])
    both = model.measurement(seen(0.04))
    np.testing.assert_allclose(both.noise_covariance, np.diag(library.noise_variance[:2] * 5.0))


def test_intervals_run_between_used_measurements_of_any_signal(model):
    intervals = [
        model.measurement(seen(elapsed_s, group)).interval_s
        for elapsed_s, group in ((0.1, 0), (0.3, 1), (0.25, 0), (0.31, 0), (0.6, 0))
    ]
    np.testing.assert_allclose(intervals, [np.inf, 0.2, 0.0, 0.01, 0.29])
