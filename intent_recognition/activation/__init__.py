# SPDX-License-Identifier: Apache-2.0
"""From task probabilities and predictions to the robot's motion: a state machine without ROS.

Each file holds one part of the machine: a decision, a plan or a comparison with the arm.
"""

from intent_recognition.activation.lateness import ArmClock
from intent_recognition.activation.pretrigger import PretriggerSettings
from intent_recognition.activation.settings import ActivationSettings
from intent_recognition.activation.state_machine import Activation
from intent_recognition.activation.states import Command, Mode, PredictedInteraction
