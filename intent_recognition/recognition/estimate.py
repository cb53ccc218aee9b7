# SPDX-License-Identifier: Apache-2.0
"""What the online estimator gives: the estimate after an observation, and predictions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, brief
from intent_recognition.filtering import TaskPosterior
from intent_recognition.plots import (
    Axes,
    Figure,
    by_unit,
    draw_bands,
    draw_shares,
    name_lines,
    new_panels,
)
from intent_recognition.promp import Trajectory


class Estimate(NamedTuple):
    """Task, phase and onset after an observation.

    Attributes:
        stamp_ns: of the observation.
        moving: whether a movement is under way; when not, `none` is certain and the rest is zero.
        onset_ns: when it began, 0 when idle.
        probabilities: of the K tasks and none, (K + 1,), in the order of `labels`.
        phase: expected phase given each task, (K + 1,).
        log_evidence: of each task since onset, (K + 1,).
        posterior: the whole of it, None when idle.
        labels: of the K tasks, and "none".
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
        """When, and what is most probable; the arrays are attributes."""
        if not self.moving:
            return f"<Estimate at {self.stamp_ns * 1e-9:.3f} s: at rest>"
        best = int(np.argmax(self.probabilities))
        return (
            f"<Estimate at {self.stamp_ns * 1e-9:.3f} s: {self.task}, probability"
            f" {self.probabilities[best]:.3f}, phase {self.phase[best]:.2f}>"
        )

    @classmethod
    def idle(cls, stamp_ns: int, labels: tuple[str, ...]) -> Estimate:
        """The estimate at rest, with the labels of the K tasks and none."""
        zero, certain = np.zeros(len(labels)), np.zeros(len(labels))
        certain[-1] = 1.0
        return cls(stamp_ns, False, 0, certain, zero, zero.copy(), None, labels)

    @classmethod
    def of(
        cls, stamp_ns: int, onset_ns: int, posterior: TaskPosterior, labels: tuple[str, ...]
    ) -> Estimate:
        """The estimate of a movement under way."""
        shown = posterior.probabilities, posterior.phase, posterior.log_evidence
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
            axes: to draw into; a new figure by default.

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
    onset_ns: int  # the stamp from which the trajectory's times count
    trajectory: Trajectory  # means and standard deviations
    # what became of the controlled agent's posture at onset: POSTURE_USED, POSTURE_OUTSIDE,
    # POSTURE_UNKNOWN, or empty for the observed agent
    start: str = ""
    names: tuple[str, ...] = ()  # of the d DOFs of the trajectory
    units: tuple[str, ...] = ()

    def plot(self) -> Figure:
        """Draw the trajectory with bands of two standard deviations; needs matplotlib.

        Returns:
            The figure: a panel for each unit.
        """
        mean, std = self.trajectory.positions, self.trajectory.std
        names = self.names or tuple(f"DOF {k}" for k in range(mean.shape[1]))
        panels = by_unit(self.units or ("",) * len(names))
        figure, axes = new_panels(len(panels))
        for panel, (unit, dofs) in zip(axes[:, 0], panels, strict=True):
            shown = [names[k] for k in dofs]
            draw_bands(panel, self.trajectory.times_s, mean[:, dofs], std[:, dofs], shown)
            name_lines(panel)
            panel.set_ylabel(f"[{unit}]" if unit else "")
        figure.suptitle(self.task, parse_math=False)
        return figure
