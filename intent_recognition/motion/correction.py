# SPDX-License-Identifier: Apache-2.0
"""Corrections by hand: the running primitive is conditioned on where a person left the arm.

The posture in which the arm was left is a via point of the controlled agent. With the person's
movement and the start kept, its weights become w + K (y - H w), K = C H^T (H C H^T + R)^-1
(Paraschos et al. 2018, "modulation by conditioning"). K does not depend on the prediction, so each
later prediction of the task is conditioned in the same way.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian, condition
from intent_recognition.kinematics import JointLimits
from intent_recognition.motion.bending import Spread
from intent_recognition.motion.deviation import DeviationDetector
from intent_recognition.motion.path import JointPath


class Via(NamedTuple):
    """Where the arm was left: the phase of the movement, and the posture (n,) [rad]."""

    phase: float
    position: Floats


@dataclass(frozen=True, eq=False)
class Correction:
    """How pushes are detected, and how they correct the path."""

    detector: DeviationDetector  # says whether somebody pushes
    # how each task's motion may vary, its start fixed; for a task without a spread the arm yields,
    # and goes on as before
    spreads: Mapping[str, Spread] = field(default_factory=dict)
    # rest after which the person has let go [s]; moving the arm for a shorter time than
    # `detector.sustained_s` is a bump and corrects nothing
    release_s: float = 0.4

    def corrected(
        self, path: JointPath, label: str, vias: Sequence[Via], limits: JointLimits
    ) -> JointPath:
        """A predicted path given the corrections of its task; the path itself if there are none."""
        spread = self.spreads.get(label)
        if spread is None or not vias:
            return path
        phases = np.linspace(0.0, 1.0, 61)
        return path.shifted(phases, corrected_by(spread, path, vias, phases), limits)


def corrected_by(spread: Spread, path: JointPath, vias: Sequence[Via], phases: Floats) -> Floats:
    """How far a path moves at phases (T,) when conditioned on via points, (T, n) [rad]."""
    at = np.array([via.phase for via in vias])
    before = path.spline(at)
    rows = spread.design(at, before)
    rows = rows.reshape(-1, rows.shape[2])
    innovation = (np.array([via.position for via in vias]) - before).ravel()
    noise = 1e-3**2 * np.eye(len(innovation))  # 1 mm at the hand; ten times an encoder's noise
    change, _ = condition(
        Gaussian(np.zeros(rows.shape[1]), spread.covariance), rows, innovation, noise
    )
    return spread.design(phases, path.spline(phases)) @ change.mean


def with_via(vias: Sequence[Via], via: Via) -> tuple[Via, ...]:
    """The corrections with one more, which replaces those of about the same phase."""
    return (*(old for old in vias if abs(old.phase - via.phase) >= 0.1), via)


def phase_of(path: JointPath, position: Floats, first: float) -> float:
    """The phase, from `first` on, at which a path is nearest to a posture (n,)."""
    phases = np.linspace(min(first, 1.0), 1.0, 101)
    distance = np.linalg.norm(path.spline(phases) - position, axis=1)
    return float(phases[np.argmin(distance)])
