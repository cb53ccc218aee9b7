# SPDX-License-Identifier: Apache-2.0
"""From samples of several signals to what the filter takes."""

import numpy as np
import pytest
from plain import bank_of, condition_bank, start_bank
from simulation import START_NS, make_library, simulate

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.filtering.filter import MovementFilter
from intent_recognition.filtering.grid import make_prior_grid
from intent_recognition.signals.observation import Observation, every_second, merge
from intent_recognition.signals.signal import Signal


@pytest.fixture
def library(rng):
    return make_library(rng, groups=(2, 3), n_basis=6, correlation_time_s=0.05)


def observation(elapsed_s: float, group: int, values, **more) -> Observation:
    stamp_ns = START_NS + round(elapsed_s * 1e9)
    return Observation(stamp_ns, group, np.asarray(values, float), **more)


def start(library, n_scales: int = 3) -> MovementFilter:
    return MovementFilter(library, make_prior_grid(library, n_scales=n_scales), START_NS)


def assert_same(ours, theirs):
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def test_samples_come_in_the_order_of_their_stamps_ties_in_that_of_signals():
    one = Signal(("a",), np.array([10, 30, 50]), np.arange(3.0)[:, None], "m")
    other = Signal(("b", "c"), np.array([20, 30]), np.arange(4.0).reshape(2, 2), "m")
    merged = list(merge([one, other]))
    assert [(o.stamp_ns, o.group) for o in merged] == [(10, 0), (20, 1), (30, 0), (30, 1), (50, 0)]
    assert merged[3].values.tolist() == [2.0, 3.0]
    assert all(o.dofs is None and not o.derivative for o in merged)


def test_dofs_of_a_signal_follow_those_of_the_signals_before(library):
    assert library.observed_dofs(0).tolist() == [0, 1]
    assert library.observed_dofs(1).tolist() == [2, 3, 4]


def test_a_run_equals_conditioning_by_hand(library, rng):
    run = start(library)
    bank = start_bank(library, run.grid)
    last = {}
    for elapsed_s, group in ((0.0, 0), (0.01, 1), (0.3, 0), (0.33, 0), (0.34, 1), (0.37, 1)):
        seen = observation(elapsed_s, group, rng.normal(size=library.observed_groups[group]))
        run.observe(seen)
        dofs = library.observed_dofs(group)
        interval_s = elapsed_s - last[group] if group in last else np.inf
        last[group] = elapsed_s
        rows = library.basis.design_matrix(elapsed_s / run.grid.duration_s)[:, None]
        noise = library.noise_covariance(dofs, interval_s)
        bank = condition_bank(bank, dofs, rows, seen.values, noise)
    np.testing.assert_allclose(bank_of(run).mean, bank.mean, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(bank_of(run).covariance, bank.covariance, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(run.log_evidence, bank.log_evidence, rtol=1e-6)


def test_the_sender_s_covariance_comes_on_top_of_the_learned_noise(library):
    values = np.array([0.1, -0.1, 0.2])
    covariance = np.diag([1e-3, 2e-3, 3e-3])
    run = start(library)
    run.observe(observation(0.2, 1, values, covariance=covariance))
    bank = start_bank(library, run.grid)
    dofs = library.observed_dofs(1)
    rows = library.basis.design_matrix(0.2 / run.grid.duration_s)[:, None]
    noise = library.noise_covariance(dofs, np.inf) + covariance
    assert_same(bank_of(run), condition_bank(bank, dofs, rows, values, noise))


def test_a_part_of_a_signal_is_conditioned_on_alone(library):
    run = start(library)
    run.observe(observation(0.2, 1, [0.3, 0.1], dofs=(2, 0)))
    bank = start_bank(library, run.grid)
    dofs = np.array([4, 2])
    rows = library.basis.design_matrix(0.2 / run.grid.duration_s)[:, None]
    noise = library.noise_covariance(dofs, np.inf)
    assert_same(bank_of(run), condition_bank(bank, dofs, rows, np.array([0.3, 0.1]), noise))


def test_each_dof_minds_when_it_was_last_seen(library):
    """A DOF that was hidden is not crowded when it comes back."""
    run = start(library)
    run.observe(observation(0.2, 1, [0.3], dofs=(0,)))
    crowded, fresh = start(library), start(library)
    for other in (crowded, fresh):
        other.observe(observation(0.2, 1, [0.3], dofs=(0,)))
    fresh.observe(observation(0.226, 1, [0.3], dofs=(1,)))
    crowded.observe(observation(0.226, 1, [0.3], dofs=(0,)))
    spread = [
        np.trace(bank_of(run).covariance[0] - bank_of(other).covariance[0])
        for other in (fresh, crowded)
    ]
    assert spread[0] > 3.0 * spread[1] > 0.0


def test_a_velocity_is_the_derivative_of_the_positions(library):
    """A movement seen by its velocities has the path that makes them, wherever it began."""
    run = start(library, n_scales=1)
    weights = library.observed_mean[0].reshape(5, -1) * 1.3
    duration_s = run.grid.duration_s[0]
    covariance = 1e-8 * np.eye(2)
    run.observe(observation(0.0, 0, weights[:2, 0], covariance=covariance))
    for phase in np.linspace(0.0, 1.0, 40):
        row = library.basis.derivative_matrix(np.array([phase]))[0] / duration_s
        run.observe(
            observation(
                phase * duration_s * (1 - 1e-9),
                0,
                weights[:2] @ row,
                covariance=covariance,
                derivative=True,
            )
        )
    found = run.task(0).mean[0].reshape(5, -1)[:2]
    grid = library.basis.design_matrix(np.linspace(0.0, 1.0, 9))
    path, expected = (np.array(grid @ w.T) for w in (found, weights[:2]))
    np.testing.assert_allclose(path - path[0], expected - expected[0], atol=2e-4)


def test_velocities_after_the_end_are_zero_under_every_hypothesis(library):
    run = start(library)
    before = bank_of(run)
    late_s = 10.0 * float(run.grid.duration_s.max())
    moving = observation(late_s, 0, [0.5, 0.5], covariance=np.eye(2), derivative=True)
    run.observe(moving)
    assert np.array_equal(bank_of(run).mean, before.mean)
    assert np.ptp(run.log_evidence) == 0.0


def test_velocities_need_a_covariance(library):
    with pytest.raises(ArgumentError, match=r"a covariance with measured velocities.*sensor"):
        start(library).observe(observation(0.1, 0, [0.0, 0.0], derivative=True))


def test_values_that_do_not_fit_are_named(library):
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


def test_a_copy_of_one_task_is_its_part_of_the_bank(library, rng):
    run = start(library)
    for seen in merge(simulate(library, 1, rng).observed):
        run.observe(seen)
    bank = bank_of(run)
    for task in range(library.n_tasks + 1):
        own = slice(3 * task, 3 * task + 3)
        whole = run.table.courses(np.arange(run.table.n)).moments()
        for a, b, c in zip(run.task(task).moments(), bank, whole, strict=False):
            assert np.array_equal(a, b[own]) and np.array_equal(a, c[own])


def test_thinning_keeps_every_signal_and_the_last_observation():
    observations = [observation(0.01 * k, k % 2, [0.0]) for k in range(20)]
    observations += [observation(0.5, 0, [0.0], derivative=True)]
    kept = every_second(observations)
    assert kept[-1] is observations[-1]
    assert [o.group for o in kept[:-1]] == [0, 1] * 5
    assert [o.stamp_ns for o in kept] == sorted(o.stamp_ns for o in kept)
