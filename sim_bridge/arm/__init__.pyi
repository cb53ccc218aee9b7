# SPDX-License-Identifier: Apache-2.0
from .arm import STEPS_PER_SAMPLE, TIME_STEP_S, SensorNoise, SimulatedArm
from .clearances import BulletCell
from .controllers import ControllerGains
from .feedback_controller import (
    FeedbackPolicy,
    FeedbackSettings,
    feedback_policy,
    initial_state,
    propagate,
)
from .feedback_runs import Push, execute
from .fingers import Fingers, with_fingers
from .lock_step import ANSWERING, NO_ANSWER_S, Edge, LockStep
from .pacing import Pacer
from .robots import NAMES, Robot, describe_robot, find_robot
from .spread_control import SpreadControl
from .state import ArmState
from .surroundings import Surroundings
from .trajectory_command import RejectedTrajectoryError, TrajectoryCommand
from .trajectory_follower import TrajectoryFollower
from .urdf import lwr_urdf

__all__ = [
    "ANSWERING",
    "NAMES",
    "NO_ANSWER_S",
    "STEPS_PER_SAMPLE",
    "TIME_STEP_S",
    "ArmState",
    "BulletCell",
    "ControllerGains",
    "Edge",
    "FeedbackPolicy",
    "FeedbackSettings",
    "Fingers",
    "LockStep",
    "Pacer",
    "Push",
    "RejectedTrajectoryError",
    "Robot",
    "SensorNoise",
    "SimulatedArm",
    "SpreadControl",
    "Surroundings",
    "TrajectoryCommand",
    "TrajectoryFollower",
    "describe_robot",
    "execute",
    "feedback_policy",
    "find_robot",
    "initial_state",
    "lwr_urdf",
    "propagate",
    "with_fingers",
]
