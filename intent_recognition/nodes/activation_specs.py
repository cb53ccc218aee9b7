# SPDX-License-Identifier: Apache-2.0
"""What the parameters of the node `primitive_activation` are: default, meaning and range."""

from dataclasses import dataclass
from typing import Any

from rclpy.parameter import Parameter

from intent_recognition.kinematics import DEFAULT_ACCELERATION_RAD_S2
from intent_recognition.recognition import MAX_WRONG

DOUBLES = Parameter.Type.DOUBLE_ARRAY


@dataclass(frozen=True)
class ParameterSpec:
    """Default, description and range of a parameter, as `parameter` takes them."""

    default: Any
    description: str
    minimum: float | None = None
    maximum: float | None = None


OF_ARM = "empty: those of robot_description, else the LWR's"
FIXED = {
    "model": ParameterSpec("", "Model file whose joints are checked; empty: no check."),
    "command_rate": ParameterSpec(
        25.0,
        "Updates of a running motion [Hz]; a larger value follows new predictions sooner.",
        1.0,
        200.0,
    ),
    "command_action": ParameterSpec(
        "",
        "Action control_msgs/action/FollowJointTrajectory of the controller, such as "
        "joint_trajectory_controller/follow_joint_trajectory, that commands go to as goals; empty: "
        "they go to the topic joint_trajectory.",
    ),
    "joint_names": ParameterSpec([], "Joint names; empty: from model or prediction."),
    "lower": ParameterSpec(DOUBLES, f"Lower position limits [rad]; {OF_ARM}."),
    "upper": ParameterSpec(DOUBLES, f"Upper position limits [rad]; {OF_ARM}."),
    "velocity": ParameterSpec(DOUBLES, f"Velocity limits [rad/s]; {OF_ARM}."),
}
"""Parameters by name that are read once, at the start."""

ARM_LIMITS = ("lower", "upper", "velocity")
"""Parameters that each replace a limit of the arm; for unknown joints all of them are needed."""

AT_REST = {
    "home": ParameterSpec(DOUBLES, "Posture to return to [rad]; empty: the first seen."),
    "acceleration_limit": ParameterSpec(
        DEFAULT_ACCELERATION_RAD_S2,
        "Acceleration limit of every joint [rad/s^2]; a larger value starts and stops harder.",
        0.1,
        1000.0,
    ),
    "velocity_scale": ParameterSpec(
        0.9, "Share of the velocity limits to use; a larger value moves faster.", 0.01, 1.0
    ),
}
"""Parameters that may change while no motion is under way: a plan is made for one set of limits."""

ANY_TIME = {
    "max_wrong": ParameterSpec(
        MAX_WRONG,
        "Share of interactions with new people that may be acted on wrongly, as the model's "
        "demonstrations bound it; a larger value acts earlier, or asks less often.",
        0.001,
        0.5,
    ),
    "threshold": ParameterSpec(
        0.0,
        "Probability from which a task may move the arm, instead of max_wrong; a larger value acts "
        "later and errs less. 0: by max_wrong, and 0.9 with a model that tells nothing of it.",
        0.0,
        1.0,
    ),
    "n_observations": ParameterSpec(
        5,
        "Consecutive observations for which a task must be above threshold, or below "
        "release_below; a larger value acts and gives up later.",
        1,
        10000,
    ),
    "max_end_std": ParameterSpec(
        0.0,
        "Largest standard deviation of the predicted end with which the arm moves [rad]; a "
        "larger value acts earlier and ends less accurately; 0: as learned, 0.35 without a "
        "model.",
        0.0,
        1e6,
    ),
    "release_below": ParameterSpec(
        0.5,
        "The active task is given up where another one, or none, is more probable than one minus "
        "this; a larger value gives it up sooner.",
        0.0,
        0.5,
    ),
    "min_evidence": ParameterSpec(
        0.6,
        "Probability that a task must have by the movement alone, whatever usually comes "
        "next; a larger value leaves less to habit.",
        0.0,
        0.99,
    ),
    "timeout": ParameterSpec(
        0.5,
        "Time without an observation after which the arm slows to a stop [s]; a larger value "
        "bridges longer gaps.",
        0.01,
        60.0,
    ),
    "hold_time": ParameterSpec(
        1.0,
        "Time at the end of a motion before the arm goes home [s]; a larger value stays longer.",
        0.0,
        3600.0,
    ),
    "switch_lead": ParameterSpec(
        0.05,
        "Time between planning a command and the moment it takes effect [s]; a larger value "
        "allows slower planning and delivery, and reacts later.",
        0.0,
        1.0,
    ),
    "max_joint_state_age": ParameterSpec(
        0.25,
        "Age above which a joint state is not used [s]; a larger value allows a slower stream.",
        0.001,
        10.0,
    ),
    "max_tracking_error": ParameterSpec(
        0.4,
        "Distance of a joint from its reference at which the arm is stopped [rad]; a larger "
        "value allows an arm that lags more.",
        0.001,
        10.0,
    ),
    "max_lateness": ParameterSpec(
        3.0,
        "Time since the end of a predicted motion after which it is not started any more [s];"
        " a larger value starts later ones.",
        0.0,
        1e9,
    ),
    "pretrigger_threshold": ParameterSpec(
        0.0,
        "Probability of the next task from which the arm goes to its start before the human "
        "moves; a larger value does so less often; 0: never. Needs a model.",
        0.0,
        1.0,
    ),
    "pretrigger_timeout": ParameterSpec(
        10.0,
        "Time for which the arm waits there for the human before it goes home [s]; a larger "
        "value waits longer.",
        0.1,
        3600.0,
    ),
    "return_home": ParameterSpec(True, "Go home after each interaction."),
    "allow_shared_arm": ParameterSpec(
        False,
        "Command the arm although others publish on joint_trajectory, too; else it brakes and"
        " begins nothing while they do. The package's page is not counted.",
    ),
}
"""Parameters that may change at any time, with effect from the next observation or plan on."""

GUARDS = (
    *("velocity_scale", "acceleration_limit", "max_wrong", "threshold", "n_observations"),
    *("max_end_std", "timeout", "max_joint_state_age", "max_tracking_error"),
)
"""Parameters that say how fast, how surely and how long the arm is moved."""
