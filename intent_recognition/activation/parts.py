# SPDX-License-Identifier: Apache-2.0
"""The parts that the transitions of the activation share."""

from intent_recognition.activation.arm_tracking import ArmTracking
from intent_recognition.activation.inbox import EstimatorInbox
from intent_recognition.activation.motions import Motions
from intent_recognition.activation.people import People
from intent_recognition.activation.pretrigger import Pretrigger
from intent_recognition.activation.settings import ActivationSettings, Common


class Parts:
    """The arm, its motions, the people and the pretrigger, with the same settings."""

    def __init__(self, common: Common):
        self.common, self.counts = common, common.counts
        self.arm, self.people = ArmTracking(common), People(common)
        self.motions = Motions(common, self.arm)
        self.pretrigger = Pretrigger(common.settings.pretrigger, common.settings.decision)

    @property
    def settings(self) -> ActivationSettings:
        """The settings in force."""
        return self.common.settings

    @property
    def inbox(self) -> EstimatorInbox:
        """Inbox of the person whom the arm attends to."""
        return self.people.inbox
