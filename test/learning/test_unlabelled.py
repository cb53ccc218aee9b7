# SPDX-License-Identifier: Apache-2.0
"""Recordings without labels become tasks."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import make_library, simulate

from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.learning import (
    TrainingSettings,
    label_by_components,
    learn_components,
    learn_mixture,
)

SETTINGS = TrainingSettings(n_basis=10, n_aligned_basis=10, segmentation="recording")


@pytest.fixture
def recorded(rng):
    """Six and four recordings of two tasks."""
    library = make_library(rng, n_tasks=2, spread=0.02)
    tasks = [0, 1, 0, 0, 1, 0, 1, 0, 1, 0]
    return [simulate(library, task, rng, name=f"demo_{k}") for k, task in enumerate(tasks)]


@pytest.mark.slow
def test_each_component_is_a_task(recorded):
    found = label_by_components(recorded, SETTINGS, np.random.default_rng(0))
    assert found.choice.n_components == 2 and found.purity == 1.0 and not found.rejected
    assert [d.task for d in found.demonstrations] == [
        {"task_0": "component_1", "task_1": "component_2"}[d.task] for d in recorded
    ]
    assert [d.name for d in found.demonstrations] == [d.name for d in recorded]
    report = learn_components(found, SETTINGS)
    library = report.library
    assert library.labels == ("component_1", "component_2")
    np.testing.assert_allclose(library.task_prior, [0.6, 0.4])
    np.testing.assert_allclose(library.transition_prior, [[0.6, 0.4]] * 3)
    assert report.trained.library is library
    blind = [replace(one, task=None) for one in recorded]
    assert np.array_equal(learn_mixture(blind, 2, SETTINGS).weight_mean, library.weight_mean)


def test_labels_are_not_looked_at_and_their_number_may_be_given(recorded):
    blind = [replace(d, task=None) for d in recorded]
    first = label_by_components(recorded, SETTINGS, np.random.default_rng(0))
    second = label_by_components(blind, SETTINGS, np.random.default_rng(0))
    assert [d.task for d in first.demonstrations] == [d.task for d in second.demonstrations]
    assert second.purity is None
    mixed = label_by_components([*recorded[:5], *blind[5:]], SETTINGS, np.random.default_rng(0))
    assert mixed.purity == 1.0
    found = label_by_components(recorded, SETTINGS, np.random.default_rng(0), n_components=1)
    assert {d.task for d in found.demonstrations} == {"component_1"}
    assert found.purity == pytest.approx(0.6)
    with pytest.raises(ArgumentError, match="n_components"):
        label_by_components(recorded, SETTINGS, np.random.default_rng(0), n_components=11)


def test_what_cannot_be_used_is_named(recorded):
    short = replace(recorded[0], name="short", end_ns=recorded[0].start_ns + 1000)
    observed = recorded[1].observed
    renamed = tuple(replace(s, names=tuple(f"x_{n}" for n in s.names)) for s in observed)
    strange = replace(recorded[1], name="strange", observed=renamed)
    rng = np.random.default_rng(0)
    found = label_by_components([*recorded, short, strange], SETTINGS, rng)
    assert [name for name, _ in found.rejected] == ["short", "strange"]
    assert "DOFs" in found.rejected[1][1] and len(found.demonstrations) == len(recorded)
    with pytest.raises(TrainingError, match="short"):
        label_by_components([short], SETTINGS, rng)
    with pytest.raises(TrainingError, match="usable"):
        label_by_components([], SETTINGS, rng)
