# SPDX-License-Identifier: Apache-2.0
"""From samples of several signals to what the filter takes."""

import numpy as np
import pytest
from plain import bank_of
from simulation import START_NS, make_library

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.filtering import MovementFilter, make_prior_grid
from intent_recognition.signals import Observation, Signal, every_second, merge


@pytest.fixture
def library(rng):
    return make_library(rng, groups=(2, 3), n_basis=6, correlation_time_s=0.05)


def observation(elapsed_s: float, group: int, values, **more) -> Observation:
    stamp_ns = START_NS + round(elapsed_s * 1e9)
    return Observation(stamp_ns, group, np.asarray(values, float), **more)


def start(library, n_scales: int = 3) -> MovementFilter:
    return MovementFilter(library, make_prior_grid(library, n_scales=n_scales), START_NS)


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


def test_velocities_after_the_end_are_zero_under_every_hypothesis(library):
    run = start(library)
    before = bank_of(run)
    late_s = 10.0 * float(run.grid.duration_s.max())
    moving = observation(late_s, 0, [0.5, 0.5], covariance=np.eye(2), derivative=True)
    run.observe(moving)
    assert np.array_equal(bank_of(run).mean, before.mean)
    assert np.ptp(run.log_evidence) == 0.0


def test_a_movement_is_the_same_at_any_time(library):
    found = []
    for onset_ns in (START_NS, 3 * START_NS):
        run = MovementFilter(library, make_prior_grid(library, n_scales=3), onset_ns)
        run.observe(observation(0.2, 0, [0.1, -0.1])._replace(stamp_ns=onset_ns + 200_000_000))
        found.append(run.posterior(onset_ns + 500_000_000))
    for one in found:
        np.testing.assert_array_equal(one.phase, found[0].phase)
        assert np.all((one.phase[:-1] > 0.1) & (one.phase[:-1] < 0.5))


def test_velocities_without_a_covariance_and_values_that_do_not_fit_are_named(library):
    with pytest.raises(ArgumentError, match=r"a covariance with measured velocities.*sensor"):
        start(library).observe(observation(0.1, 0, [0.0, 0.0], derivative=True))
    with pytest.raises(ShapeError, match=r"\(2,\) and \(2, 2\)"):
        start(library).observe(observation(0.1, 0, [0.0, 0.0, 0.0]))
    with pytest.raises(ShapeError, match=r"\(1,\) and \(1, 1\)"):
        start(library).observe(observation(0.1, 0, [0.0, 0.0], dofs=(1,)))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused_and_change_nothing(library, value):
    run = start(library)
    with pytest.raises(ArgumentError, match=r"values: expected finite numbers.*Leave out"):
        run.observe(observation(0.1, 0, [0.0, value]))
    for a, b in zip(bank_of(run), bank_of(start(library)), strict=True):
        assert np.array_equal(a, b)
