# SPDX-License-Identifier: Apache-2.0
"""Alignment recovers known timing, leaves alone what is aligned, and never runs backward."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from experiments.alignment.timed import demonstrations
from intent_recognition.alignment import AlignmentSettings, align, align_to, even_trajectory
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.signals.signal import Signal

PHASE = np.linspace(0.0, 1.0, 101)
seeds = st.integers(0, 2**32 - 1)


def errors(timed, warps, reference: int) -> np.ndarray:
    """Error of the recorded phase at `PHASE` of the reference demonstration, (n, 101)."""
    truth = [timed.between(reference, i, PHASE) for i in range(len(warps))]
    return np.abs(np.array([warp.apply(PHASE) for warp in warps]) - truth)


@given(seeds)
@settings(max_examples=15)
def test_known_timing_is_recovered(seed):
    rng = np.random.default_rng(seed)
    timed = demonstrations(rng, rate_std=0.25, noise=0.01)
    found = errors(timed, align(timed.trajectories, 0).warps, 0)
    assert np.median(found) < 0.006
    assert np.quantile(found, 0.95) < 0.05


def test_a_shift_is_recovered(rng):
    timed = demonstrations(rng, rate_std=1e-6, shift_std=0.05, noise=0.002)
    alignment = align(timed.trajectories, 0, AlignmentSettings(end_std=0.1))
    truth = [timed.between(0, i, np.array([0.3, 0.5, 0.7])) for i in range(10)]
    found = [warp.apply([0.3, 0.5, 0.7]) for warp in alignment.warps]
    assert np.ptp(truth, axis=0).min() > 0.05
    np.testing.assert_allclose(found, truth, atol=0.01)


def test_aligning_to_itself_is_the_identity(rng):
    values = demonstrations(rng, n=1, noise=0.05).trajectories[0]
    for reference in (0, "mean", "medoid", values):
        for warp in align([values, values], reference).warps:
            np.testing.assert_allclose(warp.recorded, warp.grid, atol=1e-9)


def test_what_tells_nothing_stays_as_it_is():
    for reference in ("mean", "medoid", 1):
        alignment = align(np.full((4, 50, 2), 3.7), reference)
        for warp in alignment.warps:
            np.testing.assert_array_equal(warp.log_rate, 0.0)
        assert np.all(np.isinf(alignment.template.scale))


def test_units_and_dofs_that_never_move_do_not_matter(rng):
    timed = demonstrations(rng, noise=0.01)
    plain = align(timed.trajectories, 0)
    scaled = timed.trajectories * [1000.0, 1.0, 1e-3] + [5.0, -3.0, 0.0]
    still = np.concatenate([scaled, np.full((10, 200, 1), 0.1)], axis=2)
    for a, b in zip(plain.warps, align(still, 0).warps, strict=True):
        np.testing.assert_allclose(a.recorded, b.recorded, atol=3e-3)


@pytest.mark.slow
@example(5e-324 * np.arange(8.0).reshape(1, 4, 2), "mean")  # a scale that would vanish
@given(
    arrays(
        np.float64,
        st.tuples(st.integers(1, 4), st.integers(4, 60), st.integers(1, 3)),
        elements=st.floats(-1e6, 1e6),
    ),
    st.sampled_from(["mean", "medoid", 0]),
)
@settings(max_examples=25)
def test_no_warp_runs_backward_whatever_the_data(trajectories, reference):
    for warp in align(trajectories, reference).warps:
        assert np.all(np.diff(warp.recorded) > 0)
        assert np.all(np.isfinite(warp.recorded))


def test_the_mean_keeps_the_average_timing(rng):
    timed = demonstrations(rng, n=20, noise=0.01)
    alignment = align(timed.trajectories)
    average = np.mean([warp.apply(PHASE) for warp in alignment.warps], axis=0)
    np.testing.assert_allclose(average, PHASE, atol=0.02)
    assert alignment.reference_index is None
    np.testing.assert_allclose(alignment.aligned.mean(axis=0), alignment.template.values, atol=0.03)


def test_a_later_demonstration_comes_out_as_if_it_had_been_there(rng):
    trajectories = demonstrations(rng, noise=0.02, variety=0.05).trajectories
    alignment = align(trajectories)
    for i in (0, 4):
        (warp,) = align_to(alignment.template, trajectories[i : i + 1])
        np.testing.assert_allclose(warp.recorded, alignment.warps[i].recorded, atol=1e-10)


def test_demonstrations_may_have_different_numbers_of_samples(rng):
    timed = demonstrations(rng, n=4, noise=0.0, rate_std=0.2)
    coarse = [timed.trajectories[0], timed.trajectories[1][::2][:100], timed.trajectories[2]]
    full = align(timed.trajectories[:3], 0)
    found = align(coarse, 0)
    # Every second sample of 200 ends one sample early.
    stretched = full.warps[1].recorded * (199 / 198)
    np.testing.assert_allclose(found.warps[1].recorded, stretched, atol=0.01)


def test_the_medoid_is_the_one_most_like_the_others(rng):
    timed = demonstrations(rng, n=6, rate_std=0.05, noise=0.01)
    odd = timed.trajectories.copy()
    odd[[0, 2]] = odd[[0, 2], ::-1]
    assert align(odd, "medoid").reference_index in (1, 3, 4, 5)


def test_irregular_recordings_become_even_trajectories():
    stamps = np.array([0, 10, 15, 40, 90, 100, 130], dtype=np.int64) + 1_000
    line = Signal(("x", "y"), stamps, np.column_stack([stamps, -stamps]).astype(float), "m")
    late = Signal(("q",), stamps[3:], np.ones((4, 1)), "rad")
    values = even_trajectory((line, late), 1_000, 1_100, 5)
    expected = [[1000 + 25 * k, -1000 - 25 * k, 1.0] for k in range(5)]
    np.testing.assert_allclose(values, expected)


@pytest.mark.parametrize(("start", "end"), [(5, 5), (2_000, 3_000)])
def test_a_recording_without_samples_is_refused(start, end):
    signal = Signal(("x",), np.arange(10), np.zeros((10, 1)), "m")
    with pytest.raises(ArgumentError, match="x"):
        even_trajectory((signal,), start, end)


@pytest.mark.parametrize(
    ("trajectories", "reference", "error", "match"),
    [
        ([], "mean", ShapeError, "none"),
        ([np.zeros((3, 2))], "mean", ShapeError, "at least 4 samples"),
        ([np.zeros(9)], "mean", ShapeError, r"\(9,\)"),
        ([np.zeros((9, 2)), np.zeros((9, 3))], "mean", ShapeError, "same DOFs"),
        ([np.full((9, 2), np.nan)], "mean", ArgumentError, r"trajectories\[0\]"),
        ([np.zeros((9, 2))], "median", ArgumentError, "medoid"),
        ([np.zeros((9, 2))], 1, ArgumentError, "0 to 0"),
        ([np.zeros((9, 2))], np.zeros((9, 3)), ShapeError, "reference"),
    ],
)
def test_bad_input_is_refused_with_its_cure(trajectories, reference, error, match):
    with pytest.raises(error, match=match):
        align(trajectories, reference)


def test_a_template_of_other_settings_is_refused(rng):
    trajectories = demonstrations(rng, n=2).trajectories
    template = align(trajectories).template
    with pytest.raises(ShapeError, match="settings"):
        align_to(template, trajectories, AlignmentSettings(n_grid=41))


@pytest.mark.parametrize("name", ["rate_std", "end_std", "smoothing", "n_grid", "n_basis"])
def test_settings_out_of_range_are_refused(name):
    with pytest.raises(ArgumentError, match=name):
        AlignmentSettings(**{name: 0})
