# SPDX-License-Identifier: Apache-2.0
"""The wrist's final position decides where the arm points: conditioning, prediction, execution."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.pointing.execution import PointingRun, execute
from experiments.pointing.recordings import PURPOSES
from experiments.pointing.scene import pointed_at
from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.gaussian import Gaussian, condition
from intent_recognition.learning import learn
from intent_recognition.promp import TaskLibrary, Trajectory, rollout
from intent_recognition.signals import Demonstration

HOLD_SAMPLES = 20
"""The wrist's last samples, 0.2 s of holding still, whose mean is the one observation."""
N_POINTS = 60
"""Phases at which a predicted path is evaluated."""


@dataclass(frozen=True)
class Tested:
    """One test spot.

    Attributes:
        index: its number, from 0.
        recording: of the person alone.
        spot_m: the true spot (2,).
        wrist_m: the final measurement (3,).
        posterior: of all weights.
        predicted_m: where the finger would point at the prediction's end (2,).
        spread_m2: covariance of that (2, 2).
        run: on the arm.
    """

    index: int
    recording: Demonstration
    spot_m: Floats
    wrist_m: Floats
    posterior: Gaussian
    predicted_m: Floats
    spread_m2: Floats
    run: PointingRun

    @property
    def error_m(self) -> float:
        """Distance on the table from the spot to where the arm's finger pointed."""
        return float(np.linalg.norm(self.run.pointed_m[:2] - self.spot_m))

    @property
    def inside(self) -> bool:
        """Whether the true spot lies in the prediction's ellipse of 2 sigma (86 %)."""
        off = self.spot_m - self.predicted_m
        return bool(off @ np.linalg.solve(self.spread_m2, off) <= 4.0)


def final_wrist(recording: Demonstration) -> Floats:
    """Mean of the wrist's last samples (3,) [m]."""
    return recording.observed[0].values[-HOLD_SAMPLES:].mean(axis=0)


def condition_on_end(library: TaskLibrary, wrist_m: Floats) -> Gaussian:
    """All weights given the wrist's final position (3,): Maeda et al. 2014, Eq. 6-8 at phase 1."""
    primitive = library.primitive(0).weights
    row = library.basis.design_matrix(np.ones(1))
    matrix = np.zeros((library.n_observed, len(primitive.mean)))
    matrix[:, : library.n_observed_weights] = np.kron(np.eye(library.n_observed), row)
    noise = library.noise_variance[: library.n_observed] * library.noise_scale
    return condition(primitive, matrix, wrist_m, np.diag(noise))[0]


def both_agents(library: TaskLibrary, weights: Gaussian) -> Trajectory:
    """Trajectory of all DOFs over the median duration."""
    phase = np.linspace(0.0, 1.0, N_POINTS)
    duration = float(library.durations_s[0])
    return rollout(library.basis, weights, phase, duration, library.noise_variance)


def predicted_spot(library: TaskLibrary, recording: Demonstration) -> Floats:
    """Where the finger is predicted to point, from a person's final wrist position, (2,) [m]."""
    trajectory = both_agents(library, condition_on_end(library, final_wrist(recording)))
    return pointed_at(trajectory.positions[-1, library.n_observed :])[:2]


def draw(folder: Path) -> dict[str, float]:
    """Largest and mean error of the predicted spots [m], of recordings drawn again.

    The predictions are not executed: the arm points where it is sent, up to the shipped runs'
    `largest_execution_error_m`.
    """
    train, test = (
        read_demonstrations(folder / "pointing" / purpose, load_dofs())[0] for purpose in PURPOSES
    )
    library = learn(train)
    errors = [
        np.linalg.norm(predicted_spot(library, one) - metadata_values(one, "spot_m")[:2])
        for one in test
    ]
    return {"largest_m": float(np.max(errors)), "mean_m": float(np.mean(errors))}


def predict_and_execute(library: TaskLibrary, recording: Demonstration, index: int) -> Tested:
    """Predict from a person's final wrist position, and point with the arm."""
    wrist = final_wrist(recording)
    posterior = condition_on_end(library, wrist)
    trajectory = both_agents(library, posterior)
    n = library.n_observed
    start = recording.controlled[0].values[-1]
    run = execute(
        trajectory.times_s, trajectory.positions[:, n:], trajectory.velocities[:, n:], start
    )
    end = trajectory.positions[-1, n:]
    predicted = pointed_at(end)[:2]
    spread = _spread(end, _end_covariance(library, posterior))
    spot = metadata_values(recording, "spot_m")[:2]
    return Tested(index, recording, spot, wrist, posterior, predicted, spread, run)


def _end_covariance(library: TaskLibrary, weights: Gaussian) -> Floats:
    """Covariance of the controlled DOFs at phase 1, (Q, Q)."""
    row = library.basis.design_matrix(np.ones(1))
    design = np.kron(np.eye(library.n_controlled), row)
    block = weights.covariance[library.n_observed_weights :, library.n_observed_weights :]
    return design @ block @ design.T


def _spread(q: Floats, covariance: Floats) -> Floats:
    """Covariance of the pointed position (2, 2), linearised at a posture (7,)."""
    step = 1e-5
    slopes = (pointed_at(q + step * np.eye(7)) - pointed_at(q - step * np.eye(7))) / (2.0 * step)
    return slopes[:, :2].T @ covariance @ slopes[:, :2]


def metadata_values(recording: Demonstration, key: str) -> Floats:
    """Numbers that metadata hold under a key, separated by spaces, (n,)."""
    return np.array([float(value) for value in recording.metadata[key].split()])


def nearest_errors(train: list[Demonstration], tested: list[Tested]) -> Floats:
    """Error of repeating the demonstration whose final wrist is nearest, (n,) [m]."""
    wrists = np.array([final_wrist(one) for one in train])
    pointed = np.array([metadata_values(one, "robot_pointed_m")[:2] for one in train])
    nearest = [np.argmin(np.linalg.norm(wrists - one.wrist_m, axis=1)) for one in tested]
    spots = np.array([one.spot_m for one in tested])
    return np.linalg.norm(pointed[nearest] - spots, axis=1)
