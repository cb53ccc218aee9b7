# SPDX-License-Identifier: Apache-2.0
from .arm import STEPS_PER_SAMPLE, TIME_STEP_S, SensorNoise, SimulatedArm
from .lock_step import ANSWERING, NO_ANSWER_S, Edge, LockStep
from .robots import NAMES, Robot, describe_robot, find_robot
from .spread_control import BANDWIDTH_RAD_S, DISTURBANCE, SpreadControl
from .state import ArmState
from .surroundings import Surroundings, add_box
from .trajectory_command import RejectedTrajectoryError, TrajectoryCommand
from .trajectory_follower import ArmReference, TrajectoryFollower
from .urdf import add_inertial, add_joint, text_of
from .urdf_loading import load_urdf

__all__ = [
    "ANSWERING",
    "BANDWIDTH_RAD_S",
    "DISTURBANCE",
    "NAMES",
    "NO_ANSWER_S",
    "STEPS_PER_SAMPLE",
    "TIME_STEP_S",
    "ArmReference",
    "ArmState",
    "Edge",
    "LockStep",
    "RejectedTrajectoryError",
    "Robot",
    "SensorNoise",
    "SimulatedArm",
    "SpreadControl",
    "Surroundings",
    "TrajectoryCommand",
    "TrajectoryFollower",
    "add_box",
    "add_inertial",
    "add_joint",
    "describe_robot",
    "find_robot",
    "load_urdf",
    "text_of",
]
