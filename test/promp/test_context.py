# SPDX-License-Identifier: Apache-2.0
"""A library in a context, beside the joint Gaussian of context and weights."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import make_library

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian import Gaussian, marginal, regression
from intent_recognition.promp import ContextModel, PoseRegression

FREEDOM = np.array([7.0, 4.0, 11.0])


@pytest.fixture(scope="module")
def library():
    """Three tasks whose weights depend on three numbers, correlated with each other."""
    rng = np.random.default_rng(2)
    plain = make_library(rng)
    size, factors = plain.weight_mean.shape[1], rng.normal(size=(3, 3, 3))
    covariance = 0.01 * (factors @ np.swapaxes(factors, 1, 2) + 0.1 * np.eye(3))
    gain = rng.normal(size=(3, size, 3))
    explained = gain @ covariance @ np.swapaxes(gain, 1, 2)
    mean = rng.normal(size=(3, 3))
    names = ("x", "y", "height")
    context = ContextModel(names, ("m",) * 3, mean, covariance, gain, FREEDOM, (2, 1))
    n, observed = plain.n_observed_weights, plain.observed_covariance[:-1]
    return replace(
        plain,
        weight_covariance=plain.weight_covariance + explained,
        observed_weight_covariance=observed + explained[:, :n, :n],
        context=context,
    )


def joint(library, task):
    """Context first, then the weights."""
    model = library.context
    cross = model.gain[task] @ model.covariance[task]
    covariance = np.block(
        [[model.covariance[task], cross.T], [cross, library.weight_covariance[task]]]
    )
    return Gaussian(np.r_[model.mean[task], library.weight_mean[task]], covariance)


@pytest.mark.parametrize("known", [[0, 1, 2], [1], [0, 2]])
@pytest.mark.parametrize("task", [0, 1, 2])
def test_conditioning_on_a_context_is_that_of_the_joint_gaussian(library, task, known):
    values = np.full(3, np.nan)
    values[known] = library.context.mean[0, known] + 0.1
    given = library.given(values)
    both = joint(library, task)
    of_known = marginal(both, np.r_[known, 3 : len(both.mean)])
    expected = regression(of_known, len(known))
    np.testing.assert_allclose(
        given.weight_mean[task], expected.matrix @ values[known] + expected.offset, atol=1e-9
    )
    apart = values[known] - of_known.mean[: len(known)]
    block = of_known.covariance[: len(known), : len(known)]
    scale = 1.0 + apart @ np.linalg.solve(block, apart) / FREEDOM[task]
    found = given.weight_covariance[task]
    np.testing.assert_allclose(found, scale * expected.covariance, atol=1e-9)
    size = library.n_observed_weights
    np.testing.assert_allclose(
        given.observed_weight_covariance[task], found[:size, :size], atol=1e-9
    )


def test_a_context_says_nothing_about_the_task_nor_about_the_time_and_none_nothing(library):
    given = library.given([0.3, 0.2, 0.1])
    assert given.context is None and given.context_names == ()
    learned = PoseRegression(*np.ones(6))
    assert replace(library, pose_regression=learned).given([0.3, 0.2, 0.1]).pose_regression is None
    for name in (
        "task_prior",
        "transition_prior",
        "none_mean",
        "none_covariance",
        "log_duration_mean",
        "log_duration_std",
        "onset",
        "noise_variance",
    ):
        assert getattr(given, name) is getattr(library, name)
    assert library.given([np.nan] * 3) is library


def test_a_context_of_another_size_or_infinite_is_refused(library):
    with pytest.raises(ShapeError, match=r"context: expected shape \(3,\): x, y, height, got"):
        library.given([0.1, 0.2])
    with pytest.raises(ArgumentError, match="finite numbers or NaN"):
        library.given([0.1, np.inf, 0.0])
    with pytest.raises(ShapeError, match="no context was learned"):
        library.given([0.1, 0.2, 0.3]).given([0.1])
