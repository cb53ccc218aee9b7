# SPDX-License-Identifier: Apache-2.0
"""Which observations are used, with which noise, and what the filter takes."""

import numpy as np
import pytest
from plain import bank_of
from simulation import START_NS, make_library

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.filtering import MovementFilter, make_prior_grid
from intent_recognition.filtering.observation_model import ObservationModel
from intent_recognition.signals import Observation, Signal, every_second, merge

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


@pytest.fixture
def two_trackers(rng):
    return make_library(rng, groups=(2, 3), n_basis=6, correlation_time_s=0.05)


def observation(elapsed_s: float, group: int, values, **more) -> Observation:
    stamp_ns = START_NS + round(elapsed_s * 1e9)
    return Observation(stamp_ns, group, np.asarray(values, float), **more)


def start(two_trackers, n_scales: int = 3) -> MovementFilter:
    return MovementFilter(two_trackers, make_prior_grid(two_trackers, n_scales=n_scales), START_NS)


def test_samples_come_in_the_order_of_stamps_and_are_thinned_by_signal():
    one = Signal(("a",), np.array([10, 30, 50]), np.arange(3.0)[:, None], "m")
    other = Signal(("b", "c"), np.array([20, 30]), np.arange(4.0).reshape(2, 2), "m")
    merged = list(merge([one, other]))
    assert [(o.stamp_ns, o.group) for o in merged] == [(10, 0), (20, 1), (30, 0), (30, 1), (50, 0)]
    assert merged[3].values.tolist() == [2.0, 3.0]
    assert all(o.dofs is None and not o.derivative for o in merged)
    observations = [observation(0.01 * k, k % 2, [0.0]) for k in range(20)]
    observations += [observation(0.5, 0, [0.0], derivative=True)]
    kept = every_second(observations)
    assert kept[-1] is observations[-1]
    assert [o.group for o in kept[:-1]] == [0, 1] * 5
    assert [o.stamp_ns for o in kept] == sorted(o.stamp_ns for o in kept)


def test_velocities_after_the_end_are_zero_under_every_hypothesis(two_trackers):
    run = start(two_trackers)
    before = bank_of(run)
    late_s = 10.0 * float(run.grid.duration_s.max())
    moving = observation(late_s, 0, [0.5, 0.5], covariance=np.eye(2), derivative=True)
    run.observe(moving)
    assert np.array_equal(bank_of(run).mean, before.mean)
    assert np.ptp(run.log_evidence) == 0.0


def test_a_movement_is_the_same_at_any_time(two_trackers):
    found = []
    for onset_ns in (START_NS, 3 * START_NS):
        run = MovementFilter(two_trackers, make_prior_grid(two_trackers, n_scales=3), onset_ns)
        run.observe(observation(0.2, 0, [0.1, -0.1])._replace(stamp_ns=onset_ns + 200_000_000))
        found.append(run.posterior(onset_ns + 500_000_000))
    for one in found:
        np.testing.assert_array_equal(one.phase, found[0].phase)
        assert np.all((one.phase[:-1] > 0.1) & (one.phase[:-1] < 0.5))


def test_velocities_without_a_covariance_and_values_that_do_not_fit_are_named(two_trackers):
    with pytest.raises(ArgumentError, match=r"a covariance with measured velocities.*sensor"):
        start(two_trackers).observe(observation(0.1, 0, [0.0, 0.0], derivative=True))
    with pytest.raises(ShapeError, match=r"\(2,\) and \(2, 2\)"):
        start(two_trackers).observe(observation(0.1, 0, [0.0, 0.0, 0.0]))
    with pytest.raises(ShapeError, match=r"\(1,\) and \(1, 1\)"):
        start(two_trackers).observe(observation(0.1, 0, [0.0, 0.0], dofs=(1,)))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused_and_change_nothing(two_trackers, value):
    run = start(two_trackers)
    with pytest.raises(ArgumentError, match=r"values: expected finite numbers.*Leave out"):
        run.observe(observation(0.1, 0, [0.0, value]))
    for a, b in zip(bank_of(run), bank_of(start(two_trackers)), strict=True):
        assert np.array_equal(a, b)
