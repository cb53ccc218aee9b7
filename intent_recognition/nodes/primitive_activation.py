# SPDX-License-Identifier: Apache-2.0
"""Node: recognised task and predicted trajectory to the arm's `joint_trajectory`."""

import time
from collections.abc import Sequence

import numpy as np
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ArgumentError, IntentError, describe
from intent_recognition.kinematics.limits import JointLimits
from intent_recognition.kinematics.lwr import DEFAULT_ACCELERATION_RAD_S2, JOINT_NAMES, LWR_LIMITS
from intent_recognition.kinematics.path import make_path
from intent_recognition.kinematics.planning import scaled_limits
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    TrajectoryBuilder,
    joint_values,
    stamp_ns,
    trajectory_arrays,
)
from intent_recognition.nodes.lifecycle import ManagedNode
from intent_recognition.nodes.runtime import Diagnostics, parameter, run
from intent_recognition.promp.activation import Activation
from intent_recognition.promp.activation_settings import (
    ActivationSettings,
    Command,
    Mode,
    Prediction,
)
from intent_recognition.promp.decision import DecisionSettings
from intent_recognition.promp.posture import start_mean
from intent_recognition.promp.pretrigger import PretriggerSettings

_OK, _WARN = 0, 1
_DOUBLES = Parameter.Type.DOUBLE_ARRAY


class PrimitiveActivation(ManagedNode):
    """Translates messages to `promp.activation.Activation` and its commands to messages.

    Joint names come from the model file, or from the first acceptable trajectory when no model
    is given. All times are those of the node's clock, so that it works on simulated time.
    """

    def __init__(self, **kwargs):
        super().__init__("primitive_activation", **kwargs)
        self.diagnostics = Diagnostics(self)
        self._declare()
        self.activation: Activation | None = None
        self.joint_names: tuple[str, ...] = ()
        self._builder: TrajectoryBuilder | None = None
        self._latest_tasks: JointState | None = None
        self._published_task: str | None = None
        self._commands = self.create_publisher(JointTrajectory, "joint_trajectory", qos.COMMAND)
        self._task = self.create_publisher(String, "intent/active_task", qos.LATCHED)
        for kind, topic, handle, profile in (
            (JointState, "intent/tasks", self._on_tasks, qos.STATE),
            (JointTrajectory, "intent/robot_trajectory", self._on_prediction, qos.COMMAND),
            (JointState, "joint_states", self._on_joint_states, qos.STATE),
            (JointState, "intent/next_task", self._on_next_task, qos.LATCHED),
        ):
            self.create_subscription(kind, topic, handle, profile)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self._timer = self.create_timer(1.0 / self._rate_hz, self._on_timer)
        self.start()

    def _declare(self) -> None:
        def get(name, default, description, minimum=None, maximum=None):
            return parameter(
                self, name, default, description, minimum=minimum, maximum=maximum, read_only=True
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
        self._rate_hz = get("command_rate", 25.0, "Updates of a running motion [Hz].", 1.0, 200.0)
        self._home = get("home", _DOUBLES, "Posture to return to [rad]; empty: the first seen.")
        self._names = get("joint_names", [], "Joint names; empty: from model or prediction.")
        self._lower = get("lower", _DOUBLES, "Lower position limits [rad]; empty: the LWR's.")
        self._upper = get("upper", _DOUBLES, "Upper position limits [rad]; empty: the LWR's.")
        self._velocity = get("velocity", _DOUBLES, "Velocity limits [rad/s]; empty: the LWR's.")
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

    # Lifecycle

    def configure(self) -> None:
        """Read the model, if one is named, and fix the joints where they are known."""
        names = tuple(name for name in self._names if name)
        self._starts = {}
        if self._model:
            names, self._starts = _read_model(self._model, names)
        elif self._pretrigger_threshold > 0.0:
            cure = "Set model, or leave pretrigger_threshold at 0."
            raise ArgumentError(describe("pretrigger_threshold", "0 without a model", "more", cure))
        if names:
            self._set_joints(names)

    def activate(self) -> None:
        """Begin to act, from a clean state."""
        if self.joint_names:
            self._set_joints(self.joint_names)
        self._publish_task()

    def deactivate(self) -> None:
        """Brake the arm along its path and forget the interaction."""
        if self.activation is not None:
            self._publish(self.activation.halt(self._now_ns()))
        self._publish_task()

    # Messages in

    def _on_tasks(self, message: JointState) -> None:
        self.diagnostics.tick("intent/tasks")
        if not self.active or self.activation is None:
            return
        start_s = time.perf_counter()
        probabilities = np.array(message.position, dtype=np.float64)
        evidence = np.array(message.effort, dtype=np.float64) if message.effort else None
        try:
            self.activation.take_tasks(
                self._now_ns(), stamp_ns(message), list(message.name), probabilities, evidence
            )
        except IntentError as error:
            self.diagnostics.reject("bad_tasks", str(error))
            return
        if self._step():
            self.diagnostics.latency(time.perf_counter() - start_s)

    def _on_prediction(self, message: JointTrajectory) -> None:
        self.diagnostics.tick("intent/robot_trajectory")
        if not self.active:
            return
        start_s = time.perf_counter()
        prediction = self._read_prediction(message)
        if prediction is None:
            return
        self.activation.take_prediction(self._now_ns(), prediction)
        if self._step():
            self.diagnostics.latency(time.perf_counter() - start_s)

    def _read_prediction(self, message: JointTrajectory) -> Prediction | None:
        """The prediction, or None if it is rejected; fixes the joints if they are not yet."""
        names = tuple(message.joint_names)
        label = message.header.frame_id
        try:
            if self.joint_names and names != self.joint_names:
                raise _RejectionError("wrong_joint_names", f"{list(names)} for {self.joint_names}")
            if not label:
                raise _RejectionError(
                    "no_task", "intent/robot_trajectory without a task in frame_id"
                )
            times_s, positions, rest = trajectory_arrays(message)
            _check_trajectory(times_s, positions, rest)
            if self.activation is None:
                self._set_joints(names)
            path = make_path(times_s, positions, self._limits, rest.get("velocities"))
        except _RejectionError as error:
            self.diagnostics.reject(error.reason, str(error))
            return None
        except IntentError as error:
            self.diagnostics.reject("wrong_size", str(error))
            return None
        end_std = float(np.max(rest["effort"][-1])) if "effort" in rest else None
        onset_ns = stamp_ns(message) and stamp_ns(message) + round(float(times_s[0]) * 1e9)
        return Prediction(label, onset_ns, path, end_std)

    def _on_joint_states(self, message: JointState) -> None:
        self.diagnostics.tick("joint_states")
        if not self.active or self.activation is None:
            return
        try:
            position = joint_values(message, self.joint_names)
            velocity = np.zeros_like(position)
            if message.velocity:
                velocity = joint_values(message, self.joint_names, "velocity")
        except IntentError as error:
            self.diagnostics.reject("joint_states_incomplete", str(error))
            return
        if not (np.all(np.isfinite(position)) and np.all(np.isfinite(velocity))):
            self.diagnostics.reject("joint_states_not_finite", "joint_states holds NaN or infinity")
        elif stamp_ns(message) == 0:
            self.diagnostics.reject("joint_states_zero_stamp", "joint_states without a stamp")
        else:
            self.activation.take_joint_state(stamp_ns(message), position, velocity)

    def _on_next_task(self, message: JointState) -> None:
        self.diagnostics.tick("intent/next_task")
        if not self.active or self.activation is None:
            return
        try:
            self.activation.pretrigger.take_expectation(
                stamp_ns(message), list(message.name), np.array(message.position)
            )
        except IntentError as error:
            self.diagnostics.reject("bad_next_task", str(error))

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.activation is not None and self.active:
            self._publish(self.activation.reset(self._now_ns()))
            self._publish_task()
        response.success = self.active
        response.message = "interaction forgotten" if self.active else "the node is not active"
        return response

    def _on_timer(self) -> None:
        if self.active and self.activation is not None:
            self._step()

    # Messages out

    def _step(self) -> bool:
        """Let the state machine act; whether a command was sent."""
        now_ns = self._now_ns()
        command = self.activation.step(now_ns)
        self._publish(command)
        self._publish_task()
        self._report()
        return command is not None

    def _publish(self, command: Command | None) -> None:
        if command is None:
            return
        plan = command.plan
        message = self._builder.build(
            command.start_ns, plan.times_s, plan.positions, plan.velocities
        )
        self._commands.publish(message)
        self.diagnostics.tick("joint_trajectory")

    def _publish_task(self) -> None:
        task = "" if self.activation is None else self.activation.active_task
        if task != self._published_task:
            self._published_task = task
            self._task.publish(String(data=task))
            self.get_logger().info(f"active task: {task or 'none'}")

    def _report(self) -> None:
        activation = self.activation
        self.diagnostics.value("mode", activation.mode.value)
        self.diagnostics.value("active task", activation.active_task or "none")
        for name, count in activation.counts.items():
            self.diagnostics.value(f"count {name}", count)
        self.diagnostics.value("expected task", activation.pretrigger.expected or "none")
        if activation.mode is Mode.STOPPED:
            self.diagnostics.status(_WARN, f"stopped: {activation.stop_reason}")
        elif activation.held_back:
            self.diagnostics.value("last held back", activation.held_back)
            self.diagnostics.status(_WARN, activation.held_back)
        elif activation.mode is Mode.PRETRIGGERED:
            self.diagnostics.status(_OK, f"pretriggered: {activation.pretrigger.label}")
        else:
            self.diagnostics.status(_OK, activation.mode.value)

    # Set-up

    def _set_joints(self, names: tuple[str, ...]) -> None:
        """Fix the joints and start from a clean state; raises if their limits are unknown."""
        self._limits = self._limits_of(names)
        home = np.array(self._home, dtype=np.float64) if self._home else None
        if home is not None and (home.shape != (len(names),) or not np.all(np.isfinite(home))):
            raise ArgumentError(
                describe("home", f"{len(names)} finite angles", self._home, "One a joint [rad].")
            )
        settings = ActivationSettings(
            limits=self._limits,
            decision=self._decision,
            home=home,
            return_home=self._return_home,
            pretrigger=PretriggerSettings(
                self._pretrigger_threshold, self._pretrigger_timeout_s, self._starts
            ),
            command_period_s=1.0 / self._rate_hz,
            **self._times,
        )
        self.activation = Activation(settings, self.diagnostics.reject)
        self.joint_names, self._builder = names, TrajectoryBuilder(names)

    def _limits_of(self, names: tuple[str, ...]) -> JointLimits:
        """Limits from the parameters, else the LWR's by joint name.

        Raises:
            _RejectionError: a joint is none of the LWR's and no limits are given.
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
            raise _RejectionError("wrong_joint_names", text)
        return scaled_limits(limits, self._velocity_scale)

    def _now_ns(self) -> int:
        return self.get_clock().now().nanoseconds


class _RejectionError(IntentError):
    """An input that is not acted on, with the reason it is counted under."""

    def __init__(self, reason: str, text: str):
        super().__init__(text)
        self.reason = reason


def _check_trajectory(times_s: np.ndarray, positions: np.ndarray, rest) -> None:
    """Raise what is wrong with a predicted trajectory, under the reason it is counted by."""
    if len(times_s) < 2:
        raise _RejectionError("too_few_points", f"intent/robot_trajectory of {len(times_s)} points")
    arrays = (times_s, positions, *rest.values())
    if not all(np.all(np.isfinite(array)) for array in arrays):
        raise _RejectionError("not_finite", "intent/robot_trajectory holds NaN or infinity")
    if times_s[0] < 0.0 or np.min(np.diff(times_s)) <= 0.0:
        raise _RejectionError("non_monotone_times", "time_from_start of intent/robot_trajectory")


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


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(PrimitiveActivation, args)
