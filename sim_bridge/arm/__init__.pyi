# SPDX-License-Identifier: Apache-2.0
from .arm import STEPS_PER_SAMPLE, TIME_STEP_S, LwrArm, SensorNoise
from .controllers import ControllerGains
from .feedback_runs import Push, execute
from .pacing import Pacer
from .spread_control import SpreadControl
from .trajectory_command import RejectedTrajectoryError, TrajectoryCommand
from .trajectory_follower import TrajectoryFollower
from .urdf import lwr_urdf

__all__ = [
    "STEPS_PER_SAMPLE",
    "TIME_STEP_S",
    "ControllerGains",
    "LwrArm",
    "Pacer",
    "Push",
    "RejectedTrajectoryError",
    "SensorNoise",
    "SpreadControl",
    "TrajectoryCommand",
    "TrajectoryFollower",
    "execute",
    "lwr_urdf",
]
