# SPDX-License-Identifier: Apache-2.0
"""Sequence of a teaching session: show, record, learn, one step after another."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.commands import TEACHER, Commands
from intent_recognition.dashboard.synthetic_demonstration import (
    SyntheticDemonstration,
    sample_demonstration,
)
from intent_recognition.dashboard.teleoperation import Teleoperation
from intent_recognition.errors import KinematicsError


class TeachingSession:
    """Shows demonstrations and has them recorded; everything runs in the graph's thread."""

    def __init__(self, teleoperation: Teleoperation, commands: Commands, rng: np.random.Generator):
        self._teleoperation, self._commands, self._rng = teleoperation, commands, rng
        self._notify = commands.notify
        self.busy = self.recording = self.learned = self._resumes = False

    def show(
        self, task: str, wrist_goal: Floats, hand_goal: Floats, length_s: float, vary: float
    ) -> None:
        """Record one demonstration of a task, in which wrist and hand move to their goals.

        The goals (3,) [m] are in the world; `vary` is their standard deviation [m] between shows.
        """
        if not self._is_free() or not self._holds_wrist():
            return
        start = self._teleoperation.position
        demonstration, shift = sample_demonstration(self._rng, start, wrist_goal, length_s, vary)
        try:
            home = self._teleoperation.measured()
            posture = self._teleoperation.posture_at(hand_goal + shift)
        except KinematicsError as error:
            self._notify(False, f"the arm cannot go there: {error}")
            return

        def shown() -> None:
            self._finish(lambda: self._go_back(start, home))

        self._begin(task, lambda: self._teleoperation.play(demonstration, posture, shown))

    def start_by_hand(self, task: str) -> None:
        """Start recording what a person drags."""
        if not self._is_free() or not self._holds_wrist():
            return
        self._begin(task, lambda: self._notify(True, "recording: drag the wrist, then the hand"))

    def stop_by_hand(self) -> None:
        """Stop the recording by hand."""
        self._finish(self._rest)

    def drag_hand(self, position: Floats) -> None:
        """Move the arm's hand to a position (3,) [m]; refused while the robot helps."""
        if self._commands.can_switch_help() and self._commands.helping:
            self._notify(False, "the robot helps: begin to record before you drag its hand")
        else:
            self._teleoperation.drag_hand(position)

    def discard(self) -> None:
        """Discard the present recording by hand, or the last recording."""
        if not self.recording and not self._is_free():
            return

        def discarded(ok: bool, text: str) -> None:
            self._over()
            self._notify(ok, text)

        self._commands.trigger(f"{TEACHER}/discard", discarded)

    def learn(self) -> None:
        """Learn the recordings; the robot helps again afterwards."""
        if not self._is_free():
            return
        self.busy = True
        self._notify(True, "learning")
        self._commands.trigger(f"{TEACHER}/learn", self._learned)

    def reach(self, goal: Floats, length_s: float) -> None:
        """Move only the wrist, to see what the robot does."""
        if not self._is_free() or not self._holds_wrist():
            return
        start = self._teleoperation.position
        demonstration, _ = sample_demonstration(self._rng, start, goal, length_s, 0.0)
        self.busy = True
        self._teleoperation.play(demonstration, None, lambda: self._go_back(start, None))

    def _is_free(self) -> bool:
        if self.busy:
            self._notify(False, "wait until what was begun has ended")
        return not self.busy

    def _holds_wrist(self) -> bool:
        if not self._teleoperation.holds_wrist:
            self._notify(False, "take the wrist first")
        return self._teleoperation.holds_wrist

    def _begin(self, task: str, then: Callable[[], None]) -> None:
        """Switch the help off, name the task and start the recorder, one after another."""
        self.busy = True
        calls = self._commands
        steps = [
            partial(calls.set_parameter, TEACHER, "learn_at_stop", False),
            partial(calls.set_parameter, TEACHER, "task", task),
            partial(calls.trigger, f"{TEACHER}/start"),
        ]
        if calls.can_switch_help():
            self._resumes |= calls.helping
            steps.insert(0, partial(calls.robot_helps, False))

        def started() -> None:
            self.recording = True
            self._notify(True, f"recording {task}")
            then()

        self._in_turn(steps, started)

    def _in_turn(self, steps: Sequence[Callable], then: Callable[[], None]) -> None:
        """Call each step after the previous one succeeded; stop at the first failure."""

        def done(ok: bool, text: str) -> None:
            if ok:
                self._in_turn(steps[1:], then)
            else:
                self._over()
                self._notify(False, text)

        steps[0](done) if steps else then()

    def _finish(self, then: Callable[[], None]) -> None:
        def stopped(ok: bool, text: str) -> None:
            self.recording = False
            self._notify(ok, text)
            then()

        self._commands.trigger(f"{TEACHER}/stop", stopped)

    def _go_back(self, start: Floats, home: Floats | None) -> None:
        """Return wrist and arm to their starts, without recording."""
        way = SyntheticDemonstration(
            self._teleoperation.position, start, np.zeros(3), duration_s=1.5, rest_s=0.3
        )
        self._teleoperation.play(way, home, self._rest)

    def _rest(self) -> None:
        self.busy = False

    def _over(self) -> None:
        """End the recording session; the robot helps again if it did before."""
        self.busy = self.recording = False
        if self._resumes and self._commands.can_switch_help():
            self._commands.robot_helps(True, self._resumed)
        self._resumes = False

    def _resumed(self, ok: bool, text: str) -> None:
        if not ok:
            self._notify(ok, text)

    def _learned(self, ok: bool, text: str) -> None:
        if ok:
            self.learned = self._resumes = True
        self._over()
        self._notify(ok, text)
