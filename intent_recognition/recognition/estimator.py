# SPDX-License-Identifier: Apache-2.0
"""The online estimator: onset, recognition and prediction from one observation after the other.

The node and `intent replay` run this same object, so that their numbers are equal. It knows no
clock: all times are stamps of measurements.
"""

from typing import NamedTuple

import numpy as np

from intent_recognition.errors import DofError, describe
from intent_recognition.filtering import N_SCALES, MovementRun, make_hypotheses, make_memory
from intent_recognition.gaussian import Gaussian
from intent_recognition.promp import NONE, ControlGrid, TaskLibrary, Trajectory, rollout
from intent_recognition.recognition.hysteresis import PosteriorHysteresis
from intent_recognition.recognition.posterior import TaskPosterior, task_posterior
from intent_recognition.recognition.start_posture import POSTURE_UNKNOWN, OnsetPosture
from intent_recognition.recognition.transitions import FORGET_AFTER_S, Expectation
from intent_recognition.signals import (
    Observation,
    SignalPast,
    at_rest,
    detect_onset,
    every_second,
    is_slow,
)

HISTORY_S = 2.0
"""How much of the past the onset detector sees."""
FINISHED_PHASE = 0.99
PAUSE_S = 1.5
"""Shortest rest in mid-movement that ends it; longer ones are allowed in long tasks."""
PAUSE_SHARE = 0.3
CLOCK_RESET_AFTER = 50
"""So many late observations of a signal on end, in order among themselves: its clock went back."""
OVERTIME_S = 0.5
"""How long after its expected end a movement that goes on is still taken for the same one."""
N_COURSE = 50
"""Points of the course that is predicted where `none` objects to a task that was believed."""
MAX_OBSERVATIONS = 2**14
"""Observations of a movement kept for a change of library; of more, every second one is."""


class Estimate(NamedTuple):
    """What is believed after an observation.

    Attributes:
        stamp_ns: of the observation.
        moving: whether a movement is under way; when not, `none` is certain and the rest is zero.
        onset_ns: when it began, 0 when idle.
        probabilities: of the K tasks and none, (K + 1,).
        phase: expected phase given each task, (K + 1,).
        log_evidence: of each task since onset, (K + 1,).
        posterior: the whole of it, None when idle.
    """

    stamp_ns: int
    moving: bool
    onset_ns: int
    probabilities: np.ndarray
    phase: np.ndarray
    log_evidence: np.ndarray
    posterior: TaskPosterior | None


class Prediction(NamedTuple):
    """Trajectory of one agent under the most probable task.

    Attributes:
        task: its label.
        onset_ns: the stamp from which the trajectory's times count.
        trajectory: means and spread.
        start: what became of the controlled agent's posture at onset; see `posture`.
    """

    task: str
    onset_ns: int
    trajectory: Trajectory
    start: str = ""


class _Movement(MovementRun):
    """The movement under way, and its observations in case the library changes."""

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        self.observations: list[Observation] = []
        self.hysteresis = PosteriorHysteresis(
            self.hypotheses.log_task_prior,
            self.library.n_observed,
            lambda task: self.task_filters[task].observed(N_COURSE),
        )

    def observe(self, observation: Observation) -> None:
        super().observe(observation)
        if not observation.derivative:
            self.hysteresis.see(self.dofs_of(observation), observation.values)
        self.observations.append(observation)
        if len(self.observations) > MAX_OBSERVATIONS:
            self.observations = every_second(self.observations)

    def posterior(self, stamp_ns: int) -> TaskPosterior:
        return task_posterior(self, self.hypotheses, (stamp_ns - self.onset_ns) * 1e-9)


class IntentEstimator:
    """Recognises and predicts over a stream of observations of the human.

    Args:
        library: the learned tasks.
        task_prior: p(s), (K,), always; when None, the library's transition prior after the task
            before (`transitions`).
        n_scales: durations per task in the phase bank.
        transitions: use the transition prior; else p(s) is the library's task prior.
        forget_after_s: so long after a movement the task before tells nothing any more.
        start_posture: condition trajectories on the controlled agent's posture at onset, where
            `observe_controlled` has shown it.
    """

    def __init__(
        self,
        library: TaskLibrary,
        task_prior: np.ndarray | None = None,
        n_scales: int = N_SCALES,
        *,
        transitions: bool = True,
        forget_after_s: float = FORGET_AFTER_S,
        start_posture: bool = True,
    ):
        self.library = library
        self._n_scales = n_scales
        self._posture = OnsetPosture() if start_posture else None
        self._grids: dict[int, ControlGrid] = {}
        self.expectation = Expectation(library, task_prior, transitions, forget_after_s)
        self._hypotheses = make_hypotheses(library, task_prior, n_scales)
        self._past = [SignalPast(size, HISTORY_S) for size in library.observed_groups]
        self._memory = make_memory(library, self._hypotheses)
        self._movement: _Movement | None = None
        self._posterior: TaskPosterior | None = None
        self._needs_rest = False

    def reason_to_reject(self, observation: Observation) -> str | None:
        """Why an observation cannot be used, as a diagnostics key, or None when it can.

        Asked once for each. A clock that was set back (a recording played again) is followed
        after CLOCK_RESET_AFTER observations: all is forgotten then, as by `reset`.
        """
        dofs, past = observation.dofs, self._past[observation.group]
        expected = past.n_dofs if dofs is None else len(dofs)
        if np.shape(observation.values) != (expected,):
            return "wrong_size"
        if not np.all(np.isfinite(observation.values)):
            return "not_finite"
        if observation.stamp_ns <= 0:
            return "zero_stamp"
        if past.is_late(observation):
            if past.count_late(observation) < CLOCK_RESET_AFTER:
                return "stamp_not_increasing"
            self.reset()
        if observation.derivative and observation.covariance is None:
            return "no_covariance"
        covariance = observation.covariance
        if covariance is None:
            return None
        fits = np.shape(covariance) == (expected, expected)
        return None if fits and past.trusts(covariance) else "bad_covariance"

    def observe(self, observation: Observation) -> Estimate:
        """Take one observation that `reason_to_reject` has nothing against."""
        self._past[observation.group].add(observation)
        for past in self._past:  # a signal that fell silent must not speak for ever
            past.forget_before(observation.stamp_ns)
        if self._movement is None:
            self.expectation.forget_if_long_ago(observation.stamp_ns)
            self._begin_if_moving()
        elif observation.stamp_ns >= self._movement.onset_ns:
            self._movement.observe(observation)
        if self._movement is None:
            return self._idle(observation.stamp_ns)
        posterior = self._movement.posterior(observation.stamp_ns)
        self._posterior = self.expectation.weigh(self._movement.hysteresis.hold(posterior))
        self._movement.hysteresis.believe(self._posterior.probabilities)
        if self._finished(observation.stamp_ns, self._posterior):
            self.expectation.remember(observation.stamp_ns, self._posterior)
            self._movement = self._posterior = None
            return self._idle(observation.stamp_ns)
        phase = self._posterior.phase.copy()
        phase[-1] = 0.0
        return Estimate(
            observation.stamp_ns,
            True,
            self._movement.onset_ns,
            self._posterior.probabilities,
            phase,
            self._posterior.log_evidence,
            self._posterior,
        )

    def observe_controlled(self, observation: Observation) -> str | None:
        """Take the controlled agent's position; returns why it was not taken, or None.

        Used for its posture at onset alone (`posture`). Groups count the controlled signals, in
        the order of the DOF file.
        """
        if self._posture is None:
            return None
        return self._posture.history.take(
            observation.stamp_ns, observation.group, observation.values
        )

    def predict_controlled(self, n_points: int = 50) -> Prediction | None:
        """The controlled agent's whole interaction from onset, under the most probable task.

        None while idle or while `none` leads.
        """
        if self._movement is None or self._posterior is None:
            return None
        task = int(np.argmax(self._posterior.probabilities))
        if task == self.library.n_tasks:
            return None
        start, used = None, POSTURE_UNKNOWN
        if self._posture is not None:
            start, used = self._posture.given(self.library, task, self._movement.onset_ns)
        trajectory = self._movement.task_filters.controlled(task, n_points, start)
        return Prediction(self.library.labels[task], self._movement.onset_ns, trajectory, used)

    def predicted_end_std(self) -> float | None:
        """Largest standard deviation over the controlled DOFs at the predicted end.

        None while idle or while `none` leads.
        """
        prediction = self.predict_controlled(n_points=1)
        return None if prediction is None else float(np.max(prediction.trajectory.std[-1]))

    def predict_observed(self, n_points: int = 30) -> Prediction | None:
        """The rest of the observed agent's movement, under the most probable hypothesis."""
        if self._movement is None or self._posterior is None:
            return None
        task = int(np.argmax(self._posterior.probabilities))
        if task < self.library.n_tasks:
            trajectory = self._movement.task_filters[task].observed(n_points)
            return Prediction(self.library.labels[task], self._movement.onset_ns, trajectory)
        noise = self.library.noise_variance[: self.library.n_observed]
        phase = np.linspace(self._posterior.phase[task], 1.0, n_points)
        return self._prediction(task, self._observed(task), noise, phase)

    def _observed(self, task: int) -> Gaussian:
        return self._movement.moments(task, self._posterior.scale_weights[task])

    def _prediction(
        self, task: int, weights: Gaussian, noise: np.ndarray, phase: np.ndarray
    ) -> Prediction:
        trajectory = rollout(
            self.library.basis, weights, phase, float(self._posterior.duration_s[task]), noise
        )
        label = (*self.library.labels, NONE)[task]
        return Prediction(label, self._movement.onset_ns, trajectory)

    def reset(self) -> None:
        """Forget the movement under way and the past."""
        self._movement = self._posterior = None
        self.expectation.reset()
        if self._posture is not None:
            self._posture.clear()
        self._needs_rest = False
        for past in self._past:
            past.clear()

    def swap(self, library: TaskLibrary, task_prior: np.ndarray | None = None) -> None:
        """Go on with another library; the movement under way is filtered anew from its onset.

        Raises:
            DofError: the other library observes or controls other DOFs.
        """
        for agent in (
            "observed_names",
            "observed_units",
            "observed_groups",
            "controlled_names",
            "controlled_units",
        ):
            ours, theirs = getattr(self.library, agent), getattr(library, agent)
            if ours != theirs:
                raise DofError(
                    describe(f"library {agent}", str(ours), str(theirs), "Train on the same DOFs.")
                )
        self.library = library
        self._grids = {}
        self.expectation.swap(library, task_prior)
        self._hypotheses = make_hypotheses(library, task_prior, self._n_scales)
        if self._posture is not None:
            self._posture.library_changed()
        if self._movement is not None:
            before = self._movement
            self._begin(before.onset_ns, before.observations)
            last_ns = before.observations[-1].stamp_ns
            self._posterior = self.expectation.weigh(self._movement.posterior(last_ns))

    def _begin_if_moving(self) -> None:
        if self._needs_rest:
            self._needs_rest = not self._at_rest()
            return
        onsets = []
        for settings, past in zip(self.library.onset, self._past, strict=True):
            for history in past.speaking(settings.rest_s):
                onset = detect_onset(settings, *history.arrays())
                if onset is not None:
                    onsets.append(history.first_ns + round(onset * 1e9))
        if not onsets:
            return
        found = [o for past in self._past for o in past.observations() if o.stamp_ns >= min(onsets)]
        self._begin(min(onsets), sorted(found, key=lambda o: (o.stamp_ns, o.group, o.derivative)))

    def _begin(self, onset_ns: int, past: list[Observation]) -> None:
        """Filter a movement from its onset, in the memory of the one before."""
        self._movement = _Movement(
            self.library,
            self._hypotheses,
            onset_ns,
            self._grids,
            memory=self._memory,
            prune=True,
            task_weight=self.expectation.ratio,
        )
        self._memory = self._movement.memory
        for observation in past:
            self._movement.observe(observation)

    def _at_rest(self, rest_s: float | None = None) -> bool:
        return all(
            is_slow(settings, *history.arrays(settings.window_s))
            and at_rest(settings, *history.arrays(), rest_s)
            for settings, past in zip(self.library.onset, self._past, strict=True)
            for history in past.speaking(settings.rest_s)
        )

    def _finished(self, stamp_ns: int, posterior: TaskPosterior) -> bool:
        """Whether the movement is over: done and at rest, stopped half-way, or overdue."""
        elapsed = (stamp_ns - self._movement.onset_ns) * 1e-9
        duration = float(posterior.probabilities @ posterior.duration_s)
        phase = float(posterior.probabilities @ posterior.phase)
        if elapsed > duration + OVERTIME_S and phase >= FINISHED_PHASE:
            self._needs_rest = not self._at_rest()
            return True
        none_leads = int(np.argmax(posterior.probabilities)) == self.library.n_tasks
        if phase >= FINISHED_PHASE or none_leads:
            return self._at_rest()
        return self._at_rest(min(max(PAUSE_S, PAUSE_SHARE * duration), HISTORY_S - 0.1))

    def _idle(self, stamp_ns: int) -> Estimate:
        size = self.library.n_tasks + 1
        certain = np.zeros(size)
        certain[-1] = 1.0
        return Estimate(stamp_ns, False, 0, certain, np.zeros(size), np.zeros(size), None)
