# SPDX-License-Identifier: Apache-2.0
"""What is learned of a context from demonstrations."""

from dataclasses import replace

import numpy as np
import pytest
from moved_box import SETTINGS, demonstrations, hand_over, learned
from same_library import assert_same
from simulation import gathered

from intent_recognition.errors import ArgumentError, ShapeError, TrainingError
from intent_recognition.learning import (
    accumulate,
    add_demonstration,
    change_rule,
    example_of,
    learn,
    summarize,
)
from intent_recognition.learning.correcting import RuleChange
from intent_recognition.learning.hyperparameters import STRENGTH
from intent_recognition.learning.statistics import variance_scales
from intent_recognition.promp import CONTEXT_STRENGTH, Scatter, shared_covariance
from intent_recognition.signals import Demonstration


def end_error(library, recorded):
    """Error of the predicted last posture before anything is observed [rad]."""
    task = library.labels.index(recorded.task)
    predicted = library.primitive(task).predict_controlled(2).positions[-1]
    return np.linalg.norm(predicted - recorded.controlled[0].values[-1])


def test_the_gain_is_a_ridge_regression_on_the_demonstrations():
    trained = learned()
    recorded = demonstrations()
    prior = 0.0
    for task in ("give", "take"):
        own = np.array([one.context_values for one in recorded if one.task == task])
        prior = prior + np.sum((own - own.mean(axis=0)) ** 2, axis=0) / 14
    ridge = np.diag(np.sqrt(CONTEXT_STRENGTH * prior))
    for k, label in enumerate(trained.library.labels):
        own = [one for one in recorded if one.task == label]
        examples = [example_of(one, trained.preprocessing) for one in own]
        if trained.chosen.aligned:
            examples = [one.aligned for one in examples]
        contexts = np.array([one.context_values for one in own])
        weights = np.array([one.weights.ravel() for one in examples])
        left = np.vstack([contexts - contexts.mean(axis=0), ridge])
        right = np.vstack([weights - weights.mean(axis=0), np.zeros((2, weights.shape[1]))])
        expected = np.linalg.lstsq(left, right, rcond=None)[0].T
        np.testing.assert_allclose(trained.library.context.gain[k], expected, atol=1e-9)


def test_covariances_are_predictive_and_of_what_the_context_leaves(rng):
    """Residuals lose the degrees of freedom of the regression, the trace of its hat matrix."""
    trained = gathered(demonstrations(), SETTINGS)
    library, tasks = trained.library, [*trained.tasks.values()]
    size, model, n = library.n_observed_weights, library.context, 8
    matrix, freedom = np.zeros((size, size)), 0.0
    for k, task in enumerate(tasks):
        contexts, weights = (
            np.array([getattr(one, name).ravel() for one in task.examples])
            for name in ("context", "weights")
        )
        contexts, weights = (part - part.mean(axis=0) for part in (contexts, weights[:, :size]))
        scatter = model.covariance[k] / ((1.0 + 1.0 / n) / (n - 1 + CONTEXT_STRENGTH))
        prior = scatter - contexts.T @ contexts
        assert prior.diagonal().min() > 0.0 and abs(prior[0, 1]) < 1e-9
        residuals = weights - contexts @ model.gain[k, :size].T
        matrix += residuals.T @ weights
        freedom += n - 1 - np.trace(contexts @ np.linalg.solve(scatter, contexts.T))
    floor, _ = variance_scales(trained.tasks, library.units)
    pooled = Scatter(0.5 * (matrix + matrix.T), freedom)
    shared = shared_covariance(pooled, floor[: library.n_observed], STRENGTH)
    for k, gain in enumerate(model.gain[:, :size]):
        expected = (1.0 + 1.0 / n) * shared + gain @ model.covariance[k] @ gain.T
        np.testing.assert_allclose(library.observed_covariance[k], expected, atol=1e-9)


def test_a_changed_rule_is_changed_in_every_context(rng):
    trained = gathered(demonstrations(), SETTINGS)
    library, n = trained.library, trained.library.n_observed_weights
    size = library.weight_mean.shape[1] - n
    change = RuleChange(0.1 * rng.normal(size=(size, n)), rng.normal(size=size))
    after = change_rule(trained, "give", change)
    for given in ([np.nan, np.nan], [0.1, -0.2]):
        before, now = (one.library.given(given).regressions[0] for one in (trained, after))
        np.testing.assert_allclose(now.matrix, before.matrix + change.slopes, atol=1e-8)
        offset = before.offset + change.offset - change.slopes @ library.weight_mean[0, :n]
        np.testing.assert_allclose(now.offset, offset, atol=1e-8)
    task = after.tasks["give"]
    again = summarize(task.examples)
    np.testing.assert_allclose(task.context_cross, again.context_cross, atol=1e-9)


def test_a_new_place_is_predicted_and_the_context_is_that_at_the_beginning():
    library = learned().library
    tests = [hand_over(task, seed) for task in ("give", "take") for seed in range(100, 106)]
    known = [end_error(library.given(one.context_values), one) for one in tests]
    unknown = [end_error(library, one) for one in tests]
    assert np.mean(known) < 0.2 * np.mean(unknown)
    one = hand_over("give", 0, box=(0.1, 0.2))
    (signal,) = one.context
    stamps_ns = one.start_ns + np.array([-2, -1, 10]) * 10**9
    moved = replace(signal, stamps_ns=stamps_ns, values=np.arange(6.0).reshape(3, 2))
    np.testing.assert_array_equal(replace(one, context=(moved,)).context_values, [2.0, 3.0])
    late = replace(signal, stamps_ns=stamps_ns[2:], values=np.array([[7.0, 8.0]]))
    np.testing.assert_array_equal(replace(one, context=(late,)).context_values, [7.0, 8.0])


@pytest.mark.slow
def test_without_a_context_nothing_changes():
    plain = learn([replace(one, context=()) for one in demonstrations()], SETTINGS)
    library = learned().library
    assert plain.context is None
    told = {"context", "weight_covariance", "observed_weight_covariance", "provenance", "basis"}
    assert_same(library, plain, rtol=0.0, apart=(*told, "onset", "phase_deviation"))


@pytest.mark.slow
def test_one_more_demonstration_equals_learning_all():
    recorded = demonstrations()
    trained = gathered(recorded[:-1], SETTINGS)
    more = add_demonstration(trained, recorded[-1])
    statistics = more.tasks["take"]
    contexts = np.array([one.context_values for one in recorded if one.task == "take"])
    apart = contexts - contexts.mean(axis=0)
    np.testing.assert_allclose(statistics.context_mean, contexts.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(statistics.context_scatter, apart.T @ apart, atol=1e-12)
    examples = [example_of(one, trained.preprocessing) for one in recorded if one.task == "take"]
    weights = np.array([one.weights.ravel() for one in examples])
    cross = (weights - weights.mean(axis=0)).T @ apart
    np.testing.assert_allclose(statistics.context_cross, cross, atol=1e-12)


@pytest.mark.slow
def test_contexts_of_few_demonstrations_or_that_never_varied():
    recorded = [hand_over("give", seed, box=(0.2, 0.1)) for seed in range(4)]
    library = gathered(recorded, SETTINGS).library
    np.testing.assert_array_equal(library.context.gain, 0.0)
    given = library.given([250.0, 0.1])
    np.testing.assert_array_equal(given.weight_mean, library.weight_mean)
    np.testing.assert_allclose(given.weight_covariance, library.weight_covariance, rtol=1e-6)
    recorded = [*demonstrations(1), hand_over("give", 50)]
    library = gathered(recorded, SETTINGS).library
    given = library.given([0.1, -0.1])
    for covariance in (given.weight_covariance, given.observed_weight_covariance):
        assert np.all(np.isfinite(covariance)) and np.linalg.eigvalsh(covariance).min() > 0.0


@pytest.mark.slow
def test_contexts_that_cannot_be_learned_from_together_are_named():
    recorded = demonstrations(2)
    found = accumulate([*recorded, replace(recorded[0], context=())], SETTINGS)
    ((_, reason),) = found.rejected
    assert "box/pose" in reason
    with pytest.raises(TrainingError, match="DOFs"):
        add_demonstration(learned(), replace(recorded[0], context=()))
    times_s, path = np.arange(5.0), np.zeros((5, 2))
    with pytest.raises(ShapeError, match="one for each name"):
        Demonstration.from_arrays(times_s, path, path, context=[1.0], context_names=["x", "y"])
    with pytest.raises(ArgumentError, match="context: expected finite"):
        Demonstration.from_arrays(times_s, path, path, context=[np.nan])
