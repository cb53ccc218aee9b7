# SPDX-License-Identifier: Apache-2.0
"""The rehearsal against a plain loop over demonstrations, and what it decides."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import START_NS, minimum_jerk

from intent_recognition.filtering.phase_deviation_filter import PhaseDeviationFilter
from intent_recognition.gaussian.normal import Gaussian, condition
from intent_recognition.learning.accumulation import Accumulated, accumulate
from intent_recognition.learning.examples import sample_phases, scored_phases
from intent_recognition.learning.fitting import (
    aligned_primitives,
    library_from_statistics,
)
from intent_recognition.learning.held_out_validation import AlignedCandidate, validate_held_out
from intent_recognition.learning.selection import FRACTIONS, Hyperparameters
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.statistics import (
    TaskStatistics,
    aligned_statistics,
    pooled_moments,
    variance_scales,
)
from intent_recognition.learning.training import choose
from intent_recognition.promp.aligned import AlignedPrimitives
from intent_recognition.promp.phase_deviation import reference_phase
from intent_recognition.promp.prior import Scatter, shrunk_covariance, structured_target
from intent_recognition.signals.demonstration import Demonstration
from intent_recognition.signals.signal import Signal

SETTINGS = TrainingSettings(n_basis=8, n_aligned_basis=10, segmentation="recording")
CHOSEN = Hyperparameters(
    10.0, 4.0, 0.0, aligned=True, aligned_strength=20.0, aligned_noise_scale=4.0
)


def a_recording(
    rng: np.random.Generator, task: int, number: int, timing: float, space: float
) -> Demonstration:
    """Human and robot reach and swing, displaced alike, at a pace whose logarithm varies."""
    recorded = np.linspace(0.0, 1.0, 81)
    pace = np.interp(recorded, np.linspace(0.0, 1.0, 8), rng.normal(size=8))
    passed = np.cumsum(np.exp(timing * pace))
    phase = (passed - passed[0]) / (passed[-1] - passed[0])
    size = 1.0 + space * rng.normal()
    swing = np.sin((3 + task) * np.pi * phase)
    human = np.stack([size * minimum_jerk(phase), size * swing, phase * (task - 1)], axis=1)
    robot = np.stack([size * swing + minimum_jerk(phase), np.cos(4 * np.pi * phase)], axis=1)
    stamps = START_NS + np.round(recorded * 2e9).astype(np.int64)
    human, robot = (part + 0.01 * rng.normal(size=part.shape) for part in (human, robot))
    return Demonstration(
        f"{task}_{number}",
        "",
        f"task_{task}",
        (Signal(("x", "y", "z"), stamps, human, "m"),),
        (Signal(("q", "r"), stamps, robot, "rad"),),
        START_NS,
        int(stamps[-1]),
    )


def accumulated(
    seed: int, counts=(5, 3, 2, 1), timing=0.5, space=0.1, settings=SETTINGS
) -> Accumulated:
    rng = np.random.default_rng(seed)
    recordings = [
        a_recording(rng, task, number, timing, space)
        for task, n in enumerate(counts)
        for number in range(n)
    ]
    return accumulate(recordings, settings)


def without(
    task: TaskStatistics, pooled: Scatter, index: int, strength: float, floor: np.ndarray
) -> Gaussian:
    """The primitive of a task as all its other demonstrations give it."""
    weights = np.array([e.weights.ravel() for e in task.examples])
    rest = np.delete(weights, index, axis=0)
    both = [(w - w.mean(axis=0)) for w in (weights, rest)]
    whole, part = (w.T @ w for w in both)
    others = Scatter(pooled.matrix - whole + part, pooled.freedom - 1)
    target = structured_target(Scatter(part, len(rest) - 1), others, floor).covariance()
    return Gaussian(rest.mean(axis=0), shrunk_covariance(part, len(rest), target, strength))


def plain_loop(
    primitives: AlignedPrimitives,
    tasks: dict[str, TaskStatistics],
    recorded: dict[str, TaskStatistics],
    strength: float,
    floor: np.ndarray,
    predict,
) -> float:
    pooled = pooled_moments(tasks.values())
    truths = np.concatenate([e.controlled for t in recorded.values() for e in t.examples])
    errors = []
    for label, task in tasks.items():
        if task.n < 2:
            continue
        for index, example in enumerate(recorded[label].examples):
            primitive = without(task, pooled, index, strength, floor)
            for share in FRACTIONS:
                n = int(np.sum(sample_phases() <= share))
                found = predict(primitives, primitive, example.observed[:n])
                errors.append((found - example.controlled) ** 2 / truths.var(axis=0))
    return float(np.mean(errors))


def jointly(primitives: AlignedPrimitives, primitive: Gaussian, seen: np.ndarray) -> np.ndarray:
    """Steady progress: all samples conditioned on in one step."""
    n_dofs, n_observed = len(primitives.noise_variance), primitives.n_observed
    rows = primitives.basis.design_matrix(sample_phases()[: len(seen)])
    matrix = np.vstack([np.kron(np.eye(n_dofs)[:n_observed], row) for row in rows])
    noise = np.tile(primitives.noise_variance[:n_observed] * primitives.noise_scale, len(seen))
    after, _ = condition(primitive, matrix, seen.ravel(), np.diag(noise))
    controlled = after.mean.reshape(n_dofs, -1)[n_observed:]
    return primitives.basis.design_matrix(scored_phases()) @ controlled.T


def with_deviations(
    primitives: AlignedPrimitives, primitive: Gaussian, seen: np.ndarray
) -> np.ndarray:
    """One demonstration in a filter of its own; the controlled weights by regression."""
    size = primitives.n_observed_weights
    own = replace(
        primitives, weight_mean=primitive.mean[None], weight_covariance=primitive.covariance[None]
    )
    mean, covariance = primitive.mean[:size], primitive.covariance[:size, :size]
    run = PhaseDeviationFilter(own, mean, covariance, np.ones(1))
    noise = np.diag(primitives.noise_variance[: primitives.n_observed] * primitives.noise_scale)
    for phase, values in zip(sample_phases(), seen, strict=False):
        run.observe(float(phase), np.arange(primitives.n_observed), values, noise)
    matrix, offset, _ = own.regressions[0]
    controlled = (matrix @ run.mean[0] + offset).reshape(primitives.n_controlled, -1)
    deviation, found = run.deviations_at(scored_phases())[0], []
    for share, phase in zip(deviation, scored_phases(), strict=True):
        design = primitives.basis.design_matrix(
            reference_phase(primitives.phase_deviation, np.array(phase))
        )
        found.append(share @ design @ controlled.T)
    return np.array(found)


def test_at_steady_progress_it_equals_a_loop_of_joint_conditioning():
    data = accumulated(1)
    steady = library_from_statistics(data.tasks, data.preprocessing, CHOSEN._replace(aligned=False))
    floor, _ = variance_scales(data.tasks)
    arguments = steady.primitives, data.tasks, data.tasks, CHOSEN.strength, floor
    expected = plain_loop(*arguments, jointly)
    assert 0.0 < expected < 1.0
    tried = [AlignedCandidate(steady.primitives, CHOSEN.strength)]
    assert validate_held_out(tried, data.tasks, data.tasks, floor) == pytest.approx(
        [expected], rel=1e-6
    )


def test_with_deviations_it_equals_a_loop_of_filters():
    data = accumulated(2, counts=(4, 2, 1))
    tasks = aligned_statistics(data.tasks)
    primitives = aligned_primitives(data.tasks, data.preprocessing, CHOSEN)
    floor, _ = variance_scales(tasks)
    noisy = replace(primitives, noise_scale=16.0)
    tried = [AlignedCandidate(f, s) for s in (20.0, 5.0) for f in (primitives, noisy)]
    expected = [plain_loop(f, tasks, data.tasks, s, floor, with_deviations) for f, s in tried]
    assert 0.0 < min(expected) < max(expected) < 1.0
    assert len(set(expected)) == len(expected)
    assert validate_held_out(tried, tasks, data.tasks, floor) == pytest.approx(expected, rel=1e-6)


def test_what_the_primitives_have_learned_of_the_one_left_out_does_not_matter():
    data = accumulated(3)
    primitives = aligned_primitives(data.tasks, data.preprocessing, CHOSEN)
    blank = replace(primitives, weight_mean=0 * primitives.weight_mean, weight_covariance=None)
    tasks = aligned_statistics(data.tasks)
    floor, _ = variance_scales(tasks)
    tried = [AlignedCandidate(f, 10.0) for f in (primitives, blank)]
    one, other = validate_held_out(tried, tasks, data.tasks, floor)
    assert one == other


def test_without_a_second_demonstration_there_is_nothing_to_rehearse():
    data = accumulated(4, counts=(2, 1))
    alone = {"task_1": data.tasks["task_1"]}
    floor, _ = variance_scales(data.tasks)
    steady = library_from_statistics(data.tasks, data.preprocessing, CHOSEN._replace(aligned=False))
    tried = [AlignedCandidate(steady.primitives, 10.0)]
    assert validate_held_out(tried, alone, alone, floor) == [np.inf]


LEARNING = TrainingSettings(n_basis=20, n_aligned_basis=20, segmentation="recording")


@pytest.mark.parametrize("seed", [1, 2])
def test_people_of_varying_timing_are_predicted_from_aligned_primitives(seed):
    data = accumulated(seed, (8, 8), timing=0.5, space=0.1, settings=LEARNING)
    chosen, _ = choose(data.tasks, data.preprocessing)
    assert chosen.aligned


@pytest.mark.parametrize("seed", [1, 2])
def test_people_who_keep_the_pace_are_predicted_from_steady_primitives(seed):
    data = accumulated(seed, (8, 8), timing=0.0, space=0.1, settings=LEARNING)
    chosen, _ = choose(data.tasks, data.preprocessing)
    assert not chosen.aligned
