# SPDX-License-Identifier: Apache-2.0
"""Momentary stops of the hand, and movements that begin at one without a rest."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import draw_weights, make_library

from intent_recognition.promp import NONE
from intent_recognition.recognition import IntentEstimator
from intent_recognition.recognition.motion_detection import Stops, least_speed
from intent_recognition.signals import OnsetSettings, Samples, end_velocity

SETTINGS = OnsetSettings(reference_speed=1.0)
STEP_S = 0.01


def stops(position, until_s, settings=SETTINGS):
    """Times at which a signal is found to stop, sample by sample."""
    times_s = np.arange(0.0, until_s, STEP_S)
    stamps_ns = np.round(times_s * 1e9).astype(np.int64) + 1
    values = np.array([position(t) for t in times_s])
    seen, found = Stops(settings), []
    for last in range(1, len(times_s) + 1):
        samples = Samples(stamps_ns[:last], values[:last])
        velocity = end_velocity(settings, *samples.arrays(settings.window_s))
        stopped_ns = seen.stopped_ns(samples.last_ns, velocity)
        if stopped_ns is not None:
            found.append(stopped_ns * 1e-9)
    return np.array(found)


def test_a_wave_stops_at_its_extrema_and_a_long_stop_where_the_hand_moves_again():
    found = stops(lambda t: (0.3 * np.sin(np.pi * t), 0.0), 4.0)
    np.testing.assert_allclose(found, [0.5, 1.5, 2.5, 3.5], atol=0.02)
    (found,) = stops(lambda t: (min(t, 1.0) + max(t - 3.0, 0.0), 0.0), 4.0)
    assert 3.0 - 0.5 * SETTINGS.max_backdate_s - 0.1 < found < 3.1


@pytest.mark.parametrize(
    "position",
    [lambda t: (t, -t), lambda t: (np.sin(t), np.cos(t)), lambda t: (0.005 * np.sin(9.0 * t), 0.0)],
    ids=["straight", "circle", "tremor"],
)
def test_what_never_slows_down_or_never_moves_has_no_stop(position):
    assert stops(position, 5.0).size == 0


@pytest.mark.parametrize(("again_s", "n_stops"), [(4.8, 0), (5.2, 1)])
def test_a_stop_is_told_only_once_the_hand_has_moved_on_for_long_enough(again_s, n_stops):
    settings = replace(SETTINGS, persistence_s=5.0)
    found = stops(lambda t: (min(t, 6.0) + np.clip(t - 6.5, 0.0, again_s), 0.0), 13.0, settings)
    assert len(found) == n_stops


def test_dofs_that_are_first_seen_after_a_stop_do_not_hide_it():
    seen, found = Stops(SETTINGS), []
    for k in range(150):
        moves, dofs = (not 50 <= k < 70), ((0, 1) if k < 70 else (2, 3))
        found.append(seen.stopped_ns(1 + k * 10_000_000, np.full(2, float(moves)), dofs))
    assert sum(one is not None for one in found) == 1


@pytest.mark.parametrize(("away", "n_stops"), [(-1.0, 1), (1.0, 0)], ids=["back", "on"])
def test_a_turn_while_nothing_is_seen_is_a_stop(away, n_stops):
    times_s = np.r_[np.arange(0.0, 1.0, STEP_S), np.arange(1.3, 2.0, STEP_S)]
    stamps_ns = np.round(times_s * 1e9).astype(np.int64) + 1
    values = np.stack([np.minimum(times_s, 1.15) + away * np.maximum(times_s - 1.15, 0.0)] * 2, 1)
    seen, found = Stops(SETTINGS), []
    for last in range(1, len(times_s) + 1):
        recent = times_s[:last] > times_s[last - 1] - SETTINGS.window_s
        samples = Samples(stamps_ns[:last][recent], values[:last][recent])
        velocity = end_velocity(SETTINGS, *samples.arrays())
        stop_ns = seen.stopped_ns(samples.last_ns, velocity)
        found += [stop_ns] if stop_ns is not None else []
    assert len(found) == n_stops
    np.testing.assert_allclose(np.array(found) * 1e-9, [1.15] * n_stops, atol=SETTINGS.window_s)


def test_least_speed_is_that_of_the_nearest_of_all_velocities_between(rng):
    before, after = rng.normal(size=(2, 3))
    between = before + np.linspace(0.0, 1.0, 10001)[:, None] * (after - before)
    slowest = np.linalg.norm(between, axis=1).min()
    assert least_speed(before, after) == pytest.approx(slowest, abs=1e-6)
    assert least_speed(before, before) == pytest.approx(np.linalg.norm(before))


def blended(first, second, share):
    done = np.clip(share, 0.0, 1.0)[:, None]
    return first + done**3 * (10.0 - 15.0 * done + 6.0 * done**2) * (second - first)


def flowing(library, rng, tasks):
    """Positions at 100 Hz of reaches with the ways back between them, and no rest at all."""
    weights = [draw_weights(library, task, rng)[:3] for task in tasks]
    reaching = library.basis.design_matrix(np.arange(0.0, 1.0, 0.005))
    courses = [reaching @ own.T for own in weights]
    parts = [np.repeat(courses[0][:1], 100, axis=0)]
    for course, following in zip(courses, [*courses[1:], courses[0]], strict=True):
        parts.append(course[:-15])
        back = np.linspace(0.0, 0.9, 90)
        parts.append(blended(course[-15:-14], following[:1], back))
    values = np.concatenate([*parts, np.repeat(parts[-1][-1:], 200, axis=0)])
    return values + rng.normal(size=values.shape) * np.sqrt(library.noise_variance[:3])


def recognised(estimator, values):
    """Tasks in the order in which they became probable, none of them twice in a row."""
    found = []
    for k, row in enumerate(values):
        estimate = estimator.observe(10.0 + k * STEP_S, row)
        task = estimate.labels[int(np.argmax(estimate.probabilities))]
        if task != NONE and estimate.probabilities.max() > 0.95 and found[-1:] != [task]:
            found.append(task)
    return found


@pytest.mark.parametrize("seen", [[2], [1, 2]], ids=["one", "two"])
@pytest.mark.parametrize("first", range(60, 180, 40))
def test_dofs_that_are_missing_for_a_moment_change_nothing_of_the_task(rng, seen, first):
    """The others' velocity says nothing of a stop since theirs was known, nor is it an error."""
    library = make_library(rng, n_basis=8, spread=0.02, correlation_time_s=0.05)
    values = flowing(library, rng, (1,))
    by_nan, by_dofs = IntentEstimator(library), IntentEstimator(library)
    for k, row in enumerate(values[:280]):
        gone = first <= k < first + 12
        dofs = seen if gone else [0, 1, 2]
        found = by_dofs.observe(k * STEP_S, row[dofs], dofs=dofs)
        row[np.setdiff1d([0, 1, 2], dofs)] = np.nan
        again = by_nan.observe(k * STEP_S, row)
        np.testing.assert_array_equal(found.probabilities, again.probabilities)
    assert found.task == library.labels[1]


@pytest.mark.slow
def test_reaches_without_a_rest_are_recognised_one_after_the_other(rng):
    library = make_library(rng, n_basis=8, spread=0.02, correlation_time_s=0.05)
    library = replace(library, none_margin=4.0)  # as training learns one
    tasks = (0, 2, 1)
    labels = [library.labels[task] for task in tasks]
    values = flowing(library, rng, tasks)
    assert recognised(IntentEstimator(library), values) == labels
    assert recognised(IntentEstimator(library, switching=False), values) != labels
