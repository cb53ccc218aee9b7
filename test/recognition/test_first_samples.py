# SPDX-License-Identifier: Apache-2.0
"""The units of the first samples: what is refused, with which factor, and what never is."""

from dataclasses import replace

import numpy as np
import pytest
from online_stream import feed, movement

from intent_recognition.errors import ArgumentError
from intent_recognition.recognition import IntentEstimator, observed
from intent_recognition.signals import CLOCK_RESET_AFTER, Observation, merge, place_misfit

AT_M = np.array([0.8, -0.4, 0.3])
"""Where the movements are, in their frame [m]."""


@pytest.fixture(scope="module")
def placed(library):
    """The learned tasks away from the origin, as a wrist is in the world."""
    mean = library.weight_mean.copy()
    n_basis = mean.shape[1] // (library.n_observed + library.n_controlled)
    mean[:, : library.n_observed_weights] += np.repeat(AT_M, n_basis)
    return replace(library, weight_mean=mean)


def samples(truth, rng):
    (signal,) = movement(truth, 1, rng).observed
    return signal.seconds(int(signal.stamps_ns[0])), signal.values + AT_M


@pytest.mark.parametrize(
    ("factor", "unit"), [(1000.0, "millimetres"), (100.0, "centimetres"), (1.0 / 0.0254, "inches")]
)
def test_positions_in_another_unit_are_refused_with_the_factor(placed, truth, rng, factor, unit):
    times_s, values = samples(truth, rng)
    estimator = IntentEstimator(placed)
    for stamp_s, value in zip(times_s[:3], values, strict=False):
        with pytest.raises(ArgumentError, match=rf"Likely {unit} for metres .*{factor:.4g}"):
            estimator.observe(stamp_s, factor * value)
    assert not estimator.observe(times_s[3], values[3]).moving


def test_a_rest_at_the_origin_says_nothing_of_the_unit(library, truth, rng):
    """However long it is, the movement after it is judged."""
    times_s, values = samples(truth, rng)
    values = 1000.0 * (values - values[0])
    estimator = IntentEstimator(library)
    for k in range(2 * observed.N_JUDGED):
        estimator.observe(0.01 * k, np.zeros(3))
    with pytest.raises(ArgumentError, match="metres"):
        for stamp_s, value in zip(times_s + 10.0 - times_s[0], values, strict=True):
            estimator.observe(stamp_s, value)


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")]
)
def test_stamps_in_another_unit_are_refused_with_the_factor(placed, truth, rng, factor, unit):
    times_s, values = samples(truth, rng)
    estimator = IntentEstimator(placed)
    stamps = np.round(1e3 + times_s * factor)
    for stamp, value in zip(stamps[: observed.N_STEPS - 1], values, strict=False):
        estimator.observe(stamp, value)
    with pytest.raises(ArgumentError, match=f"Likely {unit} for seconds"):
        estimator.observe(stamps[observed.N_STEPS - 1], values[4])
    late = 0  # the right ones are those of a clock that was set back
    for stamp_s, value in zip(times_s, values, strict=True):
        try:
            estimator.observe(stamp_s, value)
        except ArgumentError:
            late += 1
    assert late == CLOCK_RESET_AFTER - 1


def test_degrees_are_refused_and_some_dofs_judged_by_what_was_learned_of_them(placed):
    in_rad = replace(placed, observed_units=("rad",) * 3)
    with pytest.raises(ArgumentError, match="Likely degrees for radians"):
        IntentEstimator(in_rad).observe(0.0, np.degrees(AT_M))
    own = slice(placed.basis.n_basis)  # the weights of the first
    design = placed.basis.design_matrix(np.linspace(0.0, 1.0, 21))
    means, spread = placed.weight_mean[:, own], placed.weight_covariance[:, own, own]
    variances = np.einsum("tp,kpq,tq->kt", design, spread, design) + placed.noise_variance[0]
    off = means @ design.T + 3.0 * np.array([[[-1.0]], [[1.0]]]) * np.sqrt(variances)
    learned = f"is at 800 m, and was learned between {off.min():.3g} and {off.max():.3g} m"
    with pytest.raises(ArgumentError, match=learned):
        IntentEstimator(placed).observe(0.0, [800.0], dofs=[0])


def test_all_that_is_far_but_explained_by_no_unit_is_taken(placed, truth, rng):
    """A movement elsewhere is an unknown one; so is one that nobody has shown."""
    times_s, values = samples(truth, rng)
    for elsewhere in (values + 30.0, values * [1000.0, 1.0, 1.0], -values * 1000.0):
        estimator = IntentEstimator(placed)
        for stamp_s, value in zip(times_s[:9], elsewhere, strict=False):
            estimator.observe(stamp_s, value)


def test_only_the_first_samples_are_judged(placed, truth, rng, monkeypatch):
    judged = []
    one = observed.learned_misfit
    monkeypatch.setattr(observed, "learned_misfit", lambda *a: judged.append(a) or one(*a))
    observations = list(merge(movement(truth, 0, rng).observed))
    moved = [o._replace(values=o.values + AT_M) for o in observations]
    estimator = IntentEstimator(placed)
    feed(estimator, moved)
    assert len(judged) == observed.N_JUDGED < len(moved)
    rate = Observation(moved[-1].stamp_ns + 1, 0, 1000.0 * AT_M, np.eye(3), None, True)
    assert estimator.reason_to_reject(rate) is None


def test_a_body_far_from_the_origin_is_doubted():
    assert place_misfit(np.array([3.0, -4.0, 1.0])) is None
    assert place_misfit(1000.0 * AT_M).factor == 1000.0
    assert place_misfit(100.0 * AT_M).factor == 100.0
    assert "Likely millimetres or centimetres" in place_misfit(np.array([80.0, 0.0, 0.0])).reason
    assert "Likely millimetres for" in place_misfit(np.array([800.0, 0.0, 0.0])).reason
