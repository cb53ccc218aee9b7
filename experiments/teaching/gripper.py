# SPDX-License-Identifier: Apache-2.0
"""When the hand takes an object of the toolbox assembly, and when it lets it go."""

import numpy as np

from experiments.teaching.objects import ObjectHolder, ToolboxObjects
from intent_recognition.array_types import Floats
from sim_bridge.arm import SimulatedArm
from sim_bridge.coworker import HOLD, TASKS
from sim_bridge.scenarios.toolbox import STANDS_M, takes


class ToolboxGripper:
    """Decides when the hand takes an object and when it lets it go, from where the hand is.

    Plate and screw are taken when the hand passes the stand slowly, and released when it has
    come to rest away from the stand. The screwdriver is taken from the worker when the hand has
    come to rest away from where it was when the task became active. What is still held when the
    task ends goes to the worker.
    """

    def __init__(self, arm: SimulatedArm) -> None:
        self._arm = arm
        self.objects = ToolboxObjects(arm)
        self.task = ""
        self._start_m = np.zeros(3)
        self._rest_since_s: float | None = None
        self._done = False

    @property
    def held(self) -> str:
        """Label of the object in the hand, "" if none."""
        holders = self.objects.holders
        return next((task for task, holder in holders.items() if holder is ObjectHolder.ROBOT), "")

    def set_task(self, task: str) -> None:
        """Take note of the task being executed, "" when idle; unknown labels count as idle."""
        task = task if task in TASKS else ""
        if task == self.task:
            return
        if self.held:
            self.objects.give_to_worker(self.held)
        if task == HOLD:
            self.objects.worker_brings(task)
        elif task:
            self.objects.put_back(task)
        self.task, self._done = task, False
        self._start_m = self._arm.hand_pose().position
        self._rest_since_s = None

    def update(self) -> None:
        """Look at the hand, and take or release; call it every few milliseconds."""
        if not self.task or self._done:
            return
        hand = self._arm.hand_pose().position
        speed = float(np.linalg.norm(self._arm.hand_velocity()))
        if self.task in STANDS_M and not self.held:
            if takes(self.task, hand, speed):
                self.objects.give_to_robot(self.task)
                self._start_m = hand
            return
        if self.held == HOLD or not self._at_rest(hand, speed):
            return
        if self.task == HOLD:
            self.objects.give_to_robot(HOLD)
        else:
            self.objects.give_to_worker(self.task)
            self._done = True

    def _at_rest(self, hand: Floats, speed: float) -> bool:
        """Whether the hand has rested for a while away from where it took or began."""
        away = np.linalg.norm(hand - self._start_m) > 0.12
        if not away or speed > 0.03:
            self._rest_since_s = None
            return False
        if self._rest_since_s is None:
            self._rest_since_s = self._arm.time_s
        return self._arm.time_s - self._rest_since_s >= 0.25
