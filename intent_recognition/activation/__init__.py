# SPDX-License-Identifier: Apache-2.0
"""From task probabilities to the robot's motion: the state machine and what it keeps."""

from intent_recognition.activation.pretrigger import PretriggerSettings
from intent_recognition.activation.settings import ActivationSettings, Command, Mode, Prediction
from intent_recognition.activation.state_machine import Activation

__all__ = [
    "Activation",
    "ActivationSettings",
    "Command",
    "Mode",
    "Prediction",
    "PretriggerSettings",
]
