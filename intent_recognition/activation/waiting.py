# SPDX-License-Identifier: Apache-2.0
"""Where the arm waits between interactions: at home, or where the expected next task begins."""

import numpy as np

from intent_recognition.activation.arm_tracking import same_posture
from intent_recognition.activation.parts import Parts
from intent_recognition.activation.states import (
    ActiveInteraction,
    Command,
    Homing,
    Idle,
    Pretriggered,
    Transition,
)
from intent_recognition.array_types import Floats


class Waiting:
    """Takes the arm there and back; `home` (n,) [rad] is None until it is known."""

    def __init__(self, parts: Parts) -> None:
        self._parts, self._counts = parts, parts.counts
        self._arm, self._motions, self._pretrigger = parts.arm, parts.motions, parts.pretrigger
        self.home: Floats | None = None
        self._brake: Command | None = None
        self._again: Command | None = None  # the way home of an arm that was not there at its end
        self.change()

    def change(self) -> None:
        """Take the home posture from the settings; without one there, the present one stays."""
        settings = self._parts.settings
        if settings.home is not None:
            self.home = np.array(settings.home, dtype=np.float64)

    def go_home(self, now_ns: int, interaction: ActiveInteraction | None) -> Transition | None:
        """Return home, braking first if no plan home starts from the motion under way.

        The motion starts from the running reference, or from where an arm at rest is. An arm that
        is not to return, or has no clear way, stops or rests where it is. None while the posture of
        the arm is unknown.
        """
        under_way = self._arm.under_way(now_ns)
        stays = not self._parts.settings.return_home or self._arm.last_command_ns == 0
        if stays or self.home is None:
            return Transition(Idle(), self._motions.stop(now_ns) if under_way else None)
        start_ns, start = self._arm.switch_ns(now_ns), None
        if not under_way:
            start = self._arm.start_reference(now_ns, start_ns)
            if start is None:
                return None
        command = self._motions.go_home(now_ns, self.home, start)
        goes = command is not None or self._arm.under_way(now_ns)
        return Transition(Homing(interaction) if goes else Idle(), command)

    def go_ahead(self, now_ns: int) -> Transition | None:
        """Go to where the expected next task begins; None if that is not due or not possible."""
        inbox = self._parts.inbox
        label = self._pretrigger.wanted(inbox.idle_since_ns)
        if not label or not inbox.decision.idle or inbox.silent(now_ns):
            return None
        start_ns = self._arm.switch_ns(now_ns)
        start = self._arm.start_reference(now_ns, start_ns)
        if start is None:
            return None
        under_way, command = self._arm.under_way(now_ns), None
        destination = self._arm.in_force().plan.end if under_way else start.position
        if not self._pretrigger.is_near(destination, label):
            target = self._pretrigger.start(label)
            if self.home is not None and self._pretrigger.is_near(self.home, label):
                target = self.home
            command = self._motions.go_ahead(now_ns, start_ns, start, target)
            if command is None:
                self._pretrigger.forget()
                return None
        arrival_ns = now_ns if self._arm.current is None else self._arm.current.end_ns
        self._pretrigger.begin(label, max(now_ns, arrival_ns))
        self._counts["pretriggered"] += 1
        return Transition(Pretriggered(), command)

    def step_homing(self, now_ns: int, state: Homing) -> Transition:
        """Go on home, also after a brake on the way; idle once the arm is there.

        An arm that is off its reference, or without recent joint states, is stopped. It goes on
        after `hold_s`, once its posture is known. An arm that is elsewhere at the end, as after a
        clock that jumped ahead, goes home once more.
        """
        current = self._arm.current
        if self._arm.under_way(now_ns):
            reason = self._arm.off_command(now_ns)
            if not reason:
                return Transition(state, self._motions.keep_pace(now_ns))
            brake = self._motions.stop(now_ns)
            if brake is not None:
                self._counts[f"stopped: {reason}"] += 1
                self._brake = brake
            return Transition(state, brake)
        lost = self._arm.lost(now_ns)
        if lost is None:
            return Transition(state)
        if current is None or (current.plan.kind == "home" and not lost):
            if current is None or current is self._again or not self._arm.elsewhere(now_ns):
                return Transition(Idle())
            home = self.go_home(now_ns, state.interaction) or Transition(state)
            self._again = home.command
            return home
        if current is self._brake and now_ns - current.end_ns < self._parts.settings.hold_s * 1e9:
            return Transition(state)
        if state.interaction is None:
            return self.withdraw(now_ns) or Transition(state)
        return self.go_home(now_ns, state.interaction) or Transition(state)

    def step_ahead(self, now_ns: int, state: Pretriggered) -> Transition:
        """Stay ahead, or withdraw if the movement is of another task or none comes."""
        reason = self._pretrigger.reason_to_withdraw(now_ns, self._parts.inbox.decision)
        if not reason:
            return Transition(state)
        self._counts[f"pretrigger withdrawn: {reason}"] += 1
        return self.withdraw(now_ns) or Transition(Homing(None))

    def withdraw(self, now_ns: int) -> Transition | None:
        """Leave the start of the expected task as `go_home` does, unless home is there."""
        self._pretrigger.end()
        home, current = self.home, self._arm.current
        there = home is not None and current is not None and same_posture(current.plan.end, home)
        if there and self._parts.settings.return_home:
            return Transition(Homing(None) if self._arm.under_way(now_ns) else Idle())
        return self.go_home(now_ns, None)
