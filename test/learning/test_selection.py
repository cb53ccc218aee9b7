# SPDX-License-Identifier: Apache-2.0
"""Held-out validation: truly without the demonstration, against a plain loop, and its choice."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import make_interp_spline
from simulation import demonstration_of, minimum_jerk

from intent_recognition.gaussian.normal import Gaussian, condition
from intent_recognition.learning import (
    PACES,
    Accumulated,
    accumulate,
    held_out,
    held_out_examples,
    selection,
)
from intent_recognition.learning.evidence_exponents import POWERS
from intent_recognition.learning.examples import TrainingExample, sample_phases, scored_phases
from intent_recognition.learning.fitting import library_from_statistics, statistics_of
from intent_recognition.learning.held_out_examples import leave_out
from intent_recognition.learning.hyperparameters import (
    INDEPENDENT,
    REGRESSION_STRENGTHS,
    RIDGES,
    STRENGTH,
    STRONG,
    Hyperparameters,
)
from intent_recognition.learning.selection import FRACTIONS, NOISE_SCALES, choose, validate
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.statistics import summarize
from intent_recognition.learning.training import choose_hyperparameters
from intent_recognition.promp import STEADY, Scatter, TargetSettings
from intent_recognition.promp.prior import OBSERVED_INDEPENDENT, structured_target, weight_floor
from intent_recognition.signals import Demonstration

SETTINGS = TrainingSettings(n_basis=8, n_aligned_basis=10, segmentation="recording")
LEARNING = TrainingSettings(n_basis=20, n_aligned_basis=20, segmentation="recording")
P, Q, N = 2, 1, 4
UNITS = ("m", "m", "m", "rad", "rad")


def a_recording(rng, task: int, number: int, timing: float, space: float) -> Demonstration:
    """Human and robot reach and swing, displaced alike, at a pace whose logarithm varies."""
    even = np.linspace(0.0, 1.0, 81)
    pace = np.interp(even, np.linspace(0.0, 1.0, 8), rng.normal(size=8))
    passed = np.cumsum(np.exp(timing * pace))
    phase = (passed - passed[0]) / (passed[-1] - passed[0])
    size = 1.0 + space * rng.normal()
    swing = np.sin((3 + task) * np.pi * phase)
    human = np.stack([size * minimum_jerk(phase), size * swing, phase * (task - 1)], axis=1)
    robot = np.stack([size * swing + minimum_jerk(phase), np.cos(4 * np.pi * phase)], axis=1)
    human, robot = (part + 0.01 * rng.normal(size=part.shape) for part in (human, robot))
    return demonstration_of(2.0 * even, human, robot, f"{task}_{number}", f"task_{task}")


def accumulated(
    seed: int, counts=(5, 3, 2, 1), timing=0.5, space=0.1, options=SETTINGS
) -> Accumulated:
    rng = np.random.default_rng(seed)
    recordings = [
        a_recording(rng, task, number, timing, space)
        for task, n in enumerate(counts)
        for number in range(n)
    ]
    return accumulate(recordings, options)


def examples(seed: int, counts: list[int]) -> list[list[TrainingExample]]:
    """Demonstrations of random weights; the samples do not matter."""
    rng = np.random.default_rng(seed)
    observed, controlled = np.zeros((len(sample_phases()), P)), np.zeros((3, Q))
    found = []
    for k, n in enumerate(counts):
        drawn = rng.normal(size=(P + Q, N)) + 0.3 * rng.normal(size=(n, P + Q, N))
        rest = np.ones(P + Q), 1.0, observed, controlled
        found.append(
            [TrainingExample(f"{k}_{i}", f"task_{k}", w, *rest) for i, w in enumerate(drawn)]
        )
    return found


def scatter_of(tasks: list[np.ndarray]) -> Scatter:
    """Of the weights (n, d) of each task about their means."""
    about = [weights - weights.mean(axis=0) for weights in tasks if len(weights)]
    return Scatter(sum(w.T @ w for w in about), sum(len(w) - 1 for w in about))


@pytest.mark.usefixtures("usually_left_out")
@settings(max_examples=25)
@given(
    st.integers(0, 2**32 - 1),
    st.lists(st.integers(1, 5), min_size=1, max_size=4).filter(lambda n: sum(n) - len(n) > 1),
    st.sampled_from(REGRESSION_STRENGTHS),
    st.sampled_from(INDEPENDENT),
    st.sampled_from([0.0, 0.1]),
)
def test_leaving_one_out_equals_never_having_seen_it(seed, counts, strength, independent, lag):
    """Mean, shared covariance and regression are those of the other demonstrations."""
    parts = examples(seed, counts)
    tasks = {f"task_{k}": summarize(part) for k, part in enumerate(parts)}
    everything = np.array([example.weights for part in parts for example in part])
    floor = weight_floor(everything)  # its scale alone is that of all of them
    chosen = Hyperparameters(strength=strength, independent=independent, lag=lag)
    found = leave_out(tasks, tasks, UNITS, chosen)
    assert len(found) == sum(n for n in counts if n > 1)
    turns = [
        (k, example)
        for k, label in enumerate(tasks)
        if tasks[label].n > 1
        for example in tasks[label].examples
    ]
    size = P * N
    for one, (k, left_out) in zip(found, turns, strict=True):
        rest = [
            np.array([e.weights.ravel() for e in part if e.name != left_out.name]) for part in parts
        ]
        assert one.task == k
        others = [np.log(e.duration_s) for e in parts[k] if e.name != left_out.name]
        assert one.log_duration == pytest.approx(np.mean(others), abs=1e-9)
        np.testing.assert_allclose(one.mean, rest[k].mean(axis=0), atol=1e-12)
        pooled = scatter_of(rest)
        seen = Scatter(pooled.matrix[:size, :size], pooled.freedom)
        assumed = TargetSettings(independent=OBSERVED_INDEPENDENT)
        target = structured_target(seen, seen, floor[:P], assumed)
        shared = (seen.matrix + STRENGTH * target) / (pooled.freedom + STRENGTH)
        np.testing.assert_allclose(one.covariance, shared, atol=1e-9)
        own = scatter_of([rest[k]])
        target = structured_target(own, pooled, floor, chosen.target(P))
        joint = own.matrix + strength * target
        gain = joint[size:, :size] @ np.linalg.inv(joint[:size, :size])
        np.testing.assert_allclose(one.rule.matrix, gain, rtol=1e-5, atol=1e-6)
        assert sorted(one.rivals) == [other for other in range(len(counts)) if other != k]


def test_rivals_are_nearest_in_what_is_observed(monkeypatch):
    monkeypatch.setattr(held_out_examples, "MAX_RIVALS", 1)
    tasks = {f"task_{k}": summarize(part) for k, part in enumerate(examples(3, [2] * 5))}
    shown = [(k, e) for k, task in enumerate(tasks.values()) for e in task.examples]
    for one, (k, example) in zip(
        leave_out(tasks, tasks, ("m", "px", "rad"), Hyperparameters()), shown, strict=True
    ):
        scale = np.array([[1.0], [1e3]])  # another unit of the second DOF changes nothing
        squares = [(scale * (task.mean - example.weights)[:P]) ** 2 for task in tasks.values()]
        by_dof = np.sum(squares, axis=2)
        by_dof[k] = np.nan
        apart = np.sum(by_dof / np.nanmean(by_dof, axis=0), axis=1)
        assert one.rivals.tolist() == [np.nanargmin(apart)]


def test_two_demonstrations_in_all_leave_the_spread_of_both():
    """Nothing else would be left to learn a covariance from; the mean is the other one's."""
    task = summarize(examples(1, [2])[0])
    found = leave_out({"task_0": task}, {"task_0": task}, UNITS, Hyperparameters())
    for one, other in zip(found, task.examples[::-1], strict=True):
        np.testing.assert_allclose(one.mean, other.weights.ravel(), atol=1e-12)
        assert np.linalg.eigvalsh(one.covariance).min() > 0.0


def by_hand(library, data: Accumulated) -> tuple[np.ndarray, float]:
    """Log losses and relative error at steady progress: all samples conditioned on in one step."""
    floor = weight_floor(np.array([e.weights for t in data.tasks.values() for e in t.examples]))
    n_observed, size = library.n_observed, library.n_observed_weights
    weights = [{e.name: e.weights.ravel() for e in task.examples} for task in data.tasks.values()]
    held = [e for task in data.tasks.values() if task.n > 1 for e in task.examples]
    variance = np.concatenate([e.controlled[::3] for e in held]).var(axis=0)
    noise = 2.0 * library.noise_scale * library.noise_variance[:n_observed]
    losses, errors = [], []
    for left_out in held:
        rest = [
            np.array([w for name, w in task.items() if name != left_out.name]) for task in weights
        ]
        own, pooled = list(data.tasks).index(left_out.task), scatter_of(rest)
        seen = Scatter(pooled.matrix[:size, :size], pooled.freedom)
        assumed = TargetSettings(independent=OBSERVED_INDEPENDENT)
        target = structured_target(seen, seen, floor[:n_observed], assumed)
        shared = (seen.matrix + STRENGTH * target) / (pooled.freedom + STRENGTH)
        single = scatter_of([rest[own]])
        joint = single.matrix + REGRESSION_STRENGTHS[0] * structured_target(single, pooled, floor)
        gain = np.linalg.solve(joint[:size, :size], joint[:size, size:]).T
        for n in range(1, len(sample_phases()) + 1):
            rows = library.basis.design_matrix(sample_phases()[:n])
            matrix = np.vstack([np.kron(np.eye(n_observed), row) for row in rows])
            evidence = []
            for k, task in enumerate(rest):
                mean = task.mean(axis=0)
                prior = Gaussian(mean[:size], (1.0 + 1.0 / len(task)) * shared)
                after, density = condition(
                    prior, matrix, left_out.observed[:n].ravel(), np.diag(np.tile(noise, n))
                )
                evidence.append(density)
                if k == own and n in [round(share * 60) for share in FRACTIONS]:
                    change = gain @ (after.mean - mean[:size])
                    controlled = (mean[size:] + change).reshape(library.n_controlled, -1)
                    predicted = library.basis.design_matrix(scored_phases()) @ controlled.T
                    errors.append((predicted - left_out.controlled[::3]) ** 2 / variance)
            counted = [power * np.array(evidence) for power in POWERS]
            losses.append([np.logaddexp.reduce(some) - some[own] for some in counted])
    return np.mean(losses, axis=0), float(np.mean(errors))


@pytest.mark.slow
@pytest.mark.parametrize("noise_scale", [1.0, 16.0])
def test_at_steady_progress_it_equals_a_loop_of_joint_conditioning(noise_scale):
    data = accumulated(1, counts=(3, 2, 1), space=0.3)
    library = library_from_statistics(data.tasks, data.preprocessing, Hyperparameters())
    library = replace(
        library, phase_deviation=STEADY, evidence_freedom=np.inf, noise_scale=noise_scale
    )
    left_out = leave_out(data.tasks, data.tasks, UNITS, Hyperparameters())
    losses, errors = validate(library, left_out, data.tasks)
    expected_losses, expected_error = by_hand(library, data)
    # movements of several tasks are hard to tell apart, and to predict
    assert min(*expected_losses, expected_error) > 0.1
    np.testing.assert_allclose(losses.mean(axis=1), expected_losses, rtol=1e-5, atol=1e-7)
    assert errors.mean() == pytest.approx(expected_error, rel=1e-5, abs=1e-7)


def test_a_person_is_left_out_whole_where_others_have_shown_each_task():
    """Each example with its task, and what tasks share, as without all of its person."""
    data = accumulated(2, counts=(6, 6))
    people = {
        label: summarize([e._replace(group="abc"[k % 3]) for k, e in enumerate(task.examples)])
        for label, task in data.tasks.items()
    }
    found = leave_out(people, people, UNITS, Hyperparameters())
    everyone = [example for task in people.values() for example in task.examples]
    for one, example in zip(found, everyone, strict=True):
        rest = {
            label: summarize([e for e in task.examples if e.group != example.group])
            for label, task in people.items()
        }
        np.testing.assert_allclose(one.mean, rest[example.task].mean.ravel())
        means = np.array([task.mean.ravel() for task in rest.values()])
        observed = means[one.rivals, : one.rival_means.shape[1]]
        np.testing.assert_allclose(one.rival_means, observed)
        assert one.log_duration == pytest.approx(rest[example.task].log_duration_mean)
    for few in ([""], "ab"):  # without one of two, nothing would show how people differ
        alone = {
            label: summarize(
                [e._replace(group=few[k % len(few)]) for k, e in enumerate(t.examples)]
            )
            for label, t in people.items()
        }
        found = leave_out(alone, alone, UNITS, Hyperparameters())
        for one, example in zip(found, everyone, strict=True):
            task = people[example.task]
            mean = task.mean - (example.weights - task.mean) / (task.n - 1)
            np.testing.assert_allclose(one.mean, mean.ravel())


def test_neither_batches_nor_very_many_demonstrations_matter(monkeypatch):
    data = accumulated(2, counts=(4, 2, 1))
    library = library_from_statistics(data.tasks, data.preprocessing, Hyperparameters("aligned"))
    tasks = statistics_of(data.tasks, True)
    left_out = leave_out(tasks, data.tasks, UNITS, Hyperparameters())
    whole = validate(library, left_out, tasks)
    monkeypatch.setattr(held_out, "MAX_FLOATS", 1)
    for found, expected in zip(validate(library, left_out, tasks), whole, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    data = accumulated(2, counts=(5, 3, 1))
    monkeypatch.setattr(held_out_examples, "MAX_VALIDATED", 4)
    assert [one.task for one in leave_out(data.tasks, data.tasks, UNITS, Hyperparameters())] == [
        0,
        0,
        1,
        1,
    ]


@pytest.mark.usefixtures("usually_tried")
def test_the_best_of_all_that_were_tried_is_chosen():
    data = accumulated(5, counts=(3, 3))
    chosen, _, tried = choose_hyperparameters(data.tasks, data.preprocessing)
    assert {(one.pace, one.noise_scale) for one in tried} == {
        (pace, scale) for pace in PACES for scale in NOISE_SCALES
    }
    assert chosen in tried and chosen.score == min(one.score for one in tried)
    n_controlled = 2
    for one in tried:
        of_the_mean = one.log_loss + n_controlled / 2 * np.log(one.error)
        assert one.score <= of_the_mean + 1e-12  # a mean of logarithms


def test_where_nothing_can_be_left_out_or_told_apart_the_defaults_are_taken():
    data = accumulated(4, counts=(2, 1))
    library = library_from_statistics(data.tasks, data.preprocessing, Hyperparameters())
    alone = {"task_1": data.tasks["task_1"]}
    chosen, couplings, tried = choose({"own": (library, alone)}, alone)
    assert couplings == {"coupling": None, "pose_regression": None}
    assert tried == (chosen,) and np.isnan(chosen.score)
    assert chosen[:2] == Hyperparameters()[:2]
    data = accumulated(6, counts=(4,))
    *_, tried = choose_hyperparameters(data.tasks, data.preprocessing)
    assert all(one.log_loss == 0.0 and one.error > 0.0 for one in tried)


def recordings_of(rng, hands, robots):
    """Demonstrations of hands (n, T, 3) and robots (n, T, 2), with noise, and their task labels."""
    times_s = np.linspace(0.0, 2.0, hands[0][1].shape[0])
    for number, ((task, human), robot) in enumerate(zip(hands, robots, strict=True)):
        human, robot = (part + 0.003 * rng.normal(size=part.shape) for part in (human, robot))
        yield demonstration_of(times_s, human, robot, str(number), f"task_{task}")


@pytest.mark.parametrize(
    ("ways", "noise", "borrowed"), [((1.0, -1.0), 0.01, 0.0), ((1.0, 1.0), 0.05, 5.0)]
)
def test_a_regression_borrows_from_tasks_in_which_the_robot_follows_alike(ways, noise, borrowed):
    """The robot ends where the human does, or mirrors it, more or less exactly."""
    rng, phase, hands, robots = np.random.default_rng(3), np.linspace(0.0, 1.0, 81), [], []
    for task, _ in np.ndindex(2, 8):
        goal = np.array([1.0, task, 0.0]) + 0.1 * rng.normal(size=3)
        place = ways[task] * goal[:2] + noise * rng.normal(size=2)
        hands.append((task, np.outer(minimum_jerk(phase), goal)))
        robots.append(np.outer(minimum_jerk(phase), place))
    data = accumulate(recordings_of(rng, hands, robots), SETTINGS)
    chosen, _, tried = choose_hyperparameters(data.tasks, data.preprocessing)
    assert chosen.borrowed == borrowed
    assert chosen.score == min(one.score for one in tried if not one.ridge)


@pytest.mark.parametrize("lag", [0.0, 0.12])
def test_a_robot_that_copies_the_hand_later_is_learned_with_its_lag(lag):
    rng, phase = np.random.default_rng(5), np.linspace(0.0, 1.0, 161)
    places = rng.normal(size=(2, 6, 3)) + 0.5 * rng.normal(size=(9, 2, 6, 3))
    hands = [
        (task, make_interp_spline(np.linspace(0.0, 1.0, 6), points, 3)(minimum_jerk(phase)))
        for of_task in places
        for task, points in enumerate(of_task)
    ]
    before = np.maximum(np.arange(161) - round(lag * 160), 0)
    recordings = recordings_of(rng, hands, [hand[before][:, :2] for _, hand in hands])
    data = accumulate(recordings, TrainingSettings())
    chosen, _, tried = choose_hyperparameters(data.tasks, data.preprocessing)
    assert abs(chosen.lag - lag) <= 0.02
    assert chosen.score == min(one.score for one in tried)
    if lag:
        without = min(one.error for one in tried if not one.lag)
        assert chosen.error < 0.5 * without


@pytest.mark.parametrize(("ways", "strength"), [(18, STRONG), (3, STRENGTH)])
def test_movements_that_vary_in_more_ways_than_were_shown_need_a_stronger_target(ways, strength):
    """Six places of three DOFs vary, each by itself or only in the way to one goal."""
    rng, phase = np.random.default_rng(5), minimum_jerk(np.linspace(0.0, 1.0, 81))
    share = np.ones(6) if ways == 18 else np.linspace(0.0, 1.0, 6)
    usual, hands = rng.normal(size=(2, 6, 3)), []
    for _, task in np.ndindex(5, 2):
        apart = rng.normal(size=(6, 3) if ways == 18 else 3) * share[:, None]
        course = make_interp_spline(np.linspace(0.0, 1.0, 6), usual[task] + 0.5 * apart, 3)
        hands.append((task, course(phase)))
    data = accumulate(recordings_of(rng, hands, [hand[:, :2] for _, hand in hands]), SETTINGS)
    chosen, _, tried = choose_hyperparameters(data.tasks, data.preprocessing)
    assert chosen.shared_strength == strength
    assert chosen in tried


@pytest.mark.parametrize(("errors", "n_tried"), [(-0.5, 1), (0.9, 2), (1.1, 3)])
def test_a_ridge_must_gain_more_than_the_standard_error(monkeypatch, errors, n_tried):
    """The first gains as many of them, the others none, at which the search may end."""
    data, left_out = accumulated(6, counts=(4,)), {}
    library = library_from_statistics(data.tasks, data.preprocessing, Hyperparameters())
    gains = np.array([1.0, -1.0, 1.0, -1.0]) + errors / np.sqrt(4)

    def leaving_out(*given):
        found = leave_out(*given)
        left_out[id(found)] = given[-1].ridge, found
        return found

    def validated(_library, found, _tasks):
        losses = -gains * (left_out[id(found)][0] == RIDGES[0])
        return np.tile(losses, (len(POWERS), 1)), np.ones((len(FRACTIONS), 4))

    monkeypatch.setattr(selection, "leave_out", leaving_out)
    monkeypatch.setattr(selection, "validate", validated)
    chosen, _, tried = choose({"own": (library, data.tasks)}, data.tasks)
    assert chosen.ridge == (RIDGES[0] if errors > 1.0 else 0.0)
    assert {one.ridge for one in tried} == {0.0, *RIDGES[:n_tried]}


def chosen_by(monkeypatch, gain, paces=("own",), people=False):
    """What is chosen where `gain` says by how much hyperparameters lower the log loss."""
    data, left_out = accumulated(6, counts=(4,)), {}
    library = library_from_statistics(data.tasks, data.preprocessing, Hyperparameters())

    def leaving_out(*given):
        found = leave_out(*given)
        left_out[id(found)] = given[-1], found
        return found

    def validated(_library, found, _tasks):
        one, _ = left_out[id(found)]
        return np.full((len(POWERS), 4), -gain(one)), np.ones((len(FRACTIONS), 4))

    monkeypatch.setattr(selection, "leave_out", leaving_out)
    monkeypatch.setattr(selection, "validate", validated)
    monkeypatch.setattr(selection, "compares_people", lambda _groups: people)
    return choose(dict.fromkeys(paces, (library, data.tasks)), data.tasks)[0]


def test_people_whose_ridge_predicts_best_at_another_pace_are_learned_at_that_pace(monkeypatch):
    """Until the ridge is chosen, `own` is the better pace."""

    def gain(one):
        of_ridge = (3.0 if one.pace == "steady" else 1.0) * (one.ridge == RIDGES[0])
        return of_ridge + 1.0 * (one.pace == "own")

    chosen = chosen_by(monkeypatch, gain, ("own", "steady"), people=True)
    assert (chosen.pace, chosen.ridge) == ("steady", RIDGES[0])


@pytest.mark.parametrize(
    ("name", "value", "people"),
    [
        *(("independent", one, False) for one in INDEPENDENT),
        *(("strength", one, False) for one in REGRESSION_STRENGTHS),
        *(("ridge", one, True) for one in RIDGES[:2]),
        ("borrowed", 0.0, False),
    ],
)
def test_whatever_predicts_best_is_found(monkeypatch, name, value, people):
    chosen = chosen_by(monkeypatch, lambda one: float(getattr(one, name) == value), people=people)
    assert getattr(chosen, name) == value


@pytest.mark.slow
@pytest.mark.parametrize("timing", [0.5, 0.0])
def test_people_of_varying_timing_are_predicted_from_aligned_primitives_others_not(timing):
    data = accumulated(1, (8, 8), timing=timing, options=LEARNING)
    assert choose_hyperparameters(data.tasks, data.preprocessing)[0].aligned == (timing > 0.0)


@pytest.mark.parametrize(("chance", "strength"), [(0.2, 30.0), (0.05, 10.0), (0.001, 1.0)])
def test_the_more_exactly_the_robot_follows_the_less_the_target_counts(chance, strength):
    """The robot ends where the hand's bow on the way was, not where the hand ends."""
    rng, phase, hands, robots = np.random.default_rng(4), np.linspace(0.0, 1.0, 81), [], []
    for _ in range(12):
        goal = np.array([1.0, 0.0, 0.0]) + 0.1 * rng.normal(size=3)
        bow = 0.1 * rng.normal(size=2)
        place = bow + chance * rng.normal(size=2)
        arc = np.outer(np.sin(np.pi * minimum_jerk(phase)), [0.0, *bow])
        hands.append((0, np.outer(minimum_jerk(phase), goal) + arc))
        robots.append(np.outer(minimum_jerk(phase), place))
    data = accumulate(recordings_of(rng, hands, robots), SETTINGS)
    chosen, _, tried = choose_hyperparameters(data.tasks, data.preprocessing)
    assert bool(chosen.ridge) == (chance < 0.1)  # slopes then come from the demonstrations alone
    best = min((one for one in tried if not one.ridge), key=lambda one: one.score)
    alike = {one.strength: one for one in tried if one[:4] + one[5:8] == best[:4] + best[5:8]}
    assert set(alike) == set(REGRESSION_STRENGTHS)
    assert best.strength == strength
    errors = [alike[one].error for one in sorted(alike)]
    if chance > 0.1:
        assert alike[1.0].error > 1.01 * alike[30.0].error
    else:
        assert alike[100.0].score > best.score + 0.1
    if chance < 0.01:
        assert errors == sorted(errors) and alike[1.0].error < 0.8 * alike[30.0].error
