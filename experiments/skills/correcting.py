# SPDX-License-Identifier: Apache-2.0
"""A task's rule has moved by 8 cm, and a person corrects the arm by hand.

Detector, yielding, conditioning and keeping are those of the nodes; the arm and the person's hand
are in physics. Each task in turn is the one whose rule has moved.
"""

from typing import NamedTuple

import numpy as np

from experiments.execution import Executed, SimulatedPerson, as_demonstration, execute
from experiments.reaches import WatchedReach, toolbox_recordings, watch_reach
from experiments.settings import Settings
from experiments.skills.correcting_hand import CorrectingHand
from intent_recognition.activation import Mode
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import LWR_LIMITS
from intent_recognition.learning import Trained, keep_correction, learn_with_report
from intent_recognition.motion import (
    Correction,
    DeviationDetector,
    Spread,
    calibrate_detector,
    scaled_limits,
)
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration
from sim_bridge.arm import SimulatedArm
from sim_bridge.coworker import TASKS
from sim_bridge.scenarios.toolbox import HOME_HAND_M, handover_point

MOVED_M = 0.08
"""How far a task's rule has moved [m]."""
FALSE_ALARM_RATE = 0.1
"""Share of undisturbed executions that may count as pushed."""
N_CALIBRATED, N_UNDISTURBED, N_BUMPED, N_TESTED, N_MOVES = 18, 12, 8, 3, 2
"""Executions that calibrate the detector, that score it, with bumps, and after each correction;
moves of each task's rule."""
N_QUICK = (4, 1, 1, 1, 1)
"""The same in a quick run."""
N_CORRECTIONS = 3
"""Corrections kept one after the other."""
LARGEST_BLOW_N, LONGEST_BLOW_S = 60.0, 0.2
"""Strongest [N] and longest [s] bump: too short to lead the arm."""
RESTS_M_S, RESTS_S, AWAY_M = 0.02, 0.3, 0.12
"""Speed [m/s], time [s] and distance from home [m] at which a resting hand is corrected."""


class CorrectingSession(NamedTuple):
    """One task whose rule has moved once.

    Attributes:
        task: which.
        error_m: distance of the hand from the new place after 0 to 3 kept corrections (rows), of
            each execution (4, n).
        corrected_m: the same at the end of each corrected execution, in order.
        without_m: the same where the arm ignores corrections, led by the same hand.
        others_changed: largest change of any number of the other tasks.
        rad, rad_s: largest step of position and velocity where a command takes over.
        force_n: strongest pull at one point of the grip, with and without yielding.
    """

    task: str
    error_m: Floats
    corrected_m: Floats
    without_m: Floats
    others_changed: float
    rad: float
    rad_s: float
    force_n: tuple[float, float]


class CorrectingStudy(NamedTuple):
    """Results of the study.

    Attributes:
        detector: of the simulated arm.
        n_undisturbed, n_false: executions that nobody touched, and those taken for pushed.
        n_bumped, n_yielded, n_lasting: executions with a blow, those in which the arm yielded to
            it, and those in which it counted as a correction.
        sessions: task after task, some moves of each.
    """

    detector: DeviationDetector
    n_undisturbed: int
    n_false: int
    n_bumped: int
    n_yielded: int
    n_lasting: int
    sessions: tuple[CorrectingSession, ...]

    @property
    def tasks(self) -> tuple[str, ...]:
        """Labels of the tasks, in order."""
        return tuple(dict.fromkeys(one.task for one in self.sessions))

    def of(self, task: str, name: str) -> Floats:
        """An array of all sessions of a task, put side by side."""
        return np.concatenate(
            [getattr(one, name) for one in self.sessions if one.task == task], axis=-1
        )

    def fall(self, task: str) -> float:
        """Share by which the mean error of a task fell."""
        means = self.of(task, "error_m").mean(axis=1)
        return float(1.0 - means[-1] / means[0])


class Corrects:
    """A person who takes the hand to another place once it has come to rest."""

    def __init__(self, place_m: Floats) -> None:
        self.place_m = place_m
        self.hand: CorrectingHand | None = None
        self._rests_since_s: float | None = None

    def __call__(self, arm: SimulatedArm, mode: Mode) -> None:
        """Watch, or pull."""
        if self.hand is not None:
            self.hand(arm)
            return
        if arm.n_steps % 10:
            return
        away = np.linalg.norm(arm.hand_pose().position - HOME_HAND_M) > AWAY_M
        rests = np.linalg.norm(arm.hand_velocity()) < RESTS_M_S
        if not (away and rests and mode is Mode.EXECUTING):
            self._rests_since_s = None
        elif self._rests_since_s is None:
            self._rests_since_s = arm.time_s
        elif arm.time_s - self._rests_since_s >= RESTS_S:
            self.hand = CorrectingHand(arm, self.place_m)


class _Bumps:
    """A person who strikes the arm once while it moves."""

    def __init__(self, rng: np.random.Generator) -> None:
        direction = rng.normal(size=3)
        self._force_n = rng.uniform(0.3, 1.0) * LARGEST_BLOW_N * direction
        self._force_n /= np.linalg.norm(direction)
        self._lasts_s = rng.uniform(0.05, LONGEST_BLOW_S)
        self._waits_s = rng.uniform(0.2, 2.0)
        self._from_s: float | None = None

    def __call__(self, arm: SimulatedArm, mode: Mode) -> None:
        """Strike when it is time."""
        if mode is not Mode.EXECUTING and self._from_s is None:
            return
        if self._from_s is None:
            self._from_s = arm.time_s + self._waits_s
        if 0.0 <= arm.time_s - self._from_s < self._lasts_s:
            arm.apply_force(self._force_n)


class _Cell:
    """Reaches, seen by a library and executed."""

    def __init__(self, settings: Settings) -> None:
        self.settings, self.limits = settings, scaled_limits(LWR_LIMITS)

    @property
    def n(self) -> tuple[int, int, int, int, int]:
        """Numbers of executions, and of moves."""
        numbers = (N_CALIBRATED, N_UNDISTURBED, N_BUMPED, N_TESTED, N_MOVES)
        return N_QUICK if self.settings.quick else numbers

    def rng(self, k: int) -> np.random.Generator:
        return np.random.default_rng([self.settings.seed, 163, k])

    def watch(self, library: TaskLibrary, k: int) -> WatchedReach:
        return watch_reach(library, k, self.rng(k), self.limits)


def investigate(settings: Settings) -> CorrectingStudy:
    """Calibrate, test, correct."""
    cell = _Cell(settings)
    trained = learn_with_report(toolbox_recordings(settings)).trained
    library = trained.library
    n_calibrated, n_undisturbed, n_bumped, _, n_moves = cell.n
    undisturbed = []
    for k in range(n_calibrated):
        settings.progress(0.05 + 0.35 * k / n_calibrated, "undisturbed executions")
        undisturbed.append(_execute(cell, library, 1000 + k, None).tracked)
    rate = FALSE_ALARM_RATE if not settings.quick else 0.5
    detector = calibrate_detector(undisturbed, rate)
    correction = correction_of(detector, library)
    false = yielded = lasting = 0
    for k in range(n_undisturbed):
        settings.progress(0.4 + 0.15 * k / n_undisturbed, "false alarms")
        false += _execute(cell, library, 2000 + k, correction).counts.get("yielded", 0) > 0
    for k in range(n_bumped):
        settings.progress(0.55 + 0.05 * k / n_bumped, "bumps")
        bumps = _Bumps(np.random.default_rng([settings.seed, 164, k]))
        done = _execute(cell, library, 3000 + k, correction, bumps)
        yielded += done.counts.get("yielded", 0) > 0
        lasting += done.counts.get("corrected", 0) > 0
    tasks = TASKS[:1] if settings.quick else TASKS
    moves = [(task, number) for task in tasks for number in range(n_moves)]
    sessions = []
    for k, (task, number) in enumerate(moves):
        settings.progress(0.6 + 0.4 * k / len(moves), f"corrections: {task}")
        sessions.append(_session(cell, trained, task, number, detector))
    return CorrectingStudy(
        detector, n_undisturbed, false, n_bumped, yielded, lasting, tuple(sessions)
    )


def correction_of(detector: DeviationDetector, library: TaskLibrary) -> Correction:
    """How the activation corrects the tasks of a library."""
    spreads = {
        label: Spread.given_person(library.primitive(k)) for k, label in enumerate(library.labels)
    }
    return Correction(detector, spreads)


def _execute(
    cell: _Cell,
    library: TaskLibrary,
    k: int,
    correction: Correction | None,
    person: SimulatedPerson | None = None,
) -> Executed:
    watched = cell.watch(library, k)
    return execute(watched, library, cell.limits, correction, cell.rng(10_000 + k), person)


def _session(
    cell: _Cell, trained: Trained, task: str, number: int, detector: DeviationDetector
) -> CorrectingSession:
    """Move the rule of a task, correct it three times, and test it before and after each."""
    place = TASKS.index(task)
    rng = np.random.default_rng([cell.settings.seed, 165, place, number])
    direction = np.append(rng.normal(size=2), 0.3 * rng.normal())
    moved = MOVED_M * direction / np.linalg.norm(direction)
    before, n_tested = trained, cell.n[3]
    kept: list[Demonstration] = []
    first = 100 * number  # of the reaches of this move

    def errors(library: TaskLibrary) -> list[float]:
        found = []
        for k in range(n_tested):
            watched = cell.watch(library, 4002 + 3 * (first + k) + place)
            done = execute(watched, library, cell.limits, None, cell.rng(k))
            found.append(_error(done, handover_point(task, watched.goal_m) + moved))
        return found

    error, jumps, forces = [errors(trained.library)], [], [0.0, 0.0]
    led: dict[bool, list[float]] = {False: [], True: []}
    for k in range(N_CORRECTIONS):
        library = trained.library
        watched = cell.watch(library, 6000 + 3 * (first + k) + place)
        there = handover_point(task, watched.goal_m) + moved
        for feature in (False, True):
            hand = Corrects(there)
            correction = correction_of(detector, library) if feature else None
            done = execute(watched, library, cell.limits, correction, cell.rng(k), hand)
            forces[feature] = max(forces[feature], hand.hand.strongest_n if hand.hand else 0.0)
            led[feature].append(_error(done, there))
        jumps.append(done.largest_jump)
        if done.corrected is not None:
            one = as_demonstration(watched, done.corrected, library, f"{task}_{k}")
            trained = keep_correction(trained, one, kept)
            kept.append(one)
        error.append(errors(trained.library))
    return CorrectingSession(
        task,
        np.array(error),
        np.array(led[True]),
        np.array(led[False]),
        _changed(before.library, trained.library, task),
        max(rad for rad, _ in jumps),
        max(rad_s for _, rad_s in jumps),
        (forces[1], forces[0]),
    )


def _error(done: Executed, place_m: Floats) -> float:
    return float(np.linalg.norm(done.hand_m[-1] - place_m))


def _changed(before: TaskLibrary, after: TaskLibrary, task: str) -> float:
    """Largest change of any number of other tasks, or of how this one is recognised."""
    others = [k for k, label in enumerate(before.labels) if label != task]
    pairs = [
        (getattr(before, name)[others], getattr(after, name)[others])
        for name in ("weight_mean", "weight_covariance", "log_duration_mean")
    ]
    pairs += [
        (before.observed_mean, after.observed_mean),
        (before.observed_covariance, after.observed_covariance),
        (np.array(before.none_margin), np.array(after.none_margin)),
        (before.noise_variance, after.noise_variance),
    ]
    return max(float(np.abs(a - b).max()) for a, b in pairs)
