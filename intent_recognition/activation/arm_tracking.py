# SPDX-License-Identifier: Apache-2.0
"""The arm's reference and its measured state: commands in force and joint states."""

from collections import deque
from typing import NamedTuple

import numpy as np

from intent_recognition.activation.inbox import LARGEST_SKEW_NS, RESTAMP
from intent_recognition.activation.lateness import LATENESSES_NS, ArmClock, Lateness
from intent_recognition.activation.recent_motion import REST_RAD_S, SEEN_NS, RecentMotion
from intent_recognition.activation.settings import Common
from intent_recognition.activation.states import Command, MotionPoints
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import UNLIMITED_RAD
from intent_recognition.motion import JointReference
from intent_recognition.signals import whole_turns

HELD_WITHIN_RAD = 0.05
"""Largest difference from its reference of an arm at rest that nobody moved, per joint [rad]: 3
degrees, more than an arm sags."""
_SLIVER_NS = 1_000_000
"""Least time between a sample and a switch [ns]. Numerical safeguard: differences of positions are
divided by its square."""
_FOLLOWS_NS = 100_000_000
"""Time for which an arm must follow an earlier command, with one lag, to show that the later ones
were lost [ns]: much longer than a push that happens to move it so."""
_MOST_LOST = 10
"""Most commands in a row whose loss is noticed: 0.4 s of updates."""
_SETTLING_NS = 500_000_000
"""Time that an arm may take to settle after the end of a command [ns]."""


class Measured(NamedTuple):
    """A joint state: its stamp, its time by this node's clock, position, velocity if measured."""

    stamp_ns: int
    time_ns: int
    position: Floats
    velocity: Floats | None


class ArmTracking:
    """Keeps the commands sent and compares the measured arm with them.

    Attributes:
        current: the newest command, which takes over at its start; None before the first.
        late_ns: estimated delay of commands beyond their start [ns]; decays from motion to motion.
        clock: relates the stamps of joint states to this node's clock.
        obeys: whether joint states come from an arm rather than a recording. A recording that
            happens to move as commanded would make commands seem late or lost.
    """

    def __init__(self, common: Common):
        self.obeys = True
        self._common, self._reject = common, common.reject
        self.forget_joints()
        self.forget_commands()

    def forget_commands(self) -> None:
        """Forget all commands: none is in force."""
        self.current: Command | None = None
        self._history: deque[Command] = deque()
        self.last_command_ns = self.late_ns = 0
        self._reported: tuple | None = None
        self._lateness = Lateness()
        self._follows: tuple[Command, int, int] | None = None  # command, lag, since when [ns]
        self._moves_unasked = False  # since it last rested where a command asked it to

    def forget_joints(self) -> None:
        """Forget all joint states."""
        self.clock = ArmClock()
        self._measured: Measured | None = None
        self._motion = RecentMotion()

    def take_joint_state(
        self, now_ns: int, stamp_ns: int, position: Floats, velocity: Floats | None
    ) -> bool:
        """Take measured joint positions and velocities, (n,) each [rad, rad/s].

        Rejects a stamp farther than `LARGEST_SKEW_NS` from its arrival, and one that is not later
        than the last stamp, unless the last stamp was ahead of the clock.

        Returns whether they are used.
        """
        last = self._measured
        if last is not None and stamp_ns <= last.stamp_ns <= now_ns:
            self._reject("joint_state_not_increasing", f"joint_states at {stamp_ns} ns came late")
        elif abs(stamp_ns - now_ns) > LARGEST_SKEW_NS:
            reason, where = "joint_state_outdated", f"behind the clock. {RESTAMP}"
            if stamp_ns > now_ns:
                reason, where = "joint_state_in_future", "ahead of the clock"
            seconds = abs(stamp_ns - now_ns) * 1e-9
            self._reject(reason, f"joint_states stamped {seconds:.1f} s {where}")
        else:
            self.clock.hear(now_ns, stamp_ns)
            position = self._in_turn(stamp_ns, position)
            self.clock.compare(stamp_ns, position, self._asked)
            age_ns = self._common.settings.max_joint_state_age_s * 1e9
            time_ns = self.clock.measured_ns(now_ns, stamp_ns, age_ns)
            self._measured = measured = Measured(stamp_ns, time_ns, position, velocity)
            if last is not None and time_ns - last.time_ns > age_ns:
                self._lateness = Lateness()  # its samples are evenly spaced
            self._motion.remember(time_ns, position)
            if self._history and self.obeys and self._lateness.is_due(time_ns):
                self._look_for_lateness(measured)
                self._look_for_loss(measured)
        return self._measured is not last

    def _in_turn(self, stamp_ns: int, position: Floats) -> Floats:
        """A posture (n,) whose joints without limits, which drivers wrap to one turn, are near.

        They are brought by whole turns to the reference, the last posture or home.
        """
        settings, last = self._common.settings, self._measured
        near = settings.home if last is None else last.position
        if self._history:
            near = self._asked(stamp_ns)
        if near is None:
            return position
        width = settings.limits.upper - settings.limits.lower
        turns = whole_turns(position - near, np.where(width > UNLIMITED_RAD, 2.0 * np.pi, np.nan))
        return np.asarray(position - turns)

    def _look_for_lateness(self, measured: Measured) -> None:
        time_ns = measured.time_ns
        asked = [self._by(time_ns - late).at(time_ns).position for late in LATENESSES_NS.tolist()]
        late_ns = self._lateness.shown_ns(time_ns, measured.position, np.array(asked))
        if late_ns > self.late_ns and not self._moves_unasked:
            self.late_ns = late_ns
            text = "a command came after its start: the next ones lead by more"
            self._report_once("commands_late", None, text)

    def _look_for_loss(self, measured: Measured) -> None:
        """Return to an earlier command if the arm goes on along that one, with the same lag.

        Commands may come as late as `LATENESSES_NS`; an arm at rest may be held by somebody.
        """
        time_ns, before, self._follows = measured.time_ns, self._follows, None
        too_new = self.current is None or time_ns - self.current.start_ns < LATENESSES_NS[-1]
        if too_new or (self._speed() or 0.0) <= REST_RAD_S:
            return
        n, least = len(self._history), self._off(measured).min()
        if least <= HELD_WITHIN_RAD:
            return
        for kept in range(n - 1, max(n - _MOST_LOST, 1) - 1, -1):
            command, off = self._history[kept - 1], self._off(measured, kept)
            if command.end_ns < time_ns:
                return
            if off.min() < 0.25 * least:
                lag, since_ns = int(np.argmin(off)), time_ns
                if before and before[0] is command and abs(before[1] - lag) <= 1:
                    lag, since_ns = before[1:]
                self._follows = command, lag, since_ns
                if time_ns - since_ns >= _FOLLOWS_NS:
                    self._return_to(command, "goes on along")
                return

    def _return_to(self, command: Command, does: str) -> None:
        """Forget the commands after this one, which never reached the arm."""
        while self._history[-1] is not command:
            self._history.pop()
        self.current, self._lateness, self._follows = command, Lateness(), None
        text = f"the arm {does} an earlier command: the last one never reached it, or it is held"
        self._report_once("command_lost", self.last_command_ns, text)

    def _off(self, measured: Measured, n: int | None = None) -> Floats:
        """Largest distance of a joint from the first n commands, for each lag (n_lags,) [rad]."""
        times_ns = (measured.time_ns - LATENESSES_NS).tolist()
        asked = [self._by(time_ns, n).at(time_ns).position for time_ns in times_ns]
        return self._common.settings.limits.largest(np.array(asked) - measured.position)

    def lost(self, now_ns: int) -> bool | None:
        """Whether the command that has ended never reached the arm; None while that is unknown.

        If so, the arm rests at the end of the command before, which is in force again.
        """
        measured = self._recent(now_ns)
        if self._measured is None or not self._history or not self.obeys:
            return False
        if measured is None:
            return None
        if self._error(measured) <= HELD_WITHIN_RAD:
            return False
        *before, ended = self._history
        if measured.time_ns <= ended.end_ns + _SETTLING_NS:
            return None
        if not before:
            return False
        off = measured.position - before[-1].at(measured.time_ns).position
        held = self._common.settings.limits.largest(off) <= HELD_WITHIN_RAD
        lost = held and self.at_rest(measured)
        if lost:
            self._return_to(before[-1], "rests at the end of")
        return bool(lost)

    def elsewhere(self, now_ns: int) -> bool:
        """Whether the arm is not where the command that has ended asks it to be."""
        measured = self._recent(now_ns)
        return self.obeys and measured is not None and self._error(measured) > HELD_WITHIN_RAD

    @property
    def clocks(self) -> dict[str, str]:
        """For diagnostics: delay of commands, offset of stamps, and by which time ages count."""
        by_stamp = self.clock.by_stamp(self._common.settings.max_joint_state_age_s * 1e9)
        return {
            "commands late [s]": f"{self.late_ns * 1e-9:.3f}",
            "joint states behind": f"{self.clock.offset_ns * 1e-9:.3f} s",
            "joint states' age by": "stamp" if by_stamp else "arrival",
        }

    def at_rest(self, measured: Measured) -> bool:
        """Whether the arm is at rest, judged by its velocity or else by its recent positions."""
        if measured.velocity is None:
            speed = self._speed()
            return speed is not None and speed <= REST_RAD_S
        return bool(self._common.settings.limits.largest(measured.velocity) <= REST_RAD_S)

    def _speed(self, *least_ns: int) -> float | None:
        settings = self._common.settings
        return self._motion.speed(settings.limits, settings.max_joint_state_age_s, *least_ns)

    def put_in_force(self, now_ns: int, command: Command) -> Command:
        """Record a command that takes over at its start; return it as it is to be sent."""
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
        """Sample the reference from now to just before a time, at switches and samples of plans."""
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
        """Whether the command in force has not ended yet."""
        return self.current is not None and now_ns < self.current.end_ns

    @property
    def lead_ns(self) -> int:
        """Time from planning a command to its start; grows with the delay of commands."""
        return round(self._common.settings.lead_s * 1e9 + 1.5 * self.late_ns)

    def switch_ns(self, now_ns: int) -> int:
        """When a command planned now takes over; never before the newest command does."""
        ahead = now_ns + self.lead_ns
        return ahead if self.current is None else max(ahead, self.current.start_ns)

    def phase(self, now_ns: int) -> float:
        """Phase of the interaction that the command in force has reached; 1 without a command."""
        return 1.0 if self.current is None else self.current.phase_at(now_ns).phase

    def in_force(self) -> Command:
        """The newest command; there must be one."""
        if self.current is None:
            raise RuntimeError("no command is in force")
        return self.current

    def compared(self) -> tuple[Measured, JointReference] | None:
        """The newest joint state and the reference at its time; None if either is missing."""
        measured = self._measured
        reference = None if measured is None else self._reference(measured.time_ns)
        return None if measured is None or reference is None else (measured, reference)

    def is_update_due(self, now_ns: int) -> bool:
        """Whether a running plan may be updated again, give or take the jitter of a timer."""
        return now_ns - self.last_command_ns >= 0.9 * self._common.settings.command_period_s * 1e9

    def fresh(self, now_ns: int) -> bool:
        """Whether the newest joint state is recent; each stale one is reported once."""
        return self._recent(now_ns) is not None

    def off_command(self, now_ns: int) -> str:
        """Why the measured arm forbids the command in force to go on; empty if it may go on.

        An arm off its reference is reported once per command.
        """
        measured = self._recent(now_ns)
        if measured is None:
            return "stale_joint_states"
        if self._error(measured) <= self._common.settings.max_tracking_error_rad:
            return ""
        off = self._common.settings.limits.in_words(self._difference(measured))
        text = f"arm is {off} off its reference"
        self._report_once("arm_off_reference", self.last_command_ns, text)
        return "arm_off_reference"

    def start_reference(self, now_ns: int, start_ns: int) -> JointReference | None:
        """Where a new motion starts: the reference, or the measured posture if the arm was moved.

        None if no joint state is recent, or the arm is off its path while under way. Off it or
        without one, the arm must be seen at rest, at one place: else, too, None. If it was moved,
        all commands are forgotten.
        """
        measured, current, settings = self._recent(now_ns), self.current, self._common.settings
        if measured is None:
            return None
        if current is not None:
            settled = measured.time_ns > current.end_ns + _SETTLING_NS
            largest = settings.max_tracking_error_rad
            if self._error(measured) <= (min(largest, HELD_WITHIN_RAD) if settled else largest):
                self._moves_unasked &= not settled
                return current.at(start_ns)
        if self.under_way(now_ns):
            self._report_once("arm_off_reference", self.last_command_ns, "arm is off its path")
            return None
        self._moves_unasked |= current is not None
        # some drivers send velocities of zero that they do not measure
        speed = self._speed(SEEN_NS)
        if not self.at_rest(measured) or (speed or 0.0) > 2.0 * REST_RAD_S:
            self._moves_unasked = True
            self._report_once("arm_moving", measured.stamp_ns, "arm is moved by others")
            return None
        if speed is None:
            for since_ns, gap_s in self._motion.gaps(settings.max_joint_state_age_s).items():
                text = f"joint states came {gap_s:.2f} s apart"
                self._report_once("stale_joint_states", since_ns, text)
            return None
        apart, limits = self._motion.apart(), settings.limits
        if limits.largest(apart) > HELD_WITHIN_RAD:
            text = (
                f"an arm at rest is at places {limits.in_words(apart)} apart: who else sends them?"
            )
            self._report_once("joint_states_disagree", None, text)
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

    def _by(self, time_ns: int, n: int | None = None) -> Command:
        """The command of the first n in force at a time, at the earliest the oldest one kept."""
        commands = list(self._history)[:n]
        due = (command for command in reversed(commands) if command.start_ns <= time_ns)
        return next(due, commands[0])

    def _asked(self, time_ns: int) -> Floats | None:
        """Reference position at a time, (n,) [rad]; None without a command."""
        reference = self._reference(time_ns)
        return None if reference is None else reference.position

    def _error(self, measured: Measured) -> float:
        """Largest difference of a joint from its reference [rad]; 0 without a command."""
        return float(self._common.settings.limits.largest(self._difference(measured)))

    def _difference(self, measured: Measured) -> Floats:
        """Difference of the joints from their reference, (n,); 0 without a command."""
        asked = self._asked(measured.time_ns)
        return measured.position - (measured.position if asked is None else asked)

    def _report_once(self, reason: str, key: object, text: str) -> None:
        if self._reported != (reason, key):
            self._reported = (reason, key)
            self._reject(reason, text)


def same_posture(a: Floats, b: Floats) -> bool:
    """Whether two postures (n,) [rad] are practically equal."""
    return bool(np.abs(a - b).max() <= 1e-3)  # about 1 mm at the hand
