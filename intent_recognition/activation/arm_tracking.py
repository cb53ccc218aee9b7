# SPDX-License-Identifier: Apache-2.0
"""Where the arm is asked to be and where it is: the commands in force, the joints measured."""

from collections import deque
from typing import NamedTuple

import numpy as np

from intent_recognition.activation.inbox import LARGEST_SKEW_NS, RESTAMP
from intent_recognition.activation.lateness import LATENESSES_NS, ArmClock, Lateness
from intent_recognition.activation.settings import Common
from intent_recognition.activation.states import Command, MotionPoints
from intent_recognition.array_types import Floats
from intent_recognition.motion import JointReference

HELD_WITHIN_RAD = 0.05
"""An arm at rest farther from its reference than this in a joint [rad] was moved by others.
Convention: 3 degrees, more than an arm sags."""
_SLIVER_NS = 1_000_000
"""Samples nearer than this [ns] to a switch are left out. Numerical safeguard: differences of
positions are divided by the square of it."""
_SETTLING_NS = 500_000_000
"""Time an arm needs to settle after the end of a command [ns]. Convention."""
_REST_WINDOW_NS = 100_000_000
"""Without measured velocities, an arm is at rest if its positions say so for this long [ns].
Convention: ten joint states at 100 Hz."""
_REST_RAD_S = 0.05
"""An arm slower than this is at rest [rad/s]; a plan that begins there may be off by `lead_s` times
it. Convention: several times the noise of a measured velocity."""


class Measured(NamedTuple):
    """A joint state: its stamp, when it was measured by our clock; None for no velocity."""

    stamp_ns: int
    time_ns: int
    position: Floats
    velocity: Floats | None


class ArmTracking:
    """Keeps the commands sent and compares the measured arm with them.

    Attributes:
        current: the newest command, which takes over at its start; None before the first.
        late_ns: how long after its start a command had not reached the arm, lately [ns].
        clock: how the stamps of joint states relate to ours.
    """

    def __init__(self, common: Common):
        self._common, self._reject = common, common.reject
        self.forget_joints()
        self.forget_commands()

    def forget_commands(self) -> None:
        """No command is in force any more."""
        self.current: Command | None = None
        self._history: deque[Command] = deque()
        self.last_command_ns = self.late_ns = 0
        self._reported: tuple | None = None
        self._left: Floats | None = None  # where a lost command left the arm
        self._lateness = Lateness()

    def forget_joints(self) -> None:
        """Nothing has been measured yet."""
        self.clock = ArmClock()
        self._measured: Measured | None = None
        self._recent_positions: deque[tuple[int, Floats]] = deque()

    def take_joint_state(
        self, now_ns: int, stamp_ns: int, position: Floats, velocity: Floats | None
    ) -> None:
        """Take what the arm measured, (n,) each [rad, rad/s].

        A stamp far from its arrival is dropped, and so is one that is not after the last; a last
        one that was ahead of the clock rules out none.
        """
        last = self._measured
        if last is not None and stamp_ns <= last.stamp_ns <= now_ns:
            self._reject("joint_state_not_increasing", f"joint_states at {stamp_ns} ns came late")
        elif abs(stamp_ns - now_ns) > LARGEST_SKEW_NS:
            ahead = stamp_ns > now_ns
            reason = "joint_state_in_future" if ahead else "joint_state_outdated"
            where = "ahead of" if ahead else "behind"
            seconds = abs(stamp_ns - now_ns) * 1e-9
            cure = "" if ahead else f". {RESTAMP}"
            self._reject(reason, f"joint_states stamped {seconds:.1f} s {where} the clock{cure}")
        else:
            self.clock.hear(now_ns, stamp_ns)
            self.clock.compare(stamp_ns, position, self._asked)
            age_ns = self._common.settings.max_joint_state_age_s * 1e9
            time_ns = self.clock.measured_ns(now_ns, stamp_ns, age_ns)
            self._measured = measured = Measured(stamp_ns, time_ns, position, velocity)
            self._remember(measured)
            self._look_for_lateness(measured)

    def _look_for_lateness(self, measured: Measured) -> None:
        time_ns = measured.time_ns
        if not self._history or not self._lateness.is_due(time_ns):
            return
        asked = [self._by(time_ns - late).at(time_ns).position for late in LATENESSES_NS.tolist()]
        late_ns = self._lateness.shown_ns(time_ns, measured.position, np.array(asked))
        if late_ns > self.late_ns:
            self.late_ns = late_ns
            text = "a command came after its start: the next ones lead by more"
            self._report_once("commands_late", None, text)

    def lost(self, now_ns: int) -> bool | None:
        """Whether the command that has ended did not reach the arm; None: not known yet.

        The arm then rests where the command before led it, or where another lost one left it.
        """
        measured = self._recent(now_ns)
        if measured is None or self.current is None:
            return False
        before = list(self._history)[-2:-1]
        rests_at = [command.at(measured.time_ns).position for command in before]
        rests_at += [] if self._left is None else [self._left]
        if rests_at and self._error(measured) > HELD_WITHIN_RAD:
            if measured.time_ns <= self.current.end_ns + _SETTLING_NS:
                return None
            off = np.abs(measured.position - np.array(rests_at)).max(axis=1)
            if off.min() <= HELD_WITHIN_RAD and self.at_rest(measured):
                self._left = measured.position
                text = "the arm rests where the command before the last one led it"
                self._report_once("command_lost", self.last_command_ns, text)
                return True
        self._left = None
        return False

    @property
    def clocks(self) -> dict[str, str]:
        """For diagnostics: how late commands are, how far stamps are behind, and ages by what."""
        by_stamp = self.clock.by_stamp(self._common.settings.max_joint_state_age_s * 1e9)
        return {
            "commands late [s]": f"{self.late_ns * 1e-9:.3f}",
            "joint states behind": f"{self.clock.offset_ns * 1e-9:.3f} s",
            "joint states' age by": "stamp" if by_stamp else "arrival",
        }

    def _remember(self, measured: Measured) -> None:
        """Keep the positions of the last while, the first of them older than the window."""
        recent = self._recent_positions
        recent.append((measured.time_ns, measured.position))
        while len(recent) > 2 and recent[1][0] <= measured.time_ns - _REST_WINDOW_NS:
            recent.popleft()

    def at_rest(self, measured: Measured) -> bool:
        """Whether the arm stands still: by its velocity, else by its positions of a while.

        Positions are too few, or too old to be of one movement: not known, so not at rest.
        """
        if measured.velocity is not None:
            return bool(np.abs(measured.velocity).max() <= _REST_RAD_S)
        times_ns, positions = zip(*self._recent_positions, strict=True)
        span_ns = times_ns[-1] - times_ns[0]
        gap_ns = max(np.diff(times_ns), default=span_ns)
        if span_ns < _REST_WINDOW_NS or gap_ns > self._common.settings.max_joint_state_age_s * 1e9:
            return False
        return bool(np.ptp(np.array(positions), axis=0).max() <= _REST_RAD_S * span_ns * 1e-9)

    def put_in_force(self, now_ns: int, command: Command) -> Command:
        """Note that a command holds from its start on; returns it as it is to be sent."""
        if not self.under_way(now_ns):
            self.late_ns = round(0.9 * self.late_ns)
        elif command.start_ns - now_ns > 2e9 * self._common.settings.command_period_s:
            command = command._replace(before=self._samples(now_ns, command.start_ns))
        self.current = command
        self._history.append(command)
        while len(self._history) > 1 and self._history[1].start_ns < now_ns - 2 * LARGEST_SKEW_NS:
            self._history.popleft()
        self.last_command_ns = now_ns
        return command

    def _samples(self, now_ns: int, end_ns: int) -> MotionPoints | None:
        """What is in force until just before a time, at switches and samples; None for no time."""
        starts_ns = [command.start_ns for command in self._history]
        times_ns = [np.array([now_ns])]
        for command, until_ns in zip(self._history, [*starts_ns[1:], end_ns], strict=True):
            own_ns = command.start_ns + np.rint(command.plan.times_s * 1e9).astype(np.int64)
            times_ns.append(own_ns[(own_ns < until_ns)])
        every_ns = np.unique(np.concatenate(times_ns))
        inside = (every_ns >= now_ns + _SLIVER_NS) & (every_ns <= end_ns - _SLIVER_NS)
        every_ns = every_ns[inside | ((every_ns == now_ns) & (now_ns < end_ns))]
        references = [self._reference(int(time_ns)) for time_ns in every_ns]
        if not references:
            return None
        rows = zip(*[(r.position, r.velocity) for r in references if r is not None], strict=True)
        return MotionPoints(every_ns, *(np.array(row) for row in rows))

    def under_way(self, now_ns: int) -> bool:
        """Whether the command in force has not come to rest."""
        return self.current is not None and now_ns < self.current.end_ns

    def switch_ns(self, now_ns: int) -> int:
        """When a command planned now takes over; never before the one in force does.

        The lead grows with the lateness of commands, so that the next ones are in time.
        """
        ahead = now_ns + round(self._common.settings.lead_s * 1e9 + 1.5 * self.late_ns)
        return ahead if self.current is None else max(ahead, self.current.start_ns)

    def phase(self, now_ns: int) -> float:
        """Share of the predicted interaction that the command in force has done, 1 without one."""
        return 1.0 if self.current is None else self.current.phase_at(now_ns).phase

    def in_force(self) -> Command:
        """The newest command, where one must have been sent."""
        if self.current is None:
            raise RuntimeError("no command is in force")
        return self.current

    def compared(self) -> tuple[Measured, JointReference] | None:
        """The newest joint state, and what was asked for then; None without either."""
        measured = self._measured
        reference = None if measured is None else self._reference(measured.time_ns)
        return None if measured is None or reference is None else (measured, reference)

    def is_update_due(self, now_ns: int) -> bool:
        """Whether a running plan may be updated again, but for the jitter of a timer."""
        return now_ns - self.last_command_ns >= 0.9 * self._common.settings.command_period_s * 1e9

    def fresh(self, now_ns: int) -> bool:
        """Whether the measured arm is recent; reported once for each joint state that is not."""
        return self._recent(now_ns) is not None

    def follows(self, now_ns: int) -> bool:
        """Whether the arm is where it was told to be; reported once a command."""
        measured = self._recent(now_ns)
        return measured is not None and self._is_near(measured)

    def _is_near(self, measured: Measured) -> bool:
        """Whether the measured arm is near its reference then; reported once a command."""
        error = self._error(measured)
        if error <= self._common.settings.max_tracking_error_rad:
            return True
        text = f"arm is {error:.2f} rad off its reference"
        self._report_once("arm_off_reference", self.last_command_ns, text)
        return False

    def off_command(self, now_ns: int) -> str:
        """Why the command in force may not go on by what the arm measured, or an empty text."""
        measured = self._recent(now_ns)
        if measured is None:
            return "stale_joint_states"
        return "" if self._is_near(measured) else "arm_off_reference"

    def start_reference(self, now_ns: int, start_ns: int) -> JointReference | None:
        """Where a new motion starts from: the reference, or the arm if others moved it.

        None if the arm's state is not known, the arm is off its path under way, or others are
        moving it. Where the arm was moved, no command is in force any more.
        """
        measured, current = self._recent(now_ns), self.current
        if measured is None:
            return None
        if current is not None:
            settled = measured.time_ns > current.end_ns + _SETTLING_NS
            largest = self._common.settings.max_tracking_error_rad
            if self._error(measured) <= (min(largest, HELD_WITHIN_RAD) if settled else largest):
                return current.at(start_ns)
        if self.under_way(now_ns):
            self._report_once("arm_off_reference", self.last_command_ns, "arm is off its path")
            return None
        if not self.at_rest(measured):
            self._report_once("arm_moving", measured.stamp_ns, "arm is moved by others")
            return None
        self.current = None
        self._history.clear()
        self._lateness = Lateness()
        return JointReference.at_rest(measured.position)

    def _recent(self, now_ns: int) -> Measured | None:
        measured = self._measured
        age_ns = self._common.settings.max_joint_state_age_s * 1e9
        if measured is not None and now_ns - measured.time_ns <= age_ns:
            return measured
        old = f" for {(now_ns - measured.time_ns) * 1e-9:.2f} s" if measured else ""
        stamp_ns = None if measured is None else measured.stamp_ns
        self._report_once("stale_joint_states", stamp_ns, f"no joint state was measured{old}")
        return None

    def _reference(self, time_ns: int) -> JointReference | None:
        return self._by(time_ns).at(time_ns) if self._history else None

    def _by(self, time_ns: int) -> Command:
        """The command in force at a time; there must have been one."""
        due = (command for command in reversed(self._history) if command.start_ns <= time_ns)
        return next(due, self._history[0])

    def _asked(self, time_ns: int) -> Floats | None:
        """Where the arm is asked to be at a time, (n,) [rad]."""
        reference = self._reference(time_ns)
        return None if reference is None else reference.position

    def _error(self, measured: Measured) -> float:
        """Largest difference between the measured arm and its reference then [rad]."""
        asked = self._asked(measured.time_ns)
        return 0.0 if asked is None else float(np.abs(measured.position - asked).max())

    def _report_once(self, reason: str, key: object, text: str) -> None:
        if self._reported != (reason, key):
            self._reported = (reason, key)
            self._reject(reason, text)


def same_posture(a: Floats, b: Floats) -> bool:
    """Whether two postures (n,) [rad] are as good as the same."""
    return bool(np.abs(a - b).max() <= 1e-3)  # about 1 mm at the hand
