# SPDX-License-Identifier: Apache-2.0
"""`import intent_recognition as ir`: quick, light, and every name is there and documented."""

import inspect
import re
from dataclasses import replace
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from programs import python_says

import intent_recognition as ir
from intent_recognition.model import Model
from intent_recognition.model.array_dofs import dofs_of_arrays

ROOT = Path(__file__).resolve().parents[1]
ERRORS = [name for name in ir.__all__ if name.endswith("Error")]
FUNCTIONS = [name for name in ir.__all__ if inspect.isfunction(getattr(ir, name))]
CLASSES = [name for name in ir.__all__ if inspect.isclass(getattr(ir, name)) and name not in ERRORS]


def test_the_root_alone_loads_no_room():
    code = "import sys, intent_recognition; print(*[m for m in sys.modules if m[:6] == 'intent'])"
    assert set(python_says(code).split()) == {"intent_recognition"}


def test_all_is_sorted_and_what_the_stub_takes():
    stub = (ROOT / "intent_recognition" / "__init__.pyi").read_text(encoding="utf-8")
    listed = re.findall(r"^from \.\w+ import (\w+) as \1$", stub, re.MULTILINE)
    assert len(listed) == stub.count("import ")
    assert sorted(listed) == sorted(ir.__all__) == sorted(set(dir(ir)))


@pytest.mark.parametrize("name", CLASSES)
def test_every_class_documents_its_attributes(name):
    kind = getattr(ir, name)
    fields = getattr(kind, "__dataclass_fields__", None) or getattr(kind, "_fields", ())
    text = inspect.getdoc(kind)
    for field in fields:
        if not field.startswith("_"):
            assert re.search(rf"\b{field}\b", text), field


@pytest.mark.parametrize("name", FUNCTIONS + CLASSES)
def test_help_names_the_types_of_arrays_and_the_names_can_be_resolved(name):
    thing = getattr(ir, name)
    for own in (thing, *filter(inspect.isfunction, vars(thing).values())):
        if own.__module__.startswith("intent_recognition"):  # else of dataclass or NamedTuple
            assert "numpy" not in str(inspect.signature(own))
            get_type_hints(own)


@pytest.fixture(scope="module")
def demonstrations():
    """Eight recordings of two tasks, of five DOFs in three units."""
    rng, times_s = np.random.default_rng(3), np.linspace(0.0, 2.0, 101)
    way = np.clip(times_s - 0.4, 0.0, 1.0)
    way = (way**3 * (10.0 - 15.0 * way + 6.0 * way**2))[:, None]
    return [
        ir.Demonstration.from_arrays(
            times_s,
            way * (goal + 0.03 * rng.normal(size=3)) + 1e-3 * rng.normal(size=(101, 3)),
            way * (goal[:2] + 0.03 * rng.normal(size=2)),
            task=task,
            name=f"{task}_{k}",
        )
        for task, goal in (("left", np.array([0.5, 0.4, 0.1])), ("right", np.array([0.5, -0.4, 0])))
        for k in range(4)
    ]


@pytest.fixture(scope="module")
def learned(demonstrations):
    """What is learned from them and from one of other DOFs, and the warning of this one."""
    human, robot = demonstrations[0].observed[0], demonstrations[0].controlled[0]
    times_s = human.seconds(human.stamps_ns[0])
    odd = ir.Demonstration.from_arrays(times_s, human.values[:, :2], robot.values, task="left")
    with pytest.warns(UserWarning, match="left out") as warned:
        return ir.learn([*demonstrations, odd], ir.TrainingSettings(switching=False)), warned


@pytest.fixture(scope="module")
def library(learned):
    return learned[0]


def test_what_was_learned_from_arrays_is_saved_and_read(library, demonstrations, tmp_path):
    ir.save_model(tmp_path / "tasks.npz", library)
    model = ir.load_model(tmp_path / "tasks.npz")
    assert [entry.topic for entry in model.dofs.recorded] == ["human", "robot"]
    (human,) = demonstrations[0].observed
    ours, theirs = (ir.IntentEstimator(one) for one in (library, model.library))
    tasks = set()
    for time_s, row in zip(human.seconds(human.stamps_ns[0]), human.values, strict=True):
        before, after = ours.observe(1.0 + time_s, row), theirs.observe(1.0 + time_s, row)
        assert np.array_equal(before.probabilities, after.probabilities)
        tasks.add(after.task)
    assert tasks == {"none", "left"}


def test_names_that_two_dofs_have_are_not_saved(library, tmp_path):
    names = ("a", "b", "c")
    library = replace(library, observed_names=names, controlled_names=names[:2])
    with pytest.raises(ir.DofError, match="twice a, b"):
        ir.save_model(tmp_path / "tasks.npz", library)


def test_what_is_left_out_while_learning_is_a_warning(learned):
    (warning,) = learned[1]
    assert str(warning.message).startswith("1 of 9 demonstrations are left out: demonstration_8")


def test_things_are_shown_on_one_line(library):
    assert repr(library) == (
        "<TaskLibrary: left (4 demonstrations), right (4 demonstrations);"
        f" 3 observed and 2 controlled DOFs, {library.basis.n_basis} basis functions each>"
    )
    labels = tuple(f"task_{k}" for k in range(7))
    many = replace(library, labels=labels, n_demonstrations=(4,) * 7)
    assert "task_4 (4 demonstrations) and 2 more; 3 observed" in repr(many)
    assert repr(ir.IntentEstimator(library)) == "<IntentEstimator of left, right: at rest>"
    model = Model(library, dofs_of_arrays(library))
    assert repr(model) == "<Model of left, right: observes human, controls robot>"
    model = Model(library, replace(model.dofs, controlled=()))
    assert repr(model) == "<Model of left, right: observes human, controls nothing>"
    estimate = ir.Estimate.idle(1_500_000_000, ("left", "right", "none"))
    assert repr(estimate) == "<Estimate at 1.500 s: at rest>"
    probabilities, phase = np.array([0.04, 0.95, 0.01]), np.array([0.2, 0.3, 0.0])
    moving = estimate._replace(moving=True, probabilities=probabilities, phase=phase)
    assert str(moving) == "<Estimate at 1.500 s: right, probability 0.950, phase 0.30>"


def test_what_holds_arrays_is_shown_on_one_line(library, demonstrations):
    primitive = library.primitive(0)
    ahead = primitive.predict_controlled(30)
    assert repr(ahead) == (
        "Trajectory(times_s=array (30,), positions=array (30, 2), velocities=array (30, 2),"
        " std=array (30, 2))"
    )
    assert str(primitive).startswith(f"InteractionProMP(basis={library.basis}, weights=Gaussian")
    assert "noise_variance=array (5,)" in str(primitive)
    estimator = ir.IntentEstimator(library)
    for k, row in enumerate(demonstrations[0].observed[0].values[:60]):
        estimate = estimator.observe(0.02 * k, row)
    shown = estimator.predict_controlled(), estimator.explain(), estimate.posterior
    assert str(shown[0]).startswith("Prediction(task='left', onset_ns=")
    assert str(shown[1]).startswith("Evidence(task='left', rival='")
    assert all("\n" not in repr(one) and len(repr(one)) < 600 for one in shown)


@pytest.mark.parametrize(
    "fold", [([0, 1], [9]), ([0, -1], [2]), ([True, False], [1]), ([0.0], [1])]
)
def test_an_index_of_no_demonstration_is_named(fold, demonstrations):
    with pytest.raises(
        ir.ArgumentError, match=r"protocol\[1\]: expected a whole number from 0 to 7"
    ):
        ir.evaluate(demonstrations, [([0, 1, 4, 5], [2]), fold])


def test_a_misspelt_label_is_a_warning(demonstrations):
    odd = replace(demonstrations[-1], task="rihgt", name="odd")
    with pytest.warns(UserWarning, match="odd: 1 with the task rihgt, 3 with right. Did you mean"):
        ir.learn([*demonstrations[:-1], odd], ir.TrainingSettings(switching=False))


def test_a_demonstration_in_another_frame_is_a_warning(demonstrations):
    """Four others are enough to know where the task is."""
    one = demonstrations[0]
    others = [replace(one, name=f"more_{k}") for k in range(3)]
    (human,) = one.observed
    odd = replace(one, name="odd", observed=(replace(human, values=human.values + 2.0),))
    with pytest.warns(UserWarning, match=r"odd: .* Likely another frame, 3.5 m away"):
        ir.learn([*demonstrations, *others, odd], ir.TrainingSettings(switching=False))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda _: ir.IntentEstimator("m.npz"), "library: expected a TaskLibrary, got one of type"),
        (lambda _: ir.read_demonstrations("bags", "dofs.yaml"), "dofs: expected a DofSpec, got"),
        (lambda _: ir.save_model("m.npz", "library"), "model: expected a Model, got one of type"),
        (lambda one: ir.IntentEstimator(one).observe(1.7e18, [0, 0, 0]), "divide them by 1e"),
        (lambda _: ir.TrainingSettings(n_basis=12.5), "n_basis, width: .* got 12.5"),
        (lambda _: ir.learn([], {"n_basis": 20}), "settings: expected a TrainingSettings, got one"),
        (lambda _: ir.TrainingSettings(ridge=0.0), "ridge: expected a positive number"),
        (lambda _: ir.TrainingSettings(ridge="a"), "ridge: expected a positive number, got a"),
        (lambda _: ir.TrainingSettings(none_prior=None), "none_prior: expected a probability"),
        (
            lambda one: ir.IntentEstimator(one, n_scales=2.5),
            "n_scales: expected a whole .* got 2.5",
        ),
        (lambda one: ir.IntentEstimator(one).observe(0, [0], dofs=3), "dofs: expected different"),
        (
            lambda one: ir.IntentEstimator(one).observe_controlled(0, [0], signal=-1),
            "signal: expected a whole number from 0 to 1, got -1",
        ),
        (
            lambda one: one.primitive("left"),
            "task: expected a whole number from 0 to 1, got 'left'",
        ),
        (
            lambda _: ir.decision_settings(None),
            "library: expected a TaskLibrary, got one of type No",
        ),
        (lambda one: ir.decision_settings(one, "5 %"), "max_wrong: expected a share .* got '5 %'"),
        (lambda _: ir.DecisionSettings(threshold="0.9"), "threshold: .* got '0.9'"),
        (lambda _: ir.DecisionSettings(n_observations=2.5), "n_observations: .* got 2.5"),
        (
            lambda one: ir.evaluate(one),
            "demonstrations: expected a list of Demonstration, got Task",
        ),
        (lambda _: ir.evaluate("bags"), r"demonstrations\[0\]: expected a Demonstration, got str"),
        (lambda _: ir.evaluate([], settings={}), "settings: expected a TrainingSettings, got one"),
        (lambda _: ir.evaluate([], None), "protocol: expected loo, .* or pairs .* got None"),
        (lambda _: ir.make_folds([], None), "protocol: expected loo, .* got None"),
        (lambda _: ir.cut_to_movement(None), "demonstrations: expected a list of Demonstration"),
        (lambda one: ir.fit_interaction_promp(one), "demonstrations: expected a list of Demonstr"),
        (lambda _: ir.learn_mixture(None), "demonstrations: expected a list of Demonstration"),
        (
            lambda _: ir.load_model(None),
            "path: expected a path, got one of type NoneType. Pass the path",
        ),
        (lambda one: ir.save_model(None, one), "path: expected a path, got one of type NoneType"),
        (lambda _: ir.load_dofs(3), "path: expected a path, got one of type int"),
        (lambda _: ir.BagReader(None), "path: expected a path, got one of type NoneType"),
        (lambda _: ir.load_object(None), "path: expected a path, got one of type NoneType"),
    ],
)
def test_arguments_of_another_kind_are_named(call, says, library):
    with pytest.raises(ir.ArgumentError, match=says):
        call(library)
