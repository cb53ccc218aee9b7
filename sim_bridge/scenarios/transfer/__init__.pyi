# SPDX-License-Identifier: Apache-2.0
from .cell import OBJECTS, TransferCell, TransferObject
from .robot_side import SAMPLE_STEPS, RobotSide, TransferSample
from .trials import DISTURBANCES, KINDS, TRANSFERS, TransferOutcome, TransferTrial, run_trial

__all__ = [
    "DISTURBANCES",
    "KINDS",
    "OBJECTS",
    "SAMPLE_STEPS",
    "TRANSFERS",
    "RobotSide",
    "TransferCell",
    "TransferObject",
    "TransferOutcome",
    "TransferSample",
    "TransferTrial",
    "run_trial",
]
