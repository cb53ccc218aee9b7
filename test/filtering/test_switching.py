# SPDX-License-Identifier: Apache-2.0
"""Hypotheses born on the way: their offsets, their shares, and what they make of a movement."""

from dataclasses import replace

import numpy as np
import pytest
from plain import bank_of
from scipy.interpolate import BPoly
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal
from simulation import START_NS, draw_weights, make_library

from intent_recognition.filtering import (
    MovementFilter,
    TaskPrediction,
    births,
    make_prior_grid,
    rates,
)
from intent_recognition.filtering.rates import AFRESH, DELAY, TURN
from intent_recognition.filtering.table import ending, fading
from intent_recognition.signals.observation import Observation

RATE = np.array([2.0, 5.0, 11.0])


@pytest.fixture
def library(rng):
    return make_library(rng, n_basis=6, correlation_time_s=0.05)


def course(library, weights, times_s, duration_s=2.0):
    design = library.basis.design_matrix(np.clip(times_s / duration_s, 0.0, 1.0))
    return design @ weights[: library.n_observed].T


def changed(library, rng, tasks, change_s, times_s):
    """Positions of a reach as one task that goes over to the course of another."""
    first, second = (course(library, draw_weights(library, t, rng), times_s) for t in tasks)
    done = np.clip((times_s - change_s) / 0.5, 0.0, 1.0)[:, None]
    done = done**3 * (10.0 - 15.0 * done + 6.0 * done**2)
    values = first + done * (second - first)
    return values + rng.normal(size=values.shape) * np.sqrt(library.noise_variance[:3])


def filtered(library, times_s, values, run=None, *, switching=True, task_weight=None):
    run = run or MovementFilter(library, make_prior_grid(library), START_NS, switching=switching)
    run.restart(START_NS, task_weight)
    for elapsed_s, row in zip(times_s, values, strict=True):
        observe(run, elapsed_s, row)
    return run


def observe(run, elapsed_s, row):
    run.observe(Observation(START_NS + round(elapsed_s * 1e9), 0, row))


def posterior(run, elapsed_s):
    return run.posterior(START_NS + round(elapsed_s * 1e9))


def test_an_offset_fades_as_a_critically_damped_spring_from_position_velocity_and_push():
    s, h = np.full(3, 0.37), 1e-4
    before, now, after = (fading(s + k * h, RATE) for k in (-1, 0, 1))
    velocity, acceleration = (after - before) / (2 * h), (after - 2 * now + before) / h**2
    force = acceleration + 2 * RATE[:, None] * velocity + RATE[:, None] ** 2 * now
    pushed = np.stack([np.zeros(3), np.zeros(3), np.exp(-RATE * s)], axis=1)
    np.testing.assert_allclose(force, pushed, atol=1e-5)
    np.testing.assert_allclose(fading(s, RATE, derivative=True), velocity, atol=1e-6)
    zero = np.zeros(3)
    np.testing.assert_allclose(fading(zero, RATE), np.eye(3)[[0] * 3])
    np.testing.assert_allclose(fading(zero, RATE, derivative=True), np.eye(3)[[1] * 3])


def test_what_is_left_of_a_reach_afresh_fades_by_least_jerk():
    left_s, since_s = 1.3, np.linspace(0.0, 1.6, 9)
    rate = np.full(9, 1.0 / left_s)
    for k, state in enumerate(np.eye(3)):
        course = BPoly.from_derivatives([0.0, left_s], [state, np.zeros(3)])
        at = np.minimum(since_s, left_s)
        np.testing.assert_allclose(ending(since_s, rate)[:, k], course(at), atol=1e-12)
        speed = ending(since_s, rate, derivative=True)[:, k]
        np.testing.assert_allclose(speed, course(at, nu=1), atol=1e-12)


def test_the_odds_of_a_turn_are_its_share_of_everything_at_birth(library, rng):
    """Nothing but the birth speaks for hypotheses that have just settled."""
    times_s = np.arange(0.06, 1.0, 0.06)
    values = course(library, draw_weights(library, 0, rng), times_s)
    run = MovementFilter(library, make_prior_grid(library), START_NS, switching=True)
    for elapsed_s, row in zip(times_s, values, strict=True):
        observe(run, elapsed_s, row)
        table = run.births.table
        settled = np.isfinite(table.log_joint)
        if settled.any():
            break
    both = run.births.onset_log_joint(run.log_evidence), run.births.log_joint
    shares = table.log_joint[settled] - np.logaddexp.reduce(np.logaddexp(*both)[:-1])
    found = table.rows["log_birth"][settled]
    np.testing.assert_allclose(found, shares, atol=0.005)  # everything holds them now, too


def test_who_turns_to_another_task_has_the_habit_of_the_task_before(library, rng, monkeypatch):
    monkeypatch.setattr(births, "NEGLIGIBLE", np.inf)
    times_s = np.arange(0.0, 1.2, 0.05)
    values = course(library, draw_weights(library, 0, rng), times_s)
    ratio = np.array([0.1, 2.4, 0.5])
    joint = [
        filtered(library, times_s, values, task_weight=weight).births.log_joint[:-1]
        for weight in (None, ratio)
    ]
    assert np.argmax(posterior(filtered(library, times_s, values), 1.2).probabilities) == 0
    np.testing.assert_allclose(joint[1] + np.log(ratio) - joint[0], np.log(ratio[0]), atol=0.1)


def test_who_turns_to_the_unknown_is_kept_by_the_margin_that_was_paid_at_birth(library, rng):
    times_s = np.arange(0.0, 1.2, 0.05)
    library = replace(library, none_margin=10.0)
    run = filtered(library, times_s, course(library, draw_weights(library, 0, rng), times_s))
    table, of_onset = run.births.table, run.births.onset_log_joint(run.log_evidence)
    total = np.logaddexp.reduce(np.logaddexp(run.births.log_joint, of_onset))
    unknown = (table.rows["task"] == library.n_tasks) & np.isfinite(table.log_joint)
    assert table.log_joint[unknown].min() < total - births.NEGLIGIBLE


def test_born_hypotheses_divide_their_task_by_their_joint_densities(library, rng):
    times_s = np.arange(0.0, 1.2, 0.05)
    run = filtered(library, times_s, course(library, draw_weights(library, 0, rng), times_s))
    table = run.births.table
    for task in range(library.n_tasks):
        index, share = run.births.of_task(task)
        expected = np.exp(table.log_joint - table.log_joint.max()) * (table.rows["task"] == task)
        expected /= expected.sum()
        assert len(index) > 1 and np.ptp(share) > 0.01
        np.testing.assert_allclose(share, expected[index] / expected[index].sum(), rtol=1e-9)
        left_out = np.delete(expected, index)
        assert left_out.max(initial=0.0) <= births.NEGLIGIBLE_SHARE * expected.max()


def evidence_of(run, task):
    """Of the born hypotheses of a task that are not negligible."""
    table = run.births.table
    joint = np.where(table.rows["task"] == task, table.log_joint, -np.inf)
    some = np.exp(joint - joint.max()) > births.NEGLIGIBLE_SHARE
    return table.rows["log_evidence"][some]


@pytest.fixture
def one_each(monkeypatch):
    """Of each kind one hypothesis is born, and none is negligible."""
    monkeypatch.setattr(births, "FADINGS", (12.0,))
    monkeypatch.setattr(births, "N_DURATIONS", 1)
    monkeypatch.setattr(births, "NEGLIGIBLE", np.inf)


def none_std(library):
    """Of the DOFs of a movement that is none of the tasks, (P,)."""
    variance = np.diag(library.none_covariance).reshape(library.n_observed, -1)
    return np.sqrt(variance.mean(axis=1))


def log_density_of_last(y, mean, covariance, n):
    """Of the last n values, given those before."""
    m = len(y) - n
    before = multivariate_normal.logpdf(y[:m], mean[:m], covariance[:m, :m])
    return multivariate_normal.logpdf(y, mean, covariance) - before


def test_a_born_hypothesis_equals_the_joint_gaussian(library, rng, monkeypatch, one_each):
    for room in (rates, births):
        monkeypatch.setattr(room, "REACH_UNTIL", -1.0)
    monkeypatch.setattr(rates, "DELAY_RATE", 0.0)
    monkeypatch.setattr(births, "NEGLIGIBLE_SHARE", 0.0)
    monkeypatch.setattr(births, "BIRTHS_EVERY", 1)
    times_s = np.arange(0.0, 1.2, 0.1)
    values = changed(library, rng, (0, 1), 0.4, times_s)
    run = filtered(library, times_s, values)
    found = TaskPrediction(library, 1, run.births.table, *run.births.of_task(1), [])
    assert np.isclose(found.duration_weights.sum(), 1.0)
    # Nothing passes on at the first observation; those of the fifth come fourth, and stay there.
    born, at = 4, 3
    density = [evidence_of(run, 1)[at]]
    observe(run, 1.2, values[-1])
    density.append(evidence_of(run, 1)[at])
    later = run.births.table.courses(run.births.of_task(1)[0])

    p, n, noise = 3, library.basis.n_basis, library.noise_variance[0]
    size = p * (n + 3)
    mean, covariance = np.zeros(size), np.zeros((size, size))
    mean[: p * n] = library.observed_mean[1]
    covariance[: p * n, : p * n] = library.observed_covariance[1]
    scale = np.array([1.0, 6.0, births.PUSH * 36.0])
    covariance[p * n :, p * n :] = np.diag(np.outer(none_std(library), scale).ravel() ** 2)

    def rows(elapsed_s, offset):
        phase = np.array([min(elapsed_s / found.durations_s[at], 1.0)])
        row = np.zeros((p, size))
        row[:, : p * n] = np.kron(np.eye(p), library.basis.design_matrix(phase))
        if offset:
            since = np.array([elapsed_s - times_s[born]])
            row[:, p * n :] = np.kron(np.eye(p), fading(since, np.array([6.0])))
        return row

    seen = np.arange(born, len(times_s))
    h = [np.kron(np.eye(p), library.basis.design_matrix(np.zeros(1)))]
    h[0] = np.hstack([h[0], np.zeros((p, 3 * p))])
    h = np.vstack(h + [rows(times_s[k], True) for k in seen] + [rows(1.2, True)])
    y = np.concatenate([values[0], *values[seen], values[-1]])
    joint = h @ covariance @ h.T + noise * np.eye(len(y))
    assert np.isclose(density[1] - density[0], log_density_of_last(y, h @ mean, joint, p))
    gain = covariance @ h.T @ np.linalg.inv(joint)
    np.testing.assert_allclose(
        later.mean[at], (mean + gain @ (y - h @ mean))[: p * n], rtol=1e-6, atol=1e-8
    )


def test_a_reach_afresh_equals_the_joint_gaussian(library, rng, monkeypatch, one_each):
    monkeypatch.setattr(births, "REACH_OFFSETS", np.zeros(1))
    monkeypatch.setattr(rates, "DELAY_RATE", 0.0)
    monkeypatch.setattr(births, "BIRTHS_EVERY", 1)
    times_s, born = np.arange(0.0, 1.3, 0.1), 4
    values = changed(library, rng, (0, 1), 0.4, times_s)
    run, density = filtered(library, times_s[:-1], values[:-1]), []
    for _ in range(2):
        rows = run.births.table.rows
        of_it = (rows["task"] == 1) & (rows["kind"] == AFRESH)
        (found,) = rows["log_evidence"][of_it & np.isclose(rows["birth_s"], times_s[born])]
        density.append(found)
        observe(run, times_s[-1], values[-1])

    p, n, noise = 3, library.basis.n_basis, library.noise_variance[0]
    reach_s = births.REACH_PART * float(np.exp(library.log_duration_mean[1]))
    scale = births.REACH_SCALE / run.births.usual_s ** np.arange(3)
    offset = np.diag(np.outer(none_std(library), scale).ravel() ** 2)
    covariance = block_diag(library.observed_covariance[1], offset)
    seen = times_s[born:] - times_s[born]
    design = library.basis.design_matrix(np.append(0.0, np.minimum(seen / reach_s, 1.0)))
    fades = np.vstack([np.zeros(3), ending(seen, np.full(len(seen), 1.0 / reach_s))])
    blocks = [
        np.hstack([np.kron(np.eye(p), a), np.kron(np.eye(p), b)])
        for a, b in zip(design, fades, strict=True)
    ]
    h = np.vstack(blocks)
    y = np.concatenate([values[0], *values[born:]])
    mean = h[:, : p * n] @ library.observed_mean[1]
    joint = h @ covariance @ h.T + noise * np.eye(len(y))
    assert np.isclose(density[1] - density[0], log_density_of_last(y, mean, joint, p))
    rows = run.births.table.rows
    np.testing.assert_allclose(rows["log_share"][rows["kind"] == AFRESH], 0.0, atol=1e-12)
    of_it &= np.isclose(rows["birth_s"], times_s[born])
    alone = TaskPrediction(library, 1, run.births.table, np.flatnonzero(of_it), np.ones(1), [])
    goes_on = alone.observed(5)
    since_s = goes_on.times_s - times_s[born]
    ahead = library.basis.design_matrix(np.minimum(since_s / reach_s, 1.0))
    left = ending(since_s, np.full(len(since_s), 1.0 / reach_s))
    gain = covariance @ h.T @ np.linalg.inv(joint)
    updated = np.r_[library.observed_mean[1], np.zeros(3 * p)] + gain @ (y - mean)
    spread = covariance - gain @ h @ covariance
    for dof in range(p):
        row = np.zeros((5, len(updated)))
        row[:, dof * n : (dof + 1) * n] = ahead
        row[:, p * n + 3 * dof : p * n + 3 * dof + 3] = left
        np.testing.assert_allclose(goes_on.positions[:, dof], row @ updated, atol=1e-8)
        variance = np.sum((row @ spread) * row, axis=1) + noise
        np.testing.assert_allclose(goes_on.std[:, dof] ** 2, variance, rtol=1e-6)


def test_the_rest_of_a_turn_begins_where_the_hand_is(library, rng):
    times_s = np.arange(0.0, 0.8, 0.05)
    values = changed(library, rng, (0, 1), 0.5, times_s)
    run = filtered(library, times_s, values)
    assert run.births.outweighs(1, run.log_evidence)
    found, noise = run.prediction(1).observed(30), np.sqrt(library.noise_variance[:3])
    np.testing.assert_allclose(found.times_s[0], times_s[-1])
    assert np.all(np.abs(found.positions[0] - values[-1]) < 3.0 * noise)
    assert np.all(found.std[0] < 2.0 * noise)


def test_who_is_delayed_goes_on_with_all_that_was_seen(library, rng, monkeypatch, one_each):
    monkeypatch.setattr(births, "DELAYS", (0.12,))
    for room in (rates, births):
        monkeypatch.setattr(room, "REACH_UNTIL", -1.0)
    monkeypatch.setattr(births, "NEGLIGIBLE_SHARE", 0.0)
    monkeypatch.setattr(births, "BIRTHS_EVERY", 5)
    times_s = np.arange(0.0, 1.0, 0.1)
    values = changed(library, rng, (0, 0), 5.0, times_s)
    until = filtered(library, times_s[:5], values[:5], switching=False)
    joint = until.grid.log_prior + until.log_evidence
    parent = int(np.argmax(joint[: -until.grid.n_scales]))
    task, duration_s = parent // until.grid.n_scales, until.grid.duration_s[parent]
    run = filtered(library, times_s[:9], values[:9])
    before = evidence_of(run, task)
    observe(run, times_s[9], values[9])
    found = TaskPrediction(library, task, run.births.table, *run.births.of_task(task), [])
    bank, durations_s = found.weights, found.durations_s
    usual_s = run.births.usual_s
    (late,) = np.flatnonzero(np.isclose(durations_s, duration_s + 0.12 * usual_s))

    p, n, noise = 3, library.basis.n_basis, library.noise_variance[0]
    scale = (12.0 / usual_s) ** np.arange(3) * [1.0, 1.0, births.PUSH]
    mean = np.r_[bank_of(until).mean[parent], np.zeros(3 * p)]
    offset = np.diag(np.outer(none_std(library), scale).ravel() ** 2)
    covariance = block_diag(bank_of(until).covariance[parent], offset)
    h = []
    for elapsed_s in times_s[5:]:
        phase = np.clip((elapsed_s - 0.12 * usual_s) / duration_s, 0.0, 1.0)
        course = np.kron(np.eye(p), library.basis.design_matrix(np.array([phase])))
        offset = fading(np.array([elapsed_s - times_s[4]]), np.array([12.0 / usual_s]))
        h.append(np.hstack([course, np.kron(np.eye(p), offset)]))
    h, y = np.vstack(h), values[5:].ravel()
    spread = h @ covariance @ h.T + noise * np.eye(len(y))
    expected = log_density_of_last(y, h @ mean, spread, p)
    assert np.isclose(evidence_of(run, task)[late] - before[late], expected)
    updated = mean + covariance @ h.T @ np.linalg.solve(spread, y - h @ mean)
    np.testing.assert_allclose(bank.mean[late], updated[: p * n], rtol=1e-6, atol=1e-8)


def test_a_change_is_followed_with_births_and_not_without(library, rng, monkeypatch):
    times_s = np.arange(0.0, 2.0, 0.05)
    values = changed(library, rng, (0, 1), 0.5, times_s)
    followed = filtered(library, times_s, values)
    believed = posterior(followed, 1.95)
    assert believed.probabilities[1] > 0.9
    assert (
        posterior(filtered(library, times_s, values, switching=False), 1.95).probabilities[1] < 0.5
    )
    truth = library.primitive(1)
    end = followed.prediction(1).controlled(1).positions[-1]
    other = followed.prediction(0).controlled(1).positions[-1]
    goal = library.basis.design_matrix(np.ones(1)) @ truth.weights.mean.reshape(5, -1)[3:].T
    assert np.linalg.norm(end - goal) < 0.5 * np.linalg.norm(other - goal)
    assert 1.4 < believed.duration_s[1] < 2.8 and 0.7 < believed.phase[1] <= 1.0
    wary = replace(library, switch_margin=500.0)
    monkeypatch.setattr(rates, "DELAY_RATE", 0.0)
    never = posterior(filtered(wary, times_s, values), 1.95)
    assert never.probabilities[1] < 0.5


def test_memory_that_was_used_before_gives_the_same(library, rng):
    times_s = np.arange(0.0, 1.5, 0.05)
    first = changed(library, rng, (2, 1), 0.5, times_s)
    second = changed(library, rng, (0, 1), 0.5, times_s)
    used = filtered(library, times_s, first)
    again = posterior(filtered(library, times_s, second, used), 1.45)
    fresh = posterior(filtered(library, times_s, second), 1.45)
    for one, other in zip(again, fresh, strict=True):
        np.testing.assert_array_equal(one, other)


def test_of_many_tasks_the_probable_ones_are_born_in_a_bounded_number(library, rng, monkeypatch):
    monkeypatch.setattr(births, "NEGLIGIBLE", np.inf)
    times_s = np.arange(0.0, 2.0, 0.05)
    run = filtered(library, times_s, changed(library, rng, (0, 1), 0.5, times_s))
    born = (4 * births.N_DURATIONS + len(births.DELAYS)) * len(births.FADINGS)
    assert run.births.table.n <= births.MAX_HYPOTHESES + births.SETTLING * born
    size = 3 * (library.basis.n_basis + 3)
    monkeypatch.setattr(births, "MAX_FLOATS", 100 * size * (size + 1 + 3))
    few = MovementFilter(library, make_prior_grid(library), START_NS, switching=True)
    assert few.births._n_kept == 100
    monkeypatch.setattr(births, "MAX_TASKS", 2)
    library = make_library(rng, n_tasks=7, n_basis=6, correlation_time_s=0.05)
    times_s = np.arange(0.0, 1.0, 0.05)
    run = filtered(library, times_s, changed(library, rng, (3, 3), 5.0, times_s))
    born = np.isfinite(run.births.log_joint[:-1])
    assert born[3] and born.sum() < 7
    rows, of_onset = run.births.table.rows, run.births.onset_log_joint(run.log_evidence)
    newest = rows["task"][rows["birth_s"] == rows["birth_s"].max()]
    joint = np.logaddexp(run.births.log_joint, of_onset)[:-1]
    assert {*newest} - {library.n_tasks} == {*np.argsort(joint)[-2:]}


def test_delays_are_of_the_course_that_is_followed_and_shares_are_whole(library, rng):
    times_s = np.arange(0.0, 2.0, 0.02)
    run = filtered(library, times_s, changed(library, rng, (0, 1), 0.6, times_s))
    rows = run.births.table.rows
    assert set(rows["task"][rows["kind"] == DELAY]) == {1}
    newest = rows[rows["birth_s"] == rows["birth_s"].max()]
    for kind, task in ((DELAY, 1), (TURN, 0), (TURN, 3)):  # all that passes to them, once
        born = newest[(newest["kind"] == kind) & (newest["task"] == task)]
        assert np.exp(born["log_share"]).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("seed", [13, 47, 57])
def test_a_turn_is_followed_where_a_signal_is_first_seen_on_the_way(seed):
    rng = np.random.default_rng(seed)
    library = make_library(rng, n_basis=6, groups=(2, 1), correlation_time_s=0.05)
    times_s = np.arange(0.0, 1.8, 0.05)
    run = filtered(library, [], [])
    for elapsed_s, row in zip(times_s, changed(library, rng, (0, 1), 0.8, times_s), strict=True):
        observe(run, elapsed_s, row[:2])
        if elapsed_s > 0.5:
            run.observe(Observation(START_NS + round(elapsed_s * 1e9), 1, row[2:]))
    assert posterior(run, times_s[-1]).probabilities[1] > 0.9


@pytest.mark.parametrize(("first_s", "apart_s", "every_s"), [(0.3, 0.02, 0.05), (0.0, 0.25, 0.3)])
def test_the_start_is_known_where_first_samples_are_late_or_sparse(
    rng, monkeypatch, first_s, apart_s, every_s
):
    library = make_library(rng, n_basis=6, groups=(2, 1), correlation_time_s=0.02)
    times_s = np.arange(first_s, 1.8, every_s)
    values, found = changed(library, rng, (0, 1), 0.8, times_s), []
    for until in (births.START_UNTIL, np.inf):
        monkeypatch.setattr(births, "START_UNTIL", until)
        run = filtered(library, [], [])
        for elapsed_s, row in zip(times_s, values, strict=True):
            observe(run, elapsed_s, row[:2])
            at_ns = START_NS + round((elapsed_s + apart_s) * 1e9)
            run.observe(Observation(at_ns, 1, row[2:]))
        found.append(run.births.table.weights(np.arange(run.births.table.n)).mean)
    np.testing.assert_array_equal(*found)
