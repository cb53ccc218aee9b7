# SPDX-License-Identifier: Apache-2.0
"""Executions and pushes of the feedback experiment, and their statistics."""

from typing import NamedTuple

import numpy as np

from experiments.feedback.controller import (
    FeedbackPolicy,
    FeedbackSettings,
    feedback_policy,
    initial_state,
    propagate,
)
from experiments.feedback.runs import Push, execute
from experiments.pointing.study import condition_on_end, final_wrist
from experiments.settings import Settings
from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.errors import TrainingError
from intent_recognition.gaussian import Gaussian
from intent_recognition.kinematics import jacobian
from intent_recognition.learning import learn_with_report
from intent_recognition.promp import TaskLibrary, dof_variance
from intent_recognition.signals import Demonstration

TASK = "plate_handover"
DESIGN = FeedbackSettings(disturbance=0.3, bandwidth_rad_s=20.0, n_times=801)
N_RUNS, N_RUNS_QUICK = 60, 6
"""Executions by each controller, and in a quick run."""
PUSH_N = (0.0, 10.0, 0.0)
"""Force of a sideways push at the hand, world [N]."""
PUSH_S, WINDOW_S, AFTER_S = 0.3, 0.8, 0.6
"""Length of a push, time from its start in which its effect counts, and time simulated after the
movement [s]."""
CONTROLLERS = ("stochastic feedback", "low gain")


class Reproduced(NamedTuple):
    """Executions by one controller.

    Attributes:
        positions_rad: (n, T, 7).
        saturated_steps: physics steps with a torque at its limit, over all runs.
    """

    positions_rad: Floats
    saturated_steps: int

    @property
    def mean(self) -> Floats:
        """Over the runs (T, 7) [rad]."""
        return self.positions_rad.mean(axis=0)

    @property
    def std(self) -> Floats:
        """Over the runs (T, 7) [rad]."""
        return self.positions_rad.std(axis=0, ddof=1)


class Pushed(NamedTuple):
    """One push at the hand.

    Attributes:
        start_s: start of the push [s].
        spread_m: std of the hand along the push, in the primitive during the window.
        deflection_m: the hand's largest displacement in the window from the start of the push on,
            per controller (2,).
        left_m: its displacement when the movement is over, per controller (2,).
    """

    start_s: float
    spread_m: float
    deflection_m: Floats
    left_m: Floats


def learn_handover(settings: Settings) -> tuple[TaskLibrary, Gaussian, Demonstration]:
    """The library, mean and covariance of the demonstrations' own weights, a test recording."""
    dofs = load_dofs()
    folders = sorted(settings.recordings("toolbox/train").glob(f"{TASK}_*"))
    recordings, _ = read_demonstrations(folders[:6] if settings.quick else folders, dofs)
    held_out = sorted(settings.recordings("toolbox/test").glob(f"{TASK}_*"))
    tests, _ = read_demonstrations(held_out[:1], dofs)
    if not tests:
        raise TrainingError.about("bags", f"a test recording of {TASK}", "none", "Add one.")
    report = learn_with_report(recordings)
    library = report.library
    examples = report.trained.tasks[TASK].examples
    weights = np.array([one.weights[library.n_observed :].ravel() for one in examples])
    return library, Gaussian(weights.mean(axis=0), np.cov(weights, rowvar=False)), tests[0]


def joint_std(library: TaskLibrary, weights: Gaussian) -> Floats:
    """Std of each joint on the policy's grid (T, 7) [rad]."""
    design = library.basis.design_matrix(np.linspace(0.0, 1.0, DESIGN.n_times))
    return np.sqrt(dof_variance(design, weights.covariance))


def stiffer_after_the_human(library: TaskLibrary, test: Demonstration) -> Floats:
    """Stiffness at the end once the human's hand has arrived, over that before (7,)."""
    part = slice(library.n_observed_weights, None)
    stiffness = []
    for weights in (library.primitive(0).weights, condition_on_end(library, final_wrist(test))):
        arm = Gaussian(weights.mean[part], weights.covariance[part, part])
        duration = float(library.durations_s[0])
        stiffness.append(feedback_policy(library.basis, arm, duration, DESIGN).stiffness[-1])
    return stiffness[1] / stiffness[0]


def reproduce(settings: Settings, policy: FeedbackPolicy, n_runs: int, which: int) -> Reproduced:
    """Executions from drawn starts; both controllers get the same starts and disturbances."""
    runs = []
    for k in range(n_runs):
        settings.progress(0.15 + 0.35 * (which + k / n_runs), f"{CONTROLLERS[which]}, run {k + 1}")
        rng = np.random.default_rng([settings.seed, 71, k])
        start = initial_state(policy, rng)
        length = float(policy.times_s[-1])
        runs.append(execute(policy, start, length, low_gain=bool(which), rng=rng))
    positions = np.array([one.positions_rad for one in runs])
    return Reproduced(positions, sum(one.saturated_steps for one in runs))


def push_arm(policy: FeedbackPolicy, count: int) -> list[Pushed]:
    """Push the undisturbed arm sideways at several times of the mean movement."""
    length = float(policy.times_s[-1]) + AFTER_S
    start = policy.mean[0]
    free = [execute(policy, start, length, low_gain=bool(k)).hand_m for k in range(2)]
    found = []
    for start_s in np.linspace(0.4, policy.times_s[-1] - PUSH_S, count):
        push = Push(float(start_s), PUSH_S, PUSH_N)
        until = round((push.start_s + WINDOW_S) * 100.0) + 1
        away = np.array(
            [
                execute(policy, start, length, low_gain=bool(k), push=push).hand_m - free[k]
                for k in range(2)
            ]
        )
        away = np.linalg.norm(away, axis=2)
        times = push.start_s + np.linspace(0.0, WINDOW_S, 17)
        spread = float(np.sqrt(np.mean([_hand_variance(policy, t) for t in times])))
        found.append(Pushed(push.start_s, spread, away[:, :until].max(axis=1), away[:, -1]))
    return found


def _hand_variance(policy: FeedbackPolicy, time_s: float) -> float:
    """Variance of the hand along the push at a time, linearised at the mean [m^2]."""
    k = min(int(np.searchsorted(policy.times_s, time_s)), len(policy.times_s) - 1)
    n = policy.n_joints
    direction = np.array(PUSH_N) / np.linalg.norm(PUSH_N)
    row = direction @ jacobian(policy.mean[k, :n])[:3]
    return float(row @ policy.covariance[k, :n, :n] @ row)


def std_ratios(policy: FeedbackPolicy, one: Reproduced) -> Floats:
    """Root mean square std of the arm over that of the primitive, per joint (7,)."""
    wanted = _on_samples(policy, policy.std, one)
    return np.sqrt(np.mean(one.std**2, axis=0) / np.mean(wanted**2, axis=0))


def _on_samples(policy: FeedbackPolicy, values: Floats, one: Reproduced) -> Floats:
    """Values (T, 7) of the policy's grid at the arm's samples."""
    times = sample_times(one)
    return np.stack([np.interp(times, policy.times_s, column) for column in values.T], axis=1)


def sample_times(one: Reproduced) -> Floats:
    """Times of the arm's samples (T,) [s]."""
    return 0.01 * np.arange(one.positions_rad.shape[1], dtype=np.float64)


def mean_deviation(policy: FeedbackPolicy, one: Reproduced) -> Floats:
    """Largest deviation of the arm's mean, in the primitive's std, per joint (7,)."""
    n = policy.n_joints
    wanted = _on_samples(policy, policy.mean[:, :n], one)
    return np.abs((one.mean - wanted) / _on_samples(policy, policy.std, one)).max(axis=0)


def linear_errors(policy: FeedbackPolicy) -> tuple[float, float]:
    """Largest errors of mean [rad] and of std [share] of the controlled linear system."""
    n = policy.n_joints
    per_step = 4
    _, moments = propagate(policy, per_step * (len(policy.times_s) - 1))
    mean = np.abs(moments.mean[::per_step, :n] - policy.mean[:, :n]).max()
    std = np.sqrt(np.diagonal(moments.covariance[::per_step], axis1=1, axis2=2)[:, :n])
    return float(mean), float(np.abs(std / policy.std - 1.0).max())
