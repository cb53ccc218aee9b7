# SPDX-License-Identifier: Apache-2.0
"""Results of the online estimator: the estimate after an observation, and predictions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, brief, read_only
from intent_recognition.filtering import MovementFilter, TaskPosterior, TaskPrediction
from intent_recognition.plots import (
    Axes,
    Figure,
    by_unit,
    draw_bands,
    draw_shares,
    name_lines,
    new_panels,
)
from intent_recognition.promp import NONE, StartPosture, Trajectory
from intent_recognition.recognition.start_posture import OnsetPosture


class Estimate(NamedTuple):
    """Task, phase and onset after an observation.

    Attributes:
        stamp_ns: stamp of the observation.
        moving: whether a movement is under way; if not, `none` is certain and the rest is zero.
        onset_ns: stamp at which the movement began; 0 at rest.
        probabilities: probabilities of the K tasks and none, (K + 1,), in the order of `labels`.
        phase: expected phase given each task, (K + 1,); 0 for none.
        log_evidence: log evidence of each task since onset, (K + 1,).
        posterior: the whole posterior; None at rest.
        labels: labels of the K tasks, and "none".
    """

    stamp_ns: int
    moving: bool
    onset_ns: int
    probabilities: Floats
    phase: Floats
    log_evidence: Floats
    posterior: TaskPosterior | None
    labels: tuple[str, ...]

    def __repr__(self) -> str:
        """Stamp and most probable task; the arrays are attributes."""
        if not self.moving:
            return f"<Estimate at {self.stamp_ns * 1e-9:.3f} s: at rest>"
        best = int(np.argmax(self.probabilities))
        return (
            f"<Estimate at {self.stamp_ns * 1e-9:.3f} s: {self.task}, probability"
            f" {self.probabilities[best]:.3f}, phase {self.phase[best]:.2f}>"
        )

    @classmethod
    def idle(cls, stamp_ns: int, labels: tuple[str, ...]) -> Estimate:
        """Estimate at rest, with the labels of the K tasks and none."""
        zero, certain = np.zeros(len(labels)), np.zeros(len(labels))
        certain[-1] = 1.0
        return cls(stamp_ns, False, 0, certain, zero, zero.copy(), None, labels)

    @classmethod
    def of(
        cls, stamp_ns: int, onset_ns: int, posterior: TaskPosterior, labels: tuple[str, ...]
    ) -> Estimate:
        """Estimate of a movement under way."""
        phase = np.append(posterior.phase[:-1], 0.0)  # none has no end
        shown = posterior.probabilities, phase, posterior.log_evidence
        return cls(stamp_ns, True, onset_ns, *shown, posterior, labels)

    @property
    def task(self) -> str:
        """Label of the most probable task, or "none"."""
        return self.labels[int(np.argmax(self.probabilities))]

    @property
    def task_probabilities(self) -> dict[str, float]:
        """Probability of each task and of "none", by label."""
        return dict(zip(self.labels, self.probabilities.tolist(), strict=True))

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the probability of each task and of "none" as bars; needs matplotlib.

        Args:
            axes: axes to draw into; those of a new figure by default.

        Returns:
            The axes.
        """
        axes = new_panels()[1][0, 0] if axes is None else axes
        draw_shares(axes, self.labels, self.probabilities)
        state = f"phase {self.phase[self.probabilities.argmax()]:.2f}" if self.moving else "at rest"
        axes.set_title(f"{self.stamp_ns * 1e-9:.2f} s, {state}")
        return axes


@brief
class Prediction(NamedTuple):
    """Trajectory of one agent under the most probable task."""

    task: str
    onset_ns: int  # stamp from which the trajectory's times count
    trajectory: Trajectory  # means and standard deviations
    # use of the controlled agent's posture at onset: POSTURE_USED, POSTURE_OUTSIDE (of the trained
    # starts), POSTURE_UNKNOWN, or empty for the observed agent
    start: str = ""
    names: tuple[str, ...] = ()  # names of the d DOFs of the trajectory
    units: tuple[str, ...] = ()  # units of the DOFs

    def plot(self) -> Figure:
        """Draw the trajectory with bands of two standard deviations; needs matplotlib.

        Returns:
            The figure, with a panel per unit.
        """
        mean, std = self.trajectory.positions, self.trajectory.std
        names = self.names or tuple(f"DOF {k}" for k in range(mean.shape[1]))
        panels = by_unit(self.units or ("",) * len(names))
        figure, axes = new_panels(len(panels))
        for panel, (unit, dofs) in zip(axes[:, 0], panels, strict=True):
            shown = [names[k] for k in dofs]
            draw_bands(panel, self.trajectory.times_s, mean[:, dofs], std[:, dofs], shown)
            name_lines(panel)
            panel.set_ylabel(f"predicted [{unit}]" if unit else "predicted")
        figure.suptitle(self.task, parse_math=False)
        return figure


class Predictor:
    """Predicts the movement under way; keeps the last prediction until its inputs change.

    `posture` is the controlled agent's posture at onset.
    """

    def __init__(self, posture: OnsetPosture):
        self._posture = posture
        # by number of points: inputs of the last prediction, and the prediction
        self._last: dict[int, tuple[TaskPrediction, StartPosture | None, Prediction]] = {}

    def controlled(self, run: MovementFilter, task: int, n_points: int) -> Prediction:
        """Trajectory of the controlled agent over the whole interaction, under a task."""
        library, of_task, last = run.library, run.prediction(task), self._last.get(n_points)
        start, used, turns = self._posture.at_onset(task)
        if last is None or (last[0], last[2].start) != (of_task, used) or last[1] is not start:
            along = of_task.controlled(n_points, start)
            turned = along._replace(positions=along.positions + turns)
            names, units = library.controlled_names, library.controlled_units
            found = Prediction(library.labels[task], run.onset_ns, turned, used, names, units)
            self._last[n_points] = last = of_task, start, read_only(found)
        return last[2]

    def controlled_at(self, run: MovementFilter, known: Floats, times_s: Floats) -> Trajectory:
        """Trajectory of the controlled agent at some times (T,), as a mixture over known tasks.

        Times are on the clock of the observations; `known` are the tasks' probabilities, (K,).
        """
        known = np.maximum(known, 1e-12)  # above zero even if `none` is certain
        given = [self._posture.at_onset(task) for task in range(len(known))]
        since_s = np.maximum(times_s - run.onset_ns * 1e-9, 0.0)
        half_s = 0.005  # velocities are central differences
        around_s = np.concatenate([since_s, since_s + half_s, since_s - half_s])
        mean, std = run.mixture_at(around_s, known, [start for start, _, _ in given])
        mean, after, before = np.split(mean, 3)
        velocities = (after - before) / (2.0 * half_s)
        turns = given[int(np.argmax(known))][2]
        return Trajectory(times_s, mean + turns, velocities, std[: len(times_s)])

    def observed(self, run: MovementFilter, task: int, n_points: int) -> Prediction:
        """The rest of the observed agent's movement, under the task with an index, or none, K."""
        library, trajectory = run.library, run.prediction(task).observed(n_points)
        names, units = library.observed_names, library.observed_units
        label = (*library.labels, NONE)[task]
        return Prediction(label, run.onset_ns, trajectory, names=names, units=units)
