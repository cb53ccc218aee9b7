# SPDX-License-Identifier: Apache-2.0
"""Practice of a taught task: what is executed, what it costs, and what is accepted."""

from dataclasses import replace

import numpy as np
import pytest
from model_builder import GLOVE, make_dofs, perform, true_library
from simulation import gathered

from intent_recognition.demonstrations import read_demonstrations
from intent_recognition.errors import ArgumentError, ModelError
from intent_recognition.improvement import TaskPractice, load_cost
from intent_recognition.improvement.task_practice import NEAR_M, arrival_s, warping_matrix
from intent_recognition.kinematics import hand_position
from intent_recognition.learning import RuleChange, TrainingSettings, change_rule, inferred_weights
from intent_recognition.model import (
    Model,
    PractisedTask,
    TaskFolder,
    read_history,
    save_model,
    skill_history,
)

DOFS = make_dofs()
TRUTH = true_library(DOFS)
TASK = TRUTH.labels[0]
RNG = np.random.default_rng(3)


@pytest.fixture(scope="module")
def trained():
    settings = TrainingSettings(n_basis=10, n_aligned_basis=10)
    return gathered([perform(TRUTH, k % 2, k) for k in range(12)], settings)


@pytest.fixture
def library(trained, tmp_path):
    """A folder of tasks that begins with the model."""
    save_model(tmp_path / "m.npz", Model(trained.library, DOFS), trained)
    folder = TaskFolder(tmp_path / "tasks", DOFS)
    folder.start_from(tmp_path / "m.npz")
    return folder


def test_arrivals_are_found_in_time_and_go_on_where_there_is_none():
    times = np.linspace(0.0, 2.0, 201)
    line = np.stack([np.minimum(times, 1.0), 0 * times, 0 * times], axis=1)
    assert arrival_s(times, line, np.array([1.0, 0.0, 0.0])) == pytest.approx(1 - NEAR_M, abs=0.011)
    off = np.array([1.0, NEAR_M + 0.025, 0.0])
    assert arrival_s(times, line, off) == pytest.approx(2.1)
    assert arrival_s(times, line[:1].repeat(201, 0), np.zeros(3)) == 0.0


def test_a_warped_path_is_the_path_at_the_warped_phase(trained):
    basis = trained.library.basis
    phases, weights = np.linspace(0.0, 1.0, 80), RNG.normal(size=basis.n_basis)
    smooth = np.linalg.lstsq(basis.design_matrix(phases), phases**2 * (3 - 2 * phases), rcond=None)[
        0
    ]
    assert np.array_equal(warping_matrix(basis, 0.0) @ weights, weights)
    for ahead in (-0.3, 0.4):
        there = basis.design_matrix(np.minimum(phases * np.exp(ahead), 1.0)) @ smooth
        found = basis.design_matrix(phases) @ warping_matrix(basis, ahead) @ smooth
        np.testing.assert_allclose(found, there, atol=5e-3)


def test_what_was_executed_is_what_is_costed_and_logged(trained, tmp_path):
    practice = TaskPractice(trained, DOFS, TASK)
    space = practice.space
    assert practice.keeps_limits(space.mean)
    assert not practice.keeps_limits(space.mean + 3.0)
    rollouts = practice.rollout(space.mean, np.random.default_rng(1))
    others = practice.check(space.mean, 1)
    assert len(rollouts) + len(others) == trained.tasks[TASK].n
    one = rollouts[0]
    np.testing.assert_allclose(hand_position(one.joints_rad), one.hand_m, atol=1e-12)
    shown = trained.tasks[TASK].examples[0].controlled[-1]
    miss = np.linalg.norm(one.hand_m[-1] - hand_position(shown))
    assert load_cost("distance")(one) == pytest.approx(miss, abs=1e-12)
    practice.write(tmp_path / "0", rollouts, {"rollout": "0"})
    (read, *_), rejected = read_demonstrations(sorted((tmp_path / "0").iterdir()), DOFS)
    assert not rejected and read.task == TASK
    np.testing.assert_allclose(read.controlled[0].values[-1], one.joints_rad[-1], atol=1e-12)
    np.testing.assert_allclose(read.observed[0].values[-1], one.person_m[-1], atol=1e-12)
    beside = np.array([0.1, -0.2, 0.3])
    elsewhere = TaskPractice(trained, DOFS, TASK, beside_m=beside - 0.1, moved_m=[0.1] * 3)
    (there, *_) = elsewhere.rollout(space.mean, np.random.default_rng(1))
    gap = np.linalg.norm(there.hand_m[-1] - one.person_m[-1] - beside)
    assert there.outcome["distance_m"] == pytest.approx(gap, abs=1e-3)


def test_what_is_accepted_is_what_was_executed(trained):
    """The rule that the nodes predict with gives the practised path, for every person."""
    practice = TaskPractice(trained, DOFS, TASK)
    weights = practice.space.weights(practice.space.within(RNG.normal(size=practice.space.n_axes)))
    changed = change_rule(trained, TASK, practice.change(weights))
    basis, (phases, n) = changed.library.basis, (np.linspace(0.0, 1.0, 30), DOFS.controlled_names)
    rule = changed.library.regressions[0]
    for person, example in zip(practice._people, trained.tasks[TASK].examples, strict=True):
        predicted = rule.matrix @ inferred_weights(changed, example) + rule.offset
        path = basis.design_matrix(phases) @ predicted.reshape(len(n), -1).T
        np.testing.assert_allclose(path, practice._path(person, weights, phases), atol=0.02)
    same = changed.library
    assert np.array_equal(same.observed_covariance, trained.library.observed_covariance)
    assert np.array_equal(same.weight_mean[1], trained.library.weight_mean[1])


@pytest.mark.slow
def test_practice_in_a_folder_goes_on_is_accepted_and_taken_back(library):
    def opened(seed=1):
        practised = PractisedTask(library, TASK)
        return practised, practised.session(load_cost("time"), seed)

    practised, session = opened()
    with pytest.raises(ModelError, match="Practise first"):
        practised.accept(session)
    session.step()
    assert session.folder == library.path / "practice" / TASK / "practice_00"
    assert len(opened()[1].tried) == 1
    assert opened(seed=2)[1].folder.name == "practice_01"
    practised, session = opened()
    rng = np.random.default_rng(0)
    for _ in range(12):
        point = 0.3 * rng.normal(size=practised.practice.space.n_axes)
        session.keep(point, float(point @ point), "", {})
    before = library.model_path.read_bytes()
    assert practised.accept(session).action == "improve"
    assert library.model_path.read_bytes() != before
    with pytest.raises(ModelError, match="Practise again"):
        practised.accept(session)
    assert opened()[1].folder.name == "practice_01"
    told = [one.what for one in skill_history(read_history(library.path), [])[TASK]]
    assert told == ["the first model", "improved by practice_00"]
    library.undo()
    assert library.model_path.read_bytes() == before
    assert (library.path / "undone" / TASK / "practice_00" / "practice.json").exists()
    assert TaskFolder(library.path, DOFS).history()[-1].action == "undo"


def test_what_cannot_be_practised_is_refused_by_name(trained, library):
    with pytest.raises(ArgumentError, match="teach it first"):
        TaskPractice(trained, DOFS, "juggle")
    other = replace(trained.library, controlled_names=("a", "b"))
    with pytest.raises(ArgumentError, match="--robot"):
        TaskPractice(replace(trained, library=other), DOFS, TASK)
    with pytest.raises(ArgumentError, match="tracked position"):
        TaskPractice(trained, make_dofs(GLOVE), TASK)
    with pytest.raises(ModelError, match="the model that was practised"):
        library.improve(TASK, library.path, RuleChange(np.zeros((1, 1)), np.zeros(1)), "models/9")
