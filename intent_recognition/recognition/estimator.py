# SPDX-License-Identifier: Apache-2.0
"""The online estimator: onset, recognition and prediction from a stream of observations.

The node and `intent replay` run the same class, so their results are equal. It reads no clock: all
times are stamps of measurements.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, check_type, first_of
from intent_recognition.filtering import N_SCALES, MovementFilter, make_prior_grid
from intent_recognition.plans import WorkProgress
from intent_recognition.promp import NONE, TaskLibrary, Trajectory, as_context, largest_by_unit
from intent_recognition.recognition.arguments import (
    LIBRARY_CURE,
    as_observation,
    as_posture,
    as_times,
    check_observation,
    check_same_dofs,
    covariance_defect,
    observation_error,
    values_defect,
)
from intent_recognition.recognition.context import KnownContext
from intent_recognition.recognition.estimate import Estimate, Prediction, Predictor
from intent_recognition.recognition.explaining import Evidence, explain_movement
from intent_recognition.recognition.motion_detection import MotionDetector, SparseSignal
from intent_recognition.recognition.movement import Movements
from intent_recognition.recognition.observed import FirstSamples, ObservedTurns
from intent_recognition.recognition.start_posture import OnsetPosture, rest_poses
from intent_recognition.recognition.transitions import FORGET_AFTER_S, Expectation
from intent_recognition.signals import CLOCK_RESET_AFTER, Observation


class IntentEstimator:
    """Recognises and predicts over a stream of observations of the human.

    Args:
        library: the learned tasks.
        task_prior: fixed probabilities p(s), (K,), which sum to one; None for the library's
            transition prior given the last task (`transitions`).
        n_scales: number of durations per task in the filter.
        transitions: use the transition prior; else p(s) is the library's task prior.
        forget_after_s: time after a movement at which the last task is forgotten [s].
        start_posture: condition trajectories on the controlled agent's posture at onset, if
            `observe_controlled` has received it.
        switching: follow a person who turns to another task on the way, or begins the next one
            without a rest; if not, a movement is of one task, from rest to rest.

    Attributes:
        taught: the library, conditioned on the known context.
        library: the library in use, which `bend` makes from `taught`.
        first_samples: check of the units of the first samples.

    Raises:
        ArgumentError: library is not a `TaskLibrary`, or `task_prior` is not one over its tasks.
    """

    def __init__(
        self,
        library: TaskLibrary,
        task_prior: Floats | None = None,
        n_scales: int = N_SCALES,
        *,
        transitions: bool = True,
        forget_after_s: float = FORGET_AFTER_S,
        start_posture: bool = True,
        switching: bool = True,
    ):
        check_type("library", library, TaskLibrary, LIBRARY_CURE)
        self._context = KnownContext(library)
        self._n_scales = n_scales
        self._posture = OnsetPosture(library, used=start_posture)
        self._predictor = Predictor(self._posture)
        self.expectation = Expectation(library, task_prior, transitions, forget_after_s)
        self._detector = MotionDetector(library.observed_groups, library.onset)
        self._movements = Movements(self._detector, self.expectation, switching=switching)
        self._turns = ObservedTurns(library)
        self.first_samples = FirstSamples(library)
        self._use(library, lambda taught: taught, task_prior)

    def __repr__(self) -> str:
        """Labels of the tasks, and whether a movement is under way."""
        state = "at rest" if self._movements.run is None else "following a movement"
        return f"<IntentEstimator of {first_of(self.library.labels)}: {state}>"

    def observe(
        self,
        stamp_s: float,
        values: ArrayLike,
        *,
        signal: int = 0,
        dofs: Sequence[int] | None = None,
        covariance: ArrayLike | None = None,
    ) -> Estimate:
        """Take one measurement of the human.

        Args:
            stamp_s: time of measurement [s], on any clock; it must increase within a signal.
            values: positions of the signal's DOFs, (m,), in the units of the library. NaN marks
                DOFs that were not measured, as in `recognize_task`: they are left out, and if all
                are NaN, the estimate does not change.
            signal: index of the observed signal, counted from 0.
            dofs: indices of the measured DOFs within the signal, counted from 0; None means all.
            covariance: measurement covariance, (m, m), added to the learned noise.

        Returns:
            Probabilities of the tasks, and the phase, after the measurement.

        Raises:
            ShapeError: values or covariance do not fit the signal.
            ArgumentError: a number is infinite, `covariance` is not positive semidefinite, there is
                no such signal, the first samples are not in the learned unit (but in millimetres,
                degrees, stamps in ms), or the stamp is not later than the last. After
                CLOCK_RESET_AFTER such stamps, the clock is assumed to have been set back, and the
                estimator resets.
        """
        sizes, run = [past.n_dofs for past in self._detector.pasts], self._movements.run
        observation = as_observation(sizes, stamp_s, values, signal, dofs, covariance)
        measured = observation.measured()
        if measured is None:
            return self._estimate((run.observations[-1] if run else observation).stamp_ns)
        reason = self._defect(measured)
        if reason is not None:
            raise observation_error(reason, measured, sizes[signal], self.first_samples.misfit)
        return self.update(measured)

    def reason_to_reject(self, observation: Observation) -> str | None:
        """Reason why `update` cannot take an observation, as a diagnostics key, or None.

        Call it once for each observation. After CLOCK_RESET_AFTER consecutive late observations,
        the clock is assumed to have been set back (a recording is played again): the estimator
        resets and follows the new clock.
        """
        return check_observation(observation) or self._defect(observation)

    def _defect(self, observation: Observation) -> str | None:
        """As `reason_to_reject`, but a stamp of zero is accepted."""
        past = self._detector.pasts[observation.group]
        wrong = values_defect(observation, past.n_dofs)
        if wrong is None and past.is_late(observation):
            if past.count_late(observation) < CLOCK_RESET_AFTER:
                return "stamp_not_increasing"
            self.reset()
        wrong = wrong or covariance_defect(observation, past)
        return wrong or ("unit" if self.first_samples.refuse(observation) else None)

    def update(self, observation: Observation) -> Estimate:
        """Take one observation for which `reason_to_reject` is None.

        Raises:
            ArgumentError: `observation` is no `Observation`.
        """
        check_observation(observation)
        observation = self._turns.bring(observation.copied())
        now_ns, run = observation.stamp_ns, self._movements.run
        self._detector.add(observation)
        if run is None:
            self.expectation.forget_if_long_ago(now_ns)
            onset_ns = self._detector.find_onset_ns()
            if onset_ns is not None:
                if self._context.changed():
                    self._use_context(now_ns)
                self._movements.begin(onset_ns, self._detector.since(onset_ns))
        elif now_ns >= run.onset_ns and self._context.due(now_ns, run.onset_ns):
            self._use_context(now_ns)
        self._movements.advance(observation, begun=run is None)
        return self._estimate(now_ns)

    def _estimate(self, stamp_ns: int) -> Estimate:
        """Estimate from the observations up to a stamp."""
        labels, run = (*self.library.labels, NONE), self._movements.run
        if run is None or self._movements.posterior is None:
            return Estimate.idle(stamp_ns, labels)
        self._posture.follow(run.onset_ns)
        return Estimate.of(stamp_ns, run.onset_ns, self._movements.posterior, labels)

    def observe_controlled(self, stamp_s: float, values: ArrayLike, *, signal: int = 0) -> None:
        """Take one measured position of the robot; its posture at onset conditions predictions.

        Args:
            stamp_s: time of measurement [s], on the clock of `observe`.
            values: positions of the signal's DOFs, (m,), in the units of the library.
            signal: index of the controlled signal, counted from 0.

        Raises:
            ShapeError: values are not a vector of at most Q numbers.
            ArgumentError: a number is not finite, or the stamp is not later than the last.
        """
        observation = as_posture(self.library.n_controlled, stamp_s, values, signal)
        reason = self._posture.take(observation)
        if reason is not None:
            raise observation_error(reason, observation, len(observation.values))

    def update_controlled(self, observation: Observation) -> str | None:
        """As `observe_controlled`, but return a diagnostics key instead of an error, or None.

        The group is the index of the controlled signal, in the order of the DOF file.
        """
        return check_observation(observation) or self._posture.take(observation)

    def observe_context(self, values: ArrayLike) -> None:
        """Set the context, from now on and for the movement under way.

        It stays until other values come, also from one movement to the next. Before the first call,
        predictions are marginal over the contexts.

        Args:
            values: M numbers in the order of the library's `context_names`; NaN for unknown ones.

        Raises:
            ShapeError: `values` are not one number for each of `context_names`.
            ArgumentError: a number is infinite, or not in the learned unit.
        """
        known = as_context(values, self._context.learned.context_names)
        if (misfit := self._context.know(known)) is not None:
            raise ArgumentError(misfit.reason)
        if self._context.changed():
            self._use_context()

    def update_context(self, observation: Observation) -> str | None:
        """Take a sample of the context; return a diagnostics key if it was refused, else None.

        If it changes the context by more than noise (`ContextModel.tolerance`), the movement under
        way is filtered anew, at most every `CONTEXT_PERIOD_S` and `CONTEXT_SHARE` of its time so
        far. The group is the index of the context signal, in the order of the DOF file.
        """
        reason = check_observation(observation) or self._context.take(observation)
        self.first_samples.misfit = self._context.misfit
        return reason

    def bend(self, change: Callable[[TaskLibrary], TaskLibrary]) -> None:
        """Use the library that a function makes from `taught`, now and in every later context.

        `composing.BentLibrary` makes one that passes through via points. The distribution of the
        observed weights must stay the same, so that recognition does not change.
        """
        self._use(self.taught, change, self._task_prior)

    def answer(self, task: str) -> None:
        """Use a person's answer about the task under way, until it ends or is answered again.

        Raises:
            ArgumentError: no movement is under way, or there is no such task.
        """
        run = self._movements.run
        if run is None:
            cure = "Answer while the human moves."
            raise ArgumentError.about("answer", "a movement under way", "none", cure)
        self.expectation.answer(task)
        self._movements.believe(run.observations[-1].stamp_ns)

    def expect(self, task: str) -> None:
        """Expect a task next, with the trust of a habit; an unknown label ends the expectation."""
        self.expectation.expect(task, at_once=self._movements.run is None)

    def share(self, progress: WorkProgress) -> None:
        """Use the progress of an assembly that several people share, from the next movement on.

        What somebody else completes during a movement has not made that movement possible.
        """
        self.expectation.share(progress, at_once=self._movements.run is None)

    def predict_controlled(self, n_points: int = 50) -> Prediction | None:
        """Trajectory of the controlled agent from onset to end, under the most probable task.

        None if `estimate.task` is "none", as at rest: there is no task to predict.
        `predict_controlled_at` always predicts the controlled agent.
        """
        run, task = self._most_probable()
        if run is None or task == self.library.n_tasks:
            return None
        return self._predictor.controlled(run, task, n_points)

    def _most_probable(self) -> tuple[MovementFilter | None, int]:
        """Filter of the movement under way, None at rest, and its most probable task."""
        run, posterior = self._movements.run, self._movements.posterior
        return run, 0 if posterior is None else int(np.argmax(posterior.probabilities))

    def predict_controlled_at(self, times_s: ArrayLike) -> Trajectory:
        """Predict the controlled agent at some times, over all tasks and phases.

        The mean and standard deviation are those of the mixture over the known tasks, durations and
        phase deviations, without `none`. Times before the onset give the start of the movement. At
        rest, all times give the expected start of the next movement: mean and spread over tasks.

        Args:
            times_s: times on the clock of `observe`, (T,), or a number for one [s].

        Returns:
            The trajectory at `times_s`.

        Raises:
            ShapeError: times_s has more than one dimension.
            ArgumentError: a time is not finite.
        """
        times = as_times(times_s)
        run, posterior = self._movements.run, self._movements.posterior
        if run is None or posterior is None:
            return rest_poses(self.library, self.expectation.prior, times)
        return self._predictor.controlled_at(run, posterior.probabilities[:-1], times)

    def predicted_end_std(self) -> dict[str, float] | None:
        """Largest standard deviation of `predict_controlled`'s end among the DOFs of each unit."""
        prediction = self.predict_controlled(n_points=1)
        if prediction is None:
            return None
        return largest_by_unit(prediction.trajectory.std[-1], self.library.controlled_units)

    def predict_observed(self, n_points: int = 30) -> Prediction | None:
        """The rest of the observed agent's movement, under the most probable task or none.

        None at rest.
        """
        run, task = self._most_probable()
        return None if run is None else self._predictor.observed(run, task, n_points)

    def explain(self, task: str | None = None, rival: str | None = None) -> Evidence | None:
        """Evidence for a task against a rival, by observation and observed DOF; None at rest.

        The movement is filtered anew for each observed DOF. Without labels, the most probable task
        is compared with its most probable rival (`explain_movement`).

        Raises:
            ArgumentError: there is no such label, or both are the same.
        """
        run, posterior = self._movements.run, self._movements.posterior
        if run is None or posterior is None:
            return None
        return explain_movement(run, posterior, task, rival)

    def too_sparse(self) -> SparseSignal | None:
        """First signal with too low a rate for onset detection; None if all rates suffice."""
        return self._detector.too_sparse()

    def reset(self) -> None:
        """Forget the movement under way and all past samples, but not the context."""
        self._movements.forget()
        self.expectation.reset()
        self._posture.clear()
        self._detector.clear()
        self._turns.forget()
        self._context.forget_stamps()

    def swap(self, library: TaskLibrary, task_prior: Floats | None = None) -> None:
        """Switch to another library; the movement under way is filtered anew from its onset.

        Raises:
            DofError: the other library has other DOFs, or another context.
            ArgumentError: `task_prior` is not one over its tasks, or no step of the plan that is
                followed is one of its tasks. On an error nothing changes.
        """
        check_same_dofs(self._context.learned, library)
        self._use(library.given(self._context.values), self._bend, task_prior)
        self._context.use(library)

    def _use_context(self, stamp_ns: int = 0) -> None:
        self._use(self._context.apply(stamp_ns), self._bend, self._task_prior)

    def _use(
        self,
        taught: TaskLibrary,
        bend: Callable[[TaskLibrary], TaskLibrary],
        task_prior: Floats | None,
    ) -> None:
        library = bend(taught)
        grid = make_prior_grid(library, task_prior, self._n_scales)
        self.expectation.swap(library, task_prior)  # refuses a library without a task of the plan
        self.taught, self.library, self._bend, self._task_prior = taught, library, bend, task_prior
        turned = self._turns.change(library)
        self._detector.use(library.onset)
        self._detector.change_past(turned)
        self._posture.use(taught)
        self._movements.use(library, grid, turned)
