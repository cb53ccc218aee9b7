# SPDX-License-Identifier: Apache-2.0
"""Where the arm is asked to be and where it is: the commands in force, the joints measured."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.activation.settings import ActivationSettings, Command
from intent_recognition.motion import JointReference


class _Measured(NamedTuple):
    stamp_ns: int
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]


class ArmTracking:
    """Keeps the commands sent and compares the measured arm with them.

    Args:
        settings: tolerances and lead.
        reject: called with (reason, text) for everything not acted on.

    Attributes:
        current: the newest command, which takes over at its start; None before the first.
        last_command_ns: when it was sent.
    """

    def __init__(self, settings: ActivationSettings, reject: Callable[[str, str], None]):
        self.settings = settings
        self._reject = reject
        self._measured: _Measured | None = None
        self.forget_commands()

    def forget_commands(self) -> None:
        """No command is in force any more."""
        self.current: Command | None = None
        self._previous: Command | None = None
        self.last_command_ns = 0
        self._reported: tuple | None = None

    def forget_joints(self) -> None:
        """Nothing has been measured yet."""
        self._measured = None

    def take_joint_state(
        self, stamp_ns: int, position: NDArray[np.float64], velocity: NDArray[np.float64]
    ) -> None:
        """Take what the arm measured, (n,) each [rad, rad/s]."""
        if self._measured is None or stamp_ns > self._measured.stamp_ns:
            self._measured = _Measured(stamp_ns, position, velocity)
        else:
            self._reject("joint_state_not_increasing", f"joint_states at {stamp_ns} ns came late")

    def send(self, now_ns: int, command: Command) -> Command:
        """Put a command in force from its start on."""
        self._previous, self.current = self.current, command
        self.last_command_ns = now_ns
        return command

    def under_way(self, now_ns: int) -> bool:
        """Whether the command in force has not come to rest."""
        return self.current is not None and now_ns < self.current.end_ns

    def switch_ns(self, now_ns: int) -> int:
        """When a command planned now takes over; never before the one in force does."""
        ahead = now_ns + round(self.settings.lead_s * 1e9)
        return ahead if self.current is None else max(ahead, self.current.start_ns)

    def phase(self, now_ns: int) -> float:
        """Share of the predicted interaction that the command in force has done, 1 without one."""
        return 1.0 if self.current is None else self.current.phase_at(now_ns)[0]

    def in_force(self) -> Command:
        """The newest command, where one must have been sent."""
        if self.current is None:
            raise RuntimeError("no command is in force")
        return self.current

    def fresh(self, now_ns: int) -> bool:
        """Whether the measured arm is recent; reported once for each joint state that is not."""
        return self._recent(now_ns) is not None

    def follows(self, now_ns: int) -> bool:
        """Whether the arm is where it was told to be; reported once a command."""
        measured = self._recent(now_ns)
        if measured is None:
            return False
        error = self._error(measured)
        if error <= self.settings.max_tracking_error_rad:
            return True
        text = f"arm is {error:.2f} rad off its reference"
        self._report_once("arm_off_reference", self.last_command_ns, text)
        return False

    def start_reference(self, now_ns: int, start_ns: int) -> JointReference | None:
        """Where a new motion starts from: the reference, or the arm if others moved it.

        None if the arm's state is not known, the arm is off its path under way, or others are
        moving it. Where the arm was moved, no command is in force any more.
        """
        measured, current = self._recent(now_ns), self.current
        if measured is None:
            return None
        if current is not None and self._error(measured) <= self.settings.max_tracking_error_rad:
            return current.at(start_ns)
        if current is not None and now_ns < current.end_ns:
            self._report_once("arm_off_reference", self.last_command_ns, "arm is off its path")
            return None
        if np.abs(measured.velocity).max() > self.settings.rest_speed_rad_s:
            self._report_once("arm_moving", measured.stamp_ns, "arm is moved by others")
            return None
        self._previous = self.current = None
        return JointReference.at_rest(measured.position)

    def _recent(self, now_ns: int) -> _Measured | None:
        """The measured arm, None where it is stale."""
        measured = self._measured
        age_ns = self.settings.max_joint_state_age_s * 1e9
        if measured is not None and abs(now_ns - measured.stamp_ns) <= age_ns:
            return measured
        stamp_ns = None if measured is None else measured.stamp_ns
        self._report_once("stale_joint_states", stamp_ns, "no recent joint_states")
        return None

    def _reference(self, time_ns: int) -> JointReference | None:
        """What the arm is asked for at a time, by the command in force then."""
        late = self.current is None or time_ns >= self.current.start_ns
        command = self.current if late else self._previous
        return None if command is None else command.at(time_ns)

    def _error(self, measured: _Measured) -> float:
        """Largest difference between the measured arm and its reference then [rad]."""
        reference = self._reference(measured.stamp_ns)
        if reference is None:
            return 0.0
        return float(np.abs(measured.position - reference.position).max())

    def _report_once(self, reason: str, key: object, text: str) -> None:
        """Reject, once as long as reason and key stay the same."""
        if self._reported != (reason, key):
            self._reported = (reason, key)
            self._reject(reason, text)
