# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node `primitive_activation`, and the settings made of them."""

import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter

from intent_recognition.errors import ArgumentError, IntentError, describe
from intent_recognition.kinematics.limits import JointLimits
from intent_recognition.kinematics.lwr import DEFAULT_ACCELERATION_RAD_S2, JOINT_NAMES, LWR_LIMITS
from intent_recognition.kinematics.planning import scaled_limits
from intent_recognition.nodes.runtime import parameter
from intent_recognition.promp.activation_settings import ActivationSettings
from intent_recognition.promp.decision import DecisionSettings
from intent_recognition.promp.posture import start_mean
from intent_recognition.promp.pretrigger import PretriggerSettings

DOUBLES = Parameter.Type.DOUBLE_ARRAY


class RejectionError(IntentError):
    """An input that is not acted on, with the reason it is counted under."""

    def __init__(self, reason: str, text: str):
        super().__init__(text)
        self.reason = reason


def check_trajectory(times_s: np.ndarray, positions: np.ndarray, rest) -> None:
    """Raise what is wrong with a predicted trajectory, under the reason it is counted by."""
    if len(times_s) < 2:
        raise RejectionError("too_few_points", f"intent/robot_trajectory of {len(times_s)} points")
    arrays = (times_s, positions, *rest.values())
    if not all(np.all(np.isfinite(array)) for array in arrays):
        raise RejectionError("not_finite", "intent/robot_trajectory holds NaN or infinity")
    if times_s[0] < 0.0 or np.min(np.diff(times_s)) <= 0.0:
        raise RejectionError("non_monotone_times", "time_from_start of intent/robot_trajectory")


class ActivationParameters:
    """Declares all of them on a node; read once, at its start.

    Attributes:
        rate_hz: updates of a running motion a second.
    """

    def __init__(self, node: Node):
        def get(name, default, description, minimum=None, maximum=None):
            return parameter(
                node, name, default, description, minimum=minimum, maximum=maximum, read_only=True
            )

        self._model = get("model", "", "Model file whose joints to check; empty: none.")
        self._decision = DecisionSettings(
            threshold=get("threshold", 0.9, "Probability a task must reach.", 0.501, 1.0),
            n_observations=get("n_observations", 5, "Observations on end it must hold.", 1, 10000),
            max_end_std_rad=get(
                "max_end_std", 0.35, "Largest predicted end-point std [rad].", 1e-6, 1e6
            ),
            release_below=get(
                "release_below", 0.5, "Let go of a task less probable than this.", 0.0, 0.5
            ),
            min_evidence=get(
                "min_evidence", 0.6, "Share of the movement's own evidence it must have.", 0.0, 0.99
            ),
        )
        self.rate_hz = get("command_rate", 25.0, "Updates of a running motion [Hz].", 1.0, 200.0)
        self._home = get("home", DOUBLES, "Posture to return to [rad]; empty: the first seen.")
        self._names = get("joint_names", [], "Joint names; empty: from model or prediction.")
        self._lower = get("lower", DOUBLES, "Lower position limits [rad]; empty: the LWR's.")
        self._upper = get("upper", DOUBLES, "Upper position limits [rad]; empty: the LWR's.")
        self._velocity = get("velocity", DOUBLES, "Velocity limits [rad/s]; empty: the LWR's.")
        self._acceleration = get(
            "acceleration_limit",
            DEFAULT_ACCELERATION_RAD_S2,
            "Acceleration limit of every joint [rad/s^2].",
            0.1,
            1000.0,
        )
        self._velocity_scale = get(
            "velocity_scale", 0.9, "Share of the velocity limits to use.", 0.01, 1.0
        )
        self._times = {
            "timeout_s": get("timeout", 0.5, "Silence that stops a motion [s].", 0.01, 60.0),
            "hold_s": get("hold_time", 1.0, "Stay at the end this long [s].", 0.0, 3600.0),
            "lead_s": get("switch_lead", 0.05, "Commands take over so far ahead [s].", 0.0, 1.0),
            "max_joint_state_age_s": get(
                "max_joint_state_age", 0.25, "Older joint states are stale [s].", 0.001, 10.0
            ),
            "max_tracking_error_rad": get(
                "max_tracking_error", 0.4, "Largest distance to the reference [rad].", 0.001, 10.0
            ),
            "max_lateness_s": get(
                "max_lateness", 3.0, "A prediction over for longer is outdated [s].", 0.0, 1e9
            ),
        }
        self._pretrigger_threshold = get(
            "pretrigger_threshold",
            0.0,
            "Go ahead for a next task at least so probable; 0: never. Needs a model.",
            0.0,
            1.0,
        )
        self._pretrigger_timeout_s = get(
            "pretrigger_timeout", 10.0, "Wait there for the human at most so long [s].", 0.1, 3600.0
        )
        self._return_home = get("return_home", True, "Go home after each interaction.")

    def joints(self) -> tuple[tuple[str, ...], dict[str, np.ndarray]]:
        """Joint names, empty where they are not known yet, and where each task begins.

        Raises:
            ArgumentError: names and model differ, or a model is missing.
        """
        names = tuple(name for name in self._names if name)
        if self._model:
            return _read_model(self._model, names)
        if self._pretrigger_threshold > 0.0:
            cure = "Set model, or leave pretrigger_threshold at 0."
            raise ArgumentError(describe("pretrigger_threshold", "0 without a model", "more", cure))
        return names, {}

    def settings(self, names: tuple[str, ...], starts: dict[str, np.ndarray]) -> ActivationSettings:
        """How to act, for these joints.

        Args:
            names: of the joints.
            starts: where each task begins, label to (n,) [rad].

        Raises:
            RejectionError: the limits of a joint are not known.
            ArgumentError: limits or home of another size.
        """
        home = np.array(self._home, dtype=np.float64) if self._home else None
        if home is not None and (home.shape != (len(names),) or not np.all(np.isfinite(home))):
            raise ArgumentError(
                describe("home", f"{len(names)} finite angles", self._home, "One a joint [rad].")
            )
        return ActivationSettings(
            limits=self._limits_of(names),
            decision=self._decision,
            home=home,
            return_home=self._return_home,
            pretrigger=PretriggerSettings(
                self._pretrigger_threshold, self._pretrigger_timeout_s, starts
            ),
            command_period_s=1.0 / self.rate_hz,
            **self._times,
        )

    def _limits_of(self, names: tuple[str, ...]) -> JointLimits:
        """Limits from the parameters, else the LWR's by joint name.

        Raises:
            RejectionError: a joint is none of the LWR's and no limits are given.
            ArgumentError: limits of another size.
        """
        given = (self._lower, self._upper, self._velocity)
        acceleration = np.full(len(names), self._acceleration)
        if all(given):
            limits = JointLimits(
                *(np.array(values) for values in given), acceleration, np.full(len(names), 1e9)
            )
        elif set(names) <= set(JOINT_NAMES) and len(set(names)) == len(names) > 0:
            at = [JOINT_NAMES.index(name) for name in names]
            arrays = (LWR_LIMITS.lower, LWR_LIMITS.upper, LWR_LIMITS.velocity)
            limits = JointLimits(
                *(array[at] for array in arrays), acceleration, LWR_LIMITS.torque[at]
            )
        else:
            text = f"{list(names)}: set lower, upper and velocity for joints not of the LWR"
            raise RejectionError("wrong_joint_names", text)
        return scaled_limits(limits, self._velocity_scale)


def _read_model(path: str, names: tuple[str, ...]) -> tuple[tuple[str, ...], dict[str, np.ndarray]]:
    """Joint names of a model file, and where each task begins: label to (n,) [rad].

    Raises:
        ArgumentError: its joints differ from `names`.
    """
    from intent_recognition.storage.model import load_model  # only when a model is named

    model = load_model(path)
    of_model = tuple(model.controlled_names)
    if names and names != of_model:
        raise ArgumentError(
            describe(
                "joint_names", f"those of the model {path}: {of_model}", names, "Leave one away."
            )
        )
    starts = {label: start_mean(model.library, k) for k, label in enumerate(model.labels)}
    return of_model, starts
