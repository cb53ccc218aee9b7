# SPDX-License-Identifier: Apache-2.0
"""Other units than metres and radians: how large they are makes no difference."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from intent_recognition.errors import TrainingError
from intent_recognition.learning import TrainingSettings, learn, learn_with_report
from intent_recognition.learning.correcting import keep_correction
from intent_recognition.learning.preprocessing import other_units_of
from intent_recognition.learning.training import add_demonstration
from intent_recognition.promp import controlled_spread, end_std_limits, weight_floor
from intent_recognition.recognition import DecisionState, IntentEstimator, decide, decision_settings
from intent_recognition.recognition.start_posture import (
    START_STD,
    start_mean,
    start_variance,
    within_trained_starts,
)
from intent_recognition.signals import Demonstration, Signal, commensurate, merge

OTHER = 1e-3
SCALES = (OTHER, 1.0)
TASKS = ("give", "hold", "press")
MS = 1_000_000
SETTINGS = TrainingSettings(n_basis=8, n_aligned_basis=8, segmentation="movement")


def perform(task: int, seed: int) -> Demonstration:
    """A reach seen by a tracker [m] and a camera [px], a robot's joints [rad] and its wrench [N].

    The last number of the wrench is 5 throughout.
    """
    rng = np.random.default_rng([task, seed])
    duration_s = 2.0 * np.exp(0.08 * rng.normal())
    times_s = np.arange(0.0, duration_s + 1.0, 0.04)
    z = np.clip((times_s - 0.5) / duration_s, 0.0, 1.0)
    reach = (10 * z**3 - 15 * z**4 + 6 * z**5)[:, None]
    bump = (16.0 * z**2 * (1 - z) ** 2)[:, None]
    goal = np.array([[0.4, 0.1, 0.2], [0.3, 0.4, 0.1], [0.1, 0.3, 0.4]])[task]
    goal = goal + 0.03 * rng.normal(size=3)
    side = np.array([0.1, -0.1, 0.05]) * (task - 1)
    wrist = reach * goal + bump * side
    pixels = np.array([320.0, 240.0]) + wrist[:, :2] * 600.0 + 0.5 * rng.normal(size=(len(z), 2))
    wrist = wrist + 5e-4 * rng.normal(size=wrist.shape)
    joints = reach * np.array([0.8, -0.5]) * (goal[:2] + 0.5) + 1e-3 * rng.normal(size=(len(z), 2))
    force = (
        0.3 * rng.normal() + reach * 20.0 * (goal[2] + 0.4) + 0.05 * rng.normal(size=reach.shape)
    )
    wrench = np.hstack([force, np.full_like(force, 5.0)])
    stamps_ns = 1_000 * MS + np.round(times_s * 1e9).astype(np.int64)
    return Demonstration(
        name=f"{TASKS[task]}_{seed}",
        observed=(
            Signal(("x", "y", "z"), stamps_ns, wrist, "m"),
            Signal(("u", "v"), stamps_ns + 3 * MS, pixels, "px"),
        ),
        controlled=(
            Signal(("j1", "j2"), stamps_ns, joints, "rad"),
            Signal(("fx", "fy"), stamps_ns, wrench, "N"),
        ),
        start_ns=int(stamps_ns[0]),
        end_ns=int(stamps_ns[-1]),
        task=TASKS[task],
        source="simulated",
    )


def scaled(recorded: Demonstration, factor: float, chosen) -> Demonstration:
    """The same with the signals that `chosen` says in another unit."""
    sides = (
        tuple(replace(s, values=s.values * factor) if chosen(s) else s for s in side)
        for side in (recorded.observed, recorded.controlled)
    )
    return replace(recorded, **dict(zip(("observed", "controlled"), sides, strict=True)))


def in_other_units(recorded: Demonstration, scale: float) -> Demonstration:
    """The same measured in other units than pixels and newtons."""
    return scaled(recorded, scale, lambda signal: signal.unit in ("px", "N"))


def learned(scale: float, tasks=TASKS):
    recordings = [
        in_other_units(perform(k, seed), scale) for k in range(len(tasks)) for seed in range(5)
    ]
    return learn_with_report(recordings, SETTINGS).trained


@pytest.fixture(scope="module")
def trained():
    return {scale: learned(scale) for scale in SCALES}


def factors(library, scale):
    """What each DOF is multiplied by, (D,)."""
    return np.where(np.isin(library.units, ("px", "N")), scale, 1.0)


def follow(library, recorded):
    """Probabilities, phases, decisions and ends along a recording."""
    estimator, settings = IntentEstimator(library), decision_settings(library)
    state, seen = DecisionState(), []
    for observation in merge((*recorded.observed, *recorded.controlled)):
        if observation.group >= 2:
            estimator.update_controlled(observation._replace(group=observation.group - 2))
            continue
        estimate = estimator.update(observation)
        state, active = decide(
            settings,
            state,
            estimate.labels,
            estimate.probabilities,
            estimator.predicted_end_std(),
            estimate.log_evidence,
        )
        prediction = estimator.predict_controlled(5)
        start, end = (
            (prediction.start, prediction.trajectory.positions[-1]) if prediction else ("", 0)
        )
        seen.append((estimate.probabilities, estimate.phase, active, start, end))
    return [list(part) for part in zip(*seen, strict=True)]


@pytest.mark.slow
def test_another_unit_changes_nothing_learned_nor_any_probability_decision_or_correction(trained):
    library, other = trained[1.0].library, trained[OTHER].library
    assert other.none_margin == pytest.approx(library.none_margin, rel=1e-6)
    assert other.switch_margin == pytest.approx(library.switch_margin, rel=1e-6)
    assert trained[OTHER].chosen[:2] == trained[1.0].chosen[:2]
    by = factors(library, OTHER)[library.n_observed :]
    recorded = perform(1, 77)
    p, phase, active, start, end = follow(library, recorded)
    p2, phase2, active2, start2, end2 = follow(other, in_other_units(recorded, OTHER))
    np.testing.assert_allclose(p2, p, atol=1e-6)
    np.testing.assert_allclose(phase2, phase, atol=1e-6)
    assert (active2, start2) == (active, start)
    assert TASKS[1] in active
    np.testing.assert_allclose(end2[-1] / by, end[-1], rtol=1e-5, atol=1e-7)
    by = np.repeat(factors(library, OTHER), library.basis.n_basis)
    n = library.n_observed_weights
    for name, expected, one in (("mean", by, 1), ("covariance", np.outer(by, by), 2)):
        for prefix, size in (("weight", len(by)), ("none", n)):
            cut = (..., *[slice(size)] * one)
            found = getattr(other, f"{prefix}_{name}") / expected[cut]
            wanted = getattr(library, f"{prefix}_{name}")
            np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-9 * np.abs(wanted).max())
    corrected = perform(1, 50)
    one = keep_correction(trained[1.0], corrected).library
    other = keep_correction(trained[OTHER], in_other_units(corrected, OTHER)).library
    by = np.repeat(factors(one, OTHER), one.basis.n_basis)
    np.testing.assert_allclose(other.weight_mean / by, one.weight_mean, rtol=1e-6, atol=1e-7)


@pytest.mark.slow
def test_the_same_where_there_is_one_task_and_unknown_movements_are_simulated():
    one, other = (learned(scale, TASKS[:1]).library for scale in (1.0, 1e3))
    assert one.none_margin > 0.0
    assert other.none_margin == pytest.approx(one.none_margin, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("scale", SCALES)
def test_a_wrench_biased_as_in_training_is_not_outside(trained, scale):
    library = trained[scale].library
    for task in range(library.n_tasks):
        start, newton = start_mean(library, task), np.array([0.0, 0.0, scale, 0.0])
        assert within_trained_starts(library, task, start + 0.3 * newton)
        assert within_trained_starts(library, task, start - 0.6 * newton)
        assert not within_trained_starts(library, task, start + 15.0 * newton)


@pytest.mark.slow
def test_metres_and_radians_keep_their_constants_and_go_together(trained):
    library = trained[1.0].library
    in_metres = replace(library, controlled_units=("rad", "m", "N", "N"))
    std = np.sqrt(start_variance(in_metres))
    assert tuple(std[:2]) == (START_STD["rad"], START_STD["m"])
    assert std[2] == std[3] > START_STD["m"]
    limits = end_std_limits(library)
    spread = controlled_spread(library)[2]
    assert all(0.5 * spread <= limit["N"] < 3.0 * spread for limit in limits.values())
    groups = commensurate(("m", "px", "rad", "N", "px"))
    assert sorted(map(tuple, groups)) == [(0, 2), (1, 4), (3,)]
    assert [list(group) for group in commensurate(("rad", "m"))] == [[0, 1]]


@pytest.mark.parametrize("scale", [*SCALES, 1e3])
def test_the_floor_of_a_dof_that_never_moved_has_the_scale_of_its_unit(scale):
    weights = np.zeros((2, 4, 3))
    weights[1, 0], weights[:, 3] = 10.0, 4.0
    floor = np.sqrt(weight_floor(scale * weights, ("N", "N", "m", "px")))
    np.testing.assert_allclose(floor, [scale * 0.01, scale * 0.01, 1e-3, scale * 4e-3])
    np.testing.assert_allclose(np.sqrt(weight_floor(weights))[[1, 2, 3]], 1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "factor"), [("j1", np.degrees(1.0)), ("x", 100.0)])
def test_a_recording_in_another_unit_is_named_or_refused(trained, name, factor):
    """Joints that turn by less than what only degrees could be; a hand in centimetres."""
    odd = scaled(perform(0, 9), factor, lambda signal: signal.names[0] == name)
    with pytest.warns(UserWarning, match=f"give_9: {name} .*a factor of {factor:.4g}"):
        learn([perform(0, 0), perform(0, 1), odd, perform(0, 2)], SETTINGS)
    with pytest.raises(TrainingError, match=f"give_9: {name} .*a factor of {factor:.4g}"):
        add_demonstration(trained[1.0], odd)
    assert add_demonstration(trained[1.0], perform(0, 9)).tasks["give"].n == 6


def test_of_several_signals_the_one_in_another_unit_is_named(rng):
    signals = SimpleNamespace(observed=[(("a", "b"), "m"), (("c", "d"), "m")], controlled=[])
    examples = []
    for name in ("one", "two", "three", "in mm"):
        values = 0.5 + 0.2 * rng.normal(size=(20, 4))
        values[:, 2:] *= 1000.0 if name == "in mm" else 1.0
        examples.append(SimpleNamespace(name=name, observed=values, controlled=values))
    tasks = {"task": SimpleNamespace(examples=examples)}
    (found,) = other_units_of(tasks, tasks, signals)
    assert found.name == "in mm" and "c is in numbers" in found.reason
