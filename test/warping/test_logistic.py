# SPDX-License-Identifier: Apache-2.0
"""Logistic regression by reweighted least squares."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.special import expit

from intent_recognition.errors import TrainingError
from intent_recognition.warping.part_labels import _seen, fit_logistic


def samples(seed: int, n: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Features (n, 3) of different scales and labels drawn from a known model."""
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(n, 3)) * [1.0, 100.0, 1e-3] + [0.0, 50.0, 2.0]
    odds = (features - [0.0, 50.0, 2.0]) @ [1.5, -0.02, 500.0]
    return features, (rng.random(n) < expit(odds)).astype(int)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), ridge=st.sampled_from([1e-3, 1e-1, 10.0]))
def test_weights_minimise_the_penalised_loss(seed, ridge):
    features, labels = samples(seed)
    model = fit_logistic(features, labels, ridge=ridge)
    standard = (features - features.mean(0)) / features.std(0)

    def loss(beta):
        odds = beta[0] + standard @ beta[1:]
        return (np.logaddexp(0, odds) - labels * odds).sum() + 0.5 * ridge * beta[1:] @ beta[1:]

    found = minimize(loss, np.zeros(4), method="BFGS", options={"gtol": 1e-7})
    np.testing.assert_allclose([model.bias, *model.weights], found.x, rtol=1e-4, atol=1e-4)


def test_separable_labels_have_a_finite_answer():
    features = np.linspace(-1.0, 1.0, 20)[:, None]
    model = fit_logistic(features, features[:, 0] > 0.0)
    assert np.isfinite(model.weights).all()
    assert (model.probability(features) > 0.5).tolist() == (features[:, 0] > 0.0).tolist()


def test_constant_feature_changes_nothing():
    features, labels = samples(4)
    model = fit_logistic(np.column_stack([features, np.full(len(labels), 3.0)]), labels)
    assert model.weights[-1] == pytest.approx(0.0)


def test_one_label_alone_is_refused():
    with pytest.raises(TrainingError, match="both 0 and 1"):
        fit_logistic(np.zeros((3, 1)), np.ones(3))


def test_only_what_a_camera_above_may_see_is_drawn(rng):
    """Whichever axis of the coordinates points up."""
    sides = np.vstack([np.eye(3), -np.eye(3)])
    cube = SimpleNamespace(points=sides, normals=sides)
    for up in sides:
        drawn = sides[_seen(cube, up, 3, rng)]
        assert len(drawn) and np.all(drawn @ up > -0.5)


@pytest.mark.parametrize(("degrees", "is_seen"), [(79.8, True), (80.15, True), (80.4, False)])
def test_a_camera_sees_normals_up_to_80_degrees_aside(degrees, is_seen):
    drawn = SimpleNamespace(uniform=lambda low, _: low, choice=lambda n, _, p, **__: p)
    camera = np.cos(0.7) * np.array([0.0, 1.0, 0.0]) + np.sin(0.7) * np.eye(3)[2]
    beside = np.cos(np.radians(degrees)) * camera + np.sin(np.radians(degrees)) * np.eye(3)[0]
    normals = np.stack([camera, camera, beside])
    seen = _seen(SimpleNamespace(points=normals, normals=normals), np.eye(3)[2], 1, drawn)
    assert (seen[2] > 0.0) == is_seen
