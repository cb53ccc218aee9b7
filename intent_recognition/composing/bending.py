# SPDX-License-Identifier: Apache-2.0
"""Libraries through via points, which are checked against their spread and the arm's limits."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.composing.via_points import HAND, ViaPoint
from intent_recognition.errors import ArgumentError, IntentError, KinematicsError
from intent_recognition.gaussian import Gaussian
from intent_recognition.kinematics import JOINT_NAMES, LWR_LIMITS, Arm
from intent_recognition.promp import ControlPoint, TaskLibrary, controlled_at, distance_to, through
from intent_recognition.signals import POSITION_FIELDS

LARGEST_DISTANCE = 6.0
"""Mahalanobis distance from its task beyond which a via point is refused: the plate_handover's hand
may be moved by some 9 cm at a third of the way, by 25 to 36 at the end (docs/combining.md)."""
_N_STEPS, _CONVERGED_RAD = 50, 1e-6
"""Largest number of linearisations of a hand, and the step at which they end. Measured: 5 to 7."""


def check_via_points(
    library: TaskLibrary, points: Sequence[ViaPoint], arm: Arm | None = None
) -> None:
    """Check that tasks can pass through via points, within the limits of an arm if it is known.

    Raises:
        ArgumentError: there is no such task or DOF, a point is outside the joints' limits or
            farther than `LARGEST_DISTANCE` from its task, or two points contradict each other.
        KinematicsError: the hand cannot reach a point.
    """
    asked = _asked(library, points, arm)
    bent = through(library, _by_task(asked))
    for reference, cure in (
        (library, "Bring it nearer, give it a larger std, or demonstrate that way."),
        (bent, "It contradicts another via point: give one a larger std, or remove it."),
    ):
        for name, task, control in asked:
            distance = distance_to(reference, task, control)
            if not distance <= LARGEST_DISTANCE:
                expected = f"at most {LARGEST_DISTANCE:g} standard deviations"
                expected += f" from what {library.labels[task]} does at that phase"
                raise ArgumentError.about(f"via point {name}", expected, f"{distance:.1f}", cure)


def bend_all(
    library: TaskLibrary, points: Sequence[ViaPoint], arm: Arm | None = None
) -> TaskLibrary:
    """Library whose tasks pass through all via points.

    Raises:
        IntentError: a task cannot pass through a point; see `check_via_points`.
    """
    return through(library, _by_task(_asked(library, points, arm)))


def _asked(
    library: TaskLibrary, points: Sequence[ViaPoint], arm: Arm | None
) -> list[tuple[str, int, ControlPoint]]:
    return [
        (point.name, task, control_point(library, task, point, arm))
        for point in points
        for task in _tasks(library, point)
    ]


def _by_task(asked: Sequence[tuple[str, int, ControlPoint]]) -> dict[int, list[ControlPoint]]:
    found: dict[int, list[ControlPoint]] = {}
    for _, task, control in asked:
        found.setdefault(task, []).append(control)
    return found


class BentLibrary:
    """Via points for any library; `through` is the function for `IntentEstimator.bend`.

    `not_passed` names the points that the last library could not pass through: a point that was
    possible when it was given may be impossible in another context, or its task may be missing.
    """

    def __init__(self, points: Sequence[ViaPoint] = (), arm: Arm | None = None):
        self.points, self._arm = tuple(points), arm
        self.not_passed: tuple[str, ...] = ()

    def through(self, taught: TaskLibrary) -> TaskLibrary:
        """Library through the points, except those that it cannot pass."""
        self.not_passed = ()
        try:
            return bend_all(taught, self.points, self._arm)
        except IntentError:
            kept: list[ViaPoint] = []
            for point in self.points:
                try:
                    bend_all(taught, [*kept, point], self._arm)
                except IntentError:
                    self.not_passed += (point.name,)
                else:
                    kept.append(point)
            return bend_all(taught, kept, self._arm)


def control_point(
    library: TaskLibrary, task: int, point: ViaPoint, arm: Arm | None = None
) -> ControlPoint:
    """Control point of a task's controlled DOFs for a via point.

    If joints are predicted, the position of the hand is linearised at the most probable posture
    given the point, by the iterated extended Kalman update. For other movements of the person, the
    hand then misses the point by some tenths of a millimetre to 5 mm (docs/combining.md).
    """
    label, names = f"via point {point.name}", library.controlled_names
    phase = point.phase
    if phase is None:
        duration_s = float(library.durations_s[task])
        phase = (point.time_s or 0.0) / duration_s
        if phase > 1.0:
            expected = f"a time of at most {duration_s:.2f} s, as {library.labels[task]} takes"
            raise ArgumentError.about(label, expected, f"{point.time_s:g} s", "Name a phase.")
    # finer than any arm's accuracy, and well above rounding
    covariance = np.diag(np.square(np.maximum(point.std, 1e-6)))
    if point.of_hand:
        goal = np.array(point.values[HAND])
        if columns := hand_columns(names):
            return ControlPoint(phase, np.eye(len(names))[columns], goal, covariance)
        return _at_hand(
            label, controlled_at(library, task, phase), phase, goal, covariance, names, arm
        )
    values = np.array([value for (value,) in point.values.values()])
    if missing := sorted(set(point.values) - set(names)):
        cure = "`intent inspect` of the model names them; hand: [x, y, z] is for the hand."
        raise ArgumentError.about(label, f"DOFs of {', '.join(names)}", ", ".join(missing), cure)
    columns = [names.index(name) for name in point.values]
    _check_limits(label, tuple(point.values), values, arm)
    return ControlPoint(phase, np.eye(len(names))[columns], values, covariance)


def hand_columns(names: Sequence[str]) -> list[int]:
    """Indices of the controlled DOFs that are the position of a hand; empty if joints are."""
    columns = [k for k, name in enumerate(names) if name.endswith(POSITION_FIELDS)]
    return columns if len(columns) == len(POSITION_FIELDS) else []


def _tasks(library: TaskLibrary, point: ViaPoint) -> list[int]:
    if not point.task:
        return list(range(library.n_tasks))
    if point.task not in library.labels:
        expected = f"a task of {', '.join(library.labels)}"
        cure = "Teach it, or name another."
        raise ArgumentError.about(f"via point {point.name}", expected, point.task, cure)
    return [library.labels.index(point.task)]


def _at_hand(
    label: str,
    joints: Gaussian,
    phase: float,
    goal: Floats,
    covariance: Floats,
    names: tuple[str, ...],
    arm: Arm | None,
) -> ControlPoint:
    """Control point J q = y - f(q*) + J q*, at the most probable posture q* given the via point."""
    if arm is None or not set(arm.joint_names) <= set(names):
        known = "no robot_description" if arm is None else f"one of {', '.join(arm.joint_names)}"
        cure = "Start the arm, or give its joints as dofs."
        raise ArgumentError.about(label, "a description of the arm", known, cure)
    columns = [names.index(name) for name in arm.joint_names]
    posture = joints.mean.copy()
    for _ in range(_N_STEPS):
        at = arm.forward_kinematics(posture[columns])[:3, 3]
        jacobian = np.zeros((3, len(names)))
        jacobian[:, columns] = arm.jacobian(posture[columns])[:3]
        values = goal - at + jacobian @ posture
        cross = jacobian @ joints.covariance
        spread = cross @ jacobian.T + covariance
        step = joints.mean + cross.T @ np.linalg.solve(spread, values - jacobian @ joints.mean)
        change, posture = float(np.abs(step - posture).max()), step
        if change < _CONVERGED_RAD:
            break
    missed_m = float(np.linalg.norm(arm.forward_kinematics(posture[columns])[:3, 3] - goal))
    # the same tolerance as in `motion.hand_path`
    if change >= _CONVERGED_RAD or missed_m > 0.005 + 3.0 * np.sqrt(np.trace(covariance)):
        cure = "Bring it nearer to where the hand passes."
        got = f"one that it misses by {missed_m:.3f} m"
        raise KinematicsError.about(label, "a place that the hand can reach", got, cure)
    _check_limits(label, arm.joint_names, posture[columns], arm)
    return ControlPoint(phase, jacobian, values, covariance)


def _check_limits(label: str, names: Sequence[str], values: Floats, arm: Arm | None) -> None:
    """Refuse joints outside the limits of the arm, or of an LWR with these joints' names."""
    known = JOINT_NAMES if arm is None else arm.joint_names
    limits = LWR_LIMITS if arm is None else arm.limits
    for name, value in zip(names, values.tolist(), strict=True):
        if name not in known:
            continue
        k = known.index(name)
        if not limits.lower[k] <= value <= limits.upper[k]:
            expected = f"{name} from {limits.lower[k]:.3f} to {limits.upper[k]:.3f}"
            cure = "Stay within the joint's limits."
            raise ArgumentError.about(label, expected, f"{value:.3f}", cure)
