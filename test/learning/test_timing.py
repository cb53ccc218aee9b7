# SPDX-License-Identifier: Apache-2.0
"""People's timing, recovered from recordings whose timing is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from simulation import START_NS, demonstration_of, minimum_jerk

from intent_recognition.learning import (
    TrainingSettings,
    accumulate,
    add_demonstration,
    example_of,
    learn_with_report,
)
from intent_recognition.learning.timing import (
    ALIGNED_FLOOR,
    DEFAULT_DEVIATION_STD,
    MIN_DEVIATION_STD,
    STEADY_FLOOR,
    STEADY_SHARE,
    Timing,
    estimate_timing,
)
from intent_recognition.promp import steady_phase
from intent_recognition.signals import Demonstration, Signal

PHASE = np.linspace(0.0, 1.0, 101)
AHEAD = np.array([-0.08, -0.05, -0.03, 0.03, 0.05, 0.08])


def reference_of(recorded: np.ndarray, ahead: float) -> np.ndarray:
    """Preprocessing phase of a person who is ahead by so much amid the movement."""
    return recorded + ahead * np.sin(np.pi * recorded)


def shape(phase: np.ndarray, task: int) -> np.ndarray:
    """Five DOFs of a task over reference phase, (T, 5)."""
    columns = [np.sin((k + 1 + task) * np.pi * phase + k) for k in range(4)]
    return np.stack([*columns, minimum_jerk(phase)], axis=1)


def a_recording(
    rng: np.random.Generator, ahead: float, task: int = 0, noise: float = 0.01, name: str = ""
) -> Demonstration:
    """Of 1 to 3 s, its signals sampled at times of their own, each displaced a little."""
    duration_ns = round(rng.uniform(1.0, 3.0) * 1e9)
    signals = []
    for names, rate, columns in ((("a", "b", "c"), 60, slice(0, 3)), (("d", "e"), 45, slice(3, 5))):
        recorded = np.linspace(0.0, 1.0, rate)
        values = shape(reference_of(recorded, ahead), task)[:, columns]
        values = values + noise * rng.normal(size=values.shape) + 0.05 * rng.normal()
        stamps = START_NS + np.round(recorded * duration_ns).astype(np.int64)
        signals.append(Signal(names, stamps, values, "m"))
    return Demonstration(
        name, "", f"task_{task}", signals[:1], signals[1:], START_NS, START_NS + duration_ns
    )


def some(rng: np.random.Generator, task: int = 0, scale: float = 1.0) -> list[Demonstration]:
    return [a_recording(rng, scale * ahead, task) for ahead in AHEAD]


def test_known_timing_is_recovered(rng):
    recordings = [*some(rng, 0), *some(rng, 1)]
    timing = estimate_timing(recordings)
    assert list(timing.templates) == ["task_0", "task_1"]
    for warp, ahead in zip(timing.warps(recordings), np.tile(AHEAD, 2), strict=True):
        error = warp.inverse(PHASE) - reference_of(PHASE, ahead)
        assert np.sqrt(np.mean(error**2)) < 0.012
        assert np.abs(error).max() < 0.03


def test_the_phase_deviation_is_that_of_the_people_and_shared_by_tasks(rng):
    found = estimate_timing(some(rng)).deviation_std
    assert found.shape == (51,)
    assert found[25] == pytest.approx(np.std(AHEAD, ddof=1), rel=0.2)
    np.testing.assert_allclose(found, found[::-1], atol=1e-12)
    assert found[[0, -1]] == pytest.approx(MIN_DEVIATION_STD)
    steady = estimate_timing(some(rng, scale=0.0)).deviation_std
    assert steady.max() < 0.3 * found.max()
    assert steady.min() >= MIN_DEVIATION_STD
    wide, narrow = some(rng, 0), some(rng, 1, scale=0.25)
    both = estimate_timing([*wide, *narrow]).deviation_std[25]
    apart = [estimate_timing(part).deviation_std[25] for part in (wide, narrow)]
    assert both == pytest.approx(np.sqrt(np.mean(np.square(apart))), rel=0.01)


def bent_recordings(rng, duration_exponent: float, durations_s) -> list[Demonstration]:
    """Progress whose odds are those of the recorded phase times a power of the duration."""
    found = []
    for person, duration_s in enumerate(np.repeat(durations_s, 2)):
        even = np.linspace(0.0, 1.0, 80)
        odds = even / np.maximum(1.0 - even, 1e-12) * (duration_s / 2.0) ** duration_exponent
        values = shape(odds / (1.0 + odds), 0) + 0.01 * rng.normal(size=(80, 5))
        parts = even * duration_s, values[:, :3], values[:, 3:], "", "task_0", ("m", "m")
        found.append(demonstration_of(*parts, metadata={"group": str(person // 2)}))
    return found


@pytest.mark.parametrize("duration_exponent", [0.8, 0.0, -0.8])
def test_how_progress_depends_on_the_duration_is_recovered(rng, duration_exponent):
    durations_s = 2.0 * np.exp(np.linspace(-0.6, 0.6, 9))
    recordings = bent_recordings(rng, duration_exponent, durations_s)
    timing = estimate_timing(recordings)
    assert timing.duration_exponent == pytest.approx(duration_exponent, abs=0.15)
    assert timing.usual_s == {"task_0": pytest.approx(2.0)}
    assert timing.usual_of("a later one") == pytest.approx(2.0)
    assert timing.deviation_std.max() < 0.02  # what durations explain is no deviation
    relative = np.array([one.duration_s for one in recordings]) / 2.0
    for of_one, share in zip(timing.steady(recordings), relative, strict=True):
        expected = steady_phase(timing.phase_deviation("steady"), PHASE, share)
        np.testing.assert_allclose(of_one(PHASE), expected, atol=1e-6)


def pushed(rng, n_integrals: int, durations_s) -> list[Demonstration]:
    """The robot has so often integrated a force, which takes the same course in any duration."""
    found = []
    for duration_s in durations_s:
        phase = np.linspace(0.0, 1.0, 150)
        size = [1.0, 0.4, 0.4] + 0.15 * rng.normal(size=(2, 3))
        force = np.stack([np.sin(k * np.pi * phase) for k in (1, 2, 3)], axis=1) @ size.T
        robot = force
        for _ in range(n_integrals):
            robot = cumulative_trapezoid(robot, duration_s * phase, axis=0, initial=0.0)
        values = robot + 0.05 * rng.normal(size=2) + 1e-3 * rng.normal(size=robot.shape)
        found.append(
            Demonstration.from_arrays(
                duration_s * phase, force, values, task="push", observed_unit="N"
            )
        )
    return found


@pytest.mark.parametrize("n_integrals", [0, 1, 2])
def test_how_far_a_robot_goes_that_integrates_is_recovered(rng, n_integrals):
    recordings = pushed(rng, n_integrals, 2.0 * np.exp(0.3 * rng.normal(size=14)))
    assert estimate_timing(recordings).displacement_exponent == n_integrals


def copied(rng, delay_s: float, share: float, durations_s) -> list[Demonstration]:
    """The robot is where the hand was some time and a share of its movement earlier."""
    found = []
    for duration_s in durations_s:
        times_s = np.arange(0.0, duration_s + 0.6, 0.01)
        size = [0.4, 0.2, 0.2] + 0.08 * rng.normal(size=(2, 3))

        def hand(at, duration_s=duration_s, size=size):
            course = minimum_jerk(np.clip(at / duration_s, 0.0, 1.0))
            return np.stack([np.sin(k * np.pi * course) for k in (1, 2, 3)], axis=1) @ size.T

        robot = hand(times_s - delay_s - share * duration_s) @ [[0.9, 0.2], [-0.1, 1.1]]
        values = [one + 1e-3 * rng.normal(size=one.shape) for one in (hand(times_s), robot)]
        found.append(Demonstration.from_arrays(times_s, *values, task="copy"))
    return found


@pytest.mark.parametrize(("delay_s", "share"), [(0.25, 0.0), (0.0, 0.12), (0.0, 0.0)])
def test_the_delay_of_a_robot_that_copies_is_recovered(rng, delay_s, share):
    recordings = copied(rng, delay_s, share, 2.0 * np.exp(0.2 * rng.normal(size=14)))
    timing = estimate_timing(recordings)
    assert timing.delay_s == pytest.approx(delay_s, abs=0.02)
    assert timing.displacement_exponent == 0.0


@pytest.mark.parametrize(("exponent", "delay_s"), [(2.0, 0.0), (0.0, 0.15)])
def test_an_example_goes_as_far_and_as_late_as_in_the_usual_duration(rng, exponent, delay_s):
    """Of one movement that takes several times."""
    recordings = []
    for duration_s in (1.2, 2.0, 2.8):
        phase = np.linspace(0.0, 1.0, 200)
        hand = np.sin(3.0 * phase)[:, None]
        passed = np.clip(phase - delay_s / duration_s, 0.0, 1.0)
        robot = 0.4 + 0.1 * duration_s**exponent * minimum_jerk(passed)[:, None]
        times_s = duration_s * phase
        recordings.append(Demonstration.from_arrays(times_s, hand, robot, task="reach"))
    settings = TrainingSettings(segmentation="recording")
    settled = accumulate(recordings, settings).preprocessing
    usual = {"usual_s": {"reach": 2.0}, "displacement_exponent": exponent, "delay_s": delay_s}
    settled = replace(settled, timing=Timing({}, settled.timing.deviation_std, **usual))
    design = settled.basis_of(False).design_matrix(PHASE)
    short, usually, long = (design @ example_of(one, settled).weights[1] for one in recordings)
    np.testing.assert_allclose(short, usually, atol=0.02 * np.ptp(usually))
    np.testing.assert_allclose(long, usually, atol=0.02 * np.ptp(usually))


def test_what_is_added_is_filtered_at_the_phases_it_was_fitted_at(rng):
    """Slower demonstrations move the mean duration, and a task that came later has another."""
    recordings = bent_recordings(rng, 0.8, 2.0 * np.exp(np.linspace(-0.6, 0.6, 5)))
    trained = learn_with_report(recordings, TrainingSettings(segmentation="recording")).trained
    added = bent_recordings(rng, 0.8, [3.5, 4.0])
    added = [*added, *(replace(one, task="later") for one in added)]
    for one in added:
        trained = add_demonstration(trained, one)
    library, timing = trained.library, trained.preprocessing.timing
    for one, fitted in zip(added, timing.steady(added), strict=True):
        relative = one.duration_s / library.usual_s[library.labels.index(one.task)]
        found = steady_phase(library.phase_deviation, PHASE, relative)
        np.testing.assert_allclose(found, fitted(PHASE), atol=1e-9)


def test_progress_depends_on_the_duration_only_where_people_are_compared(rng):
    recordings = bent_recordings(rng, 0.8, 2.0 * np.exp(np.linspace(-0.6, 0.6, 5)))
    assert estimate_timing(recordings).duration_exponent > 0.5
    alone = [replace(one, metadata={}) for one in recordings]
    assert estimate_timing(alone).duration_exponent == 0.0


def test_recordings_of_equal_durations_say_nothing_of_the_exponent(rng):
    recordings = bent_recordings(rng, 0.0, 2.0 + 1e-4 * rng.normal(size=6))
    assert abs(estimate_timing(recordings).duration_exponent) < 0.1


def test_without_two_recordings_or_samples_nothing_is_aligned(rng):
    recordings = [a_recording(rng, 0.05, 0), a_recording(rng, 0.05, 1)]
    timing = estimate_timing(recordings)
    assert not timing.templates
    assert timing.deviation_std.max() == pytest.approx(DEFAULT_DEVIATION_STD)
    for warp in timing.warps(recordings):
        np.testing.assert_array_equal(warp.inverse(PHASE), PHASE)
    assert estimate_timing([]) == timing
    recordings = some(rng)
    silent = replace(recordings[0], start_ns=0, end_ns=START_NS - 1)
    never = replace(recordings[0], end_ns=START_NS)
    assert estimate_timing([silent, *recordings, never]) == estimate_timing(recordings)


def test_a_recording_comes_out_the_same_alone_in_company_or_later(rng):
    recordings = [*some(rng, 0), *some(rng, 1)]
    timing = estimate_timing(recordings)
    together = timing.warps(recordings[::-1])[::-1]
    for recorded, warp in zip(recordings, together, strict=True):
        (alone,) = timing.warps([recorded])
        np.testing.assert_allclose(alone.recorded, warp.recorded, atol=1e-9)
    timing = estimate_timing(some(rng))
    later, unknown = a_recording(rng, 0.06), a_recording(rng, 0.06, task=4)
    warp, identity = timing.warps([later, unknown])
    np.testing.assert_allclose(warp.inverse(PHASE), reference_of(PHASE, 0.06), atol=0.03)
    np.testing.assert_array_equal(identity.inverse(PHASE), PHASE)
    assert timing.warps([]) == []


def test_timings_are_equal_where_all_of_them_is(rng):
    recordings = some(rng)
    timing = estimate_timing(recordings)
    assert timing == estimate_timing(recordings)
    assert timing != estimate_timing(recordings[1:])
    assert timing != Timing({}, timing.deviation_std)
    assert timing != Timing(timing.templates, timing.deviation_std + 1e-9)
    template = timing.templates["task_0"]
    moved = template._replace(values=template.values + 1e-9)
    assert timing != Timing({"task_0": moved}, timing.deviation_std)
    assert timing != "timing"


def test_aligned_primitives_leave_all_of_the_deviation_to_the_phase(rng):
    """Those at steady progress hold a part of it in their covariance; both have a floor."""
    timing = estimate_timing(some(rng))
    aligned, steady = timing.phase_deviation("aligned"), timing.phase_deviation("own")
    wide = timing.deviation_std > ALIGNED_FLOOR
    assert wide.any() and not wide.all()
    np.testing.assert_array_equal(aligned.deviation_std[wide], timing.deviation_std[wide])
    np.testing.assert_array_equal(aligned.deviation_std[~wide], ALIGNED_FLOOR)
    assert steady.deviation_std[25] == STEADY_SHARE * timing.deviation_std[25]
    assert steady.deviation_std.min() == STEADY_FLOOR
    assert aligned.controlled_follows and not steady.controlled_follows
    for deviation in (aligned, steady):
        assert 0.0 < deviation.evidence <= 1.0 and deviation.correlation > 0.0
