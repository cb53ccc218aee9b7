# SPDX-License-Identifier: Apache-2.0
"""From task probabilities and predictions to the robot's motion: a state machine without ROS.

One machine in a file for each thing that it decides, plans or compares the arm with.
"""

from intent_recognition.activation.pretrigger import PretriggerSettings
from intent_recognition.activation.settings import ActivationSettings
from intent_recognition.activation.state_machine import Activation
from intent_recognition.activation.states import Command, Mode, PredictedInteraction
