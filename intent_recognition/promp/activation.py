# SPDX-License-Identifier: Apache-2.0
"""From task probabilities and predictions to motion: what to execute, when to stop and go home.

A state machine without ROS: times are integer nanoseconds of one clock, handed in.

    idle -> executing -> (arrived, held) -> homing -> idle
    executing -> stopped (stream silent, task withdrawn, arm pushed away) -> executing or homing

A command is a plan and the time at which it takes over from the plan before, a little ahead of
now, so that position and velocity are continuous where it does. The plan in force always ends at
rest within the limits: when nothing better can be planned, it stays in force.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.kinematics.plan import JointPlan, Reference
from intent_recognition.kinematics.planning import (
    brake_plan,
    home_plan,
    plan_interaction,
    stop_plan,
)
from intent_recognition.kinematics.retiming import NominalTiming
from intent_recognition.promp.activation_settings import (
    ActivationSettings,
    Command,
    Mode,
    Prediction,
)
from intent_recognition.promp.decision import DecisionState, decide, uncertain_end

_ARRIVED = 1.0 - 1e-6
_LARGEST_AHEAD_NS = 1_000_000_000
_LARGEST_BACK_NS = 100_000_000


class _Measured(NamedTuple):
    stamp_ns: int
    position: np.ndarray
    velocity: np.ndarray


class Activation:
    """Takes what is observed, and gives the next command when `step` is called.

    Args:
        settings: how to act.
        reject: called with (reason, text) for everything not acted on.

    Attributes:
        mode: see `Mode`.
        active_task: task being executed, empty when idle.
        stop_reason: why the last stop happened, empty when none is in force.
        held_back: why a recognised task is not executed (its end is uncertain), or empty.
        counts: how often plans were made, slowed, clamped, stopped and so on.
        decision: the state of the decision.
    """

    def __init__(self, settings: ActivationSettings, reject: Callable[[str, str], None]):
        self._settings = settings
        self._reject = reject
        self.counts: Counter[str] = Counter()
        self._measured: _Measured | None = None
        self._home = None if settings.home is None else np.array(settings.home, dtype=float)
        self._now_ns = 0
        self._forget()

    def _forget(self) -> None:
        """Back to the beginning, but for the measured arm."""
        self.mode = Mode.IDLE
        self.active_task = ""
        self.stop_reason = self.held_back = ""
        self.decision = DecisionState()
        self._current: Command | None = None
        self._previous: Command | None = None
        self._prediction: Prediction | None = None
        self._unused = False
        self._executed: Prediction | None = None
        self._last_command_ns = 0
        self._arrived_ns: int | None = None
        self._stopped_ns = 0
        self._over = False
        self._served_end_ns: int | None = None
        self._tasks_stamp_ns: int | None = None
        self._heard_ns = 0
        self._reported: tuple | None = None

    # Inputs

    def take_tasks(
        self, now_ns: int, stamp_ns: int, labels: Sequence[str], probabilities: np.ndarray
    ) -> None:
        """Take the probabilities of one observation; raises what `decide` raises."""
        if stamp_ns <= 0:
            self._reject("zero_stamp", "intent/tasks without a stamp")
        elif stamp_ns > now_ns + _LARGEST_AHEAD_NS:
            self._reject(
                "stamp_in_future", f"intent/tasks {(stamp_ns - now_ns) * 1e-9:.1f} s ahead"
            )
        elif self._tasks_stamp_ns is not None and stamp_ns <= self._tasks_stamp_ns:
            self._reject("stamp_not_increasing", f"intent/tasks at {stamp_ns} ns came late")
        else:
            self._take_observation(now_ns, stamp_ns, labels, probabilities)

    def _take_observation(self, now_ns, stamp_ns, labels, probabilities) -> None:
        end_std = None
        if self._prediction is not None and 0 < len(labels) == len(probabilities):
            best = labels[int(np.argmax(probabilities))]
            end_std = self._prediction.end_std if best == self._prediction.label else None
        state, _ = decide(self._settings.decision, self.decision, labels, probabilities, end_std)
        self._tasks_stamp_ns, self._heard_ns = stamp_ns, now_ns
        self.decision = state
        self._note_held_back(uncertain_end(self._settings.decision, state, end_std))
        if state.event:
            self.counts[state.event] += 1
        if state.event == "over":
            self._over = True
        if state.idle:
            self._served_end_ns = None
            self._prediction = None

    def _note_held_back(self, reason: str) -> None:
        """Keep why nothing is executed; rejected once, if the movement ends without."""
        if reason:
            self.held_back = reason
        elif self.decision.active:
            self.held_back = ""
        elif self.decision.idle and self.held_back:
            self._reject("uncertain_end", self.held_back)
            self.held_back = ""

    def take_prediction(self, now_ns: int, prediction: Prediction) -> None:
        """Take the newest prediction; it is used if its task is the active one."""
        if prediction.onset_ns <= 0:
            self._reject("zero_stamp", "intent/robot_trajectory without a stamp")
        elif prediction.onset_ns > now_ns + _LARGEST_AHEAD_NS:
            ahead_s = (prediction.onset_ns - now_ns) * 1e-9
            self._reject("stamp_in_future", f"intent/robot_trajectory {ahead_s:.1f} s ahead")
        elif now_ns - prediction.end_ns > self._settings.max_lateness_s * 1e9:
            late_s = (now_ns - prediction.end_ns) * 1e-9
            self._reject("outdated", f"intent/robot_trajectory was over {late_s:.1f} s ago")
        else:
            self._prediction = prediction
            self._unused = True

    def take_joint_state(self, stamp_ns: int, position: np.ndarray, velocity: np.ndarray) -> None:
        """Take what the arm measured, (n,) each [rad, rad/s]."""
        if self._measured is None or stamp_ns > self._measured.stamp_ns:
            self._measured = _Measured(stamp_ns, position, velocity)
        else:
            self._reject("joint_state_not_increasing", f"joint_states at {stamp_ns} ns came late")

    def reset(self, now_ns: int) -> Command | None:
        """Forget the interaction; an arm under way goes home."""
        self.decision, self.held_back = DecisionState(), ""
        self._prediction, self._served_end_ns = None, None
        if self.mode in (Mode.EXECUTING, Mode.STOPPED):
            self._served_end_ns = self._executed.end_ns
            return self._go_home(now_ns)
        return None

    def halt(self, now_ns: int) -> Command | None:
        """Brake where the arm is, and forget everything; for a node being deactivated."""
        command = None
        if self._current is not None and now_ns < self._current.end_ns:
            start_ns = self._switch_ns(now_ns)
            plan = self._stop_plan(start_ns)
            command = Command(start_ns, plan)
        self._forget()
        return command

    # Time

    def step(self, now_ns: int) -> Command | None:
        """Advance to now; returns a command to send, if there is one."""
        if now_ns < self._now_ns - _LARGEST_BACK_NS:
            self._now_ns = now_ns
            self._reject("clock_jumped_back", "the node's clock went back; starting over")
            self._measured = None
            self._forget()
            return None
        self._now_ns = max(now_ns, self._now_ns)
        act = {
            Mode.IDLE: self._idle,
            Mode.EXECUTING: self._executing,
            Mode.STOPPED: self._stopped,
            Mode.HOMING: self._homing,
        }
        return act[self.mode](now_ns)

    def _idle(self, now_ns: int) -> Command | None:
        return self._activate(now_ns)

    def _executing(self, now_ns: int) -> Command | None:
        if not self._finished(now_ns):
            reason = self._reason_to_stop(now_ns)
            if reason:
                return self._stop(now_ns, reason)
            other = self.decision.active not in ("", self.active_task)
            if other and not self._over and now_ns < self._executed.end_ns:
                return self._activate(now_ns)
            return self._update(now_ns)
        if self._arrived_ns is None:
            self._arrived_ns = now_ns
            self._served_end_ns = None if self._over else self._executed.end_ns
        if self._over and self.decision.active:
            return self._activate(now_ns)
        if now_ns - self._arrived_ns >= self._settings.hold_s * 1e9:
            return self._go_home(now_ns)
        return self._update(now_ns)

    def _stopped(self, now_ns: int) -> Command | None:
        if now_ns < self._current.end_ns:
            return None
        resumes = self.decision.active and not self._silent(now_ns) and not self._over
        if resumes and self.decision.active == self.active_task:
            command = self._update(now_ns)
            if command is not None:
                self.mode, self.stop_reason = Mode.EXECUTING, ""
                return command
        elif resumes:
            return self._activate(now_ns)
        back_without_task = not self._silent(now_ns) and not self.decision.active
        held = now_ns - self._stopped_ns >= self._settings.hold_s * 1e9
        if held or (back_without_task and self.decision.idle):
            if self.stop_reason != "withdrawn":
                self._served_end_ns = None if self._over else self._executed.end_ns
            return self._go_home(now_ns)
        return None

    def _homing(self, now_ns: int) -> Command | None:
        command = self._activate(now_ns)
        if command is not None or now_ns < self._current.end_ns:
            return command
        if self._current.plan.kind != "home":
            return self._go_home(now_ns)
        self._rest()
        return None

    # Motions

    def _activate(self, now_ns: int) -> Command | None:
        """Start the active task, if there is one to start and it can be started."""
        prediction = self._prediction
        if not self.decision.active or prediction is None or not self._unused:
            return None
        if prediction.label != self.decision.active or self._silent(now_ns):
            return None
        if self._served_end_ns is not None and prediction.onset_ns < self._served_end_ns:
            return None
        start_ns = self._switch_ns(now_ns)
        start = self._start_reference(now_ns, start_ns)
        if start is None:
            self._unused = False
            return None
        if self._home is None:
            self._home = start.position
        command = self._plan(now_ns, start_ns, start, 0.0, 0.0, 0.0)
        if command is not None:
            self.mode, self.active_task, self.stop_reason = Mode.EXECUTING, prediction.label, ""
            self._arrived_ns, self._over, self._served_end_ns = None, False, None
            self.counts["started"] += 1
        return command

    def _update(self, now_ns: int) -> Command | None:
        """Follow the newest prediction of the running task."""
        mine = self._prediction is not None and self._prediction.label == self.active_task
        due = now_ns - self._last_command_ns >= 0.9 * self._settings.command_period_s * 1e9
        if not (mine and due and self._unused) or self._over:
            return None
        if self.decision.active != self.active_task or not self._arm_follows(now_ns):
            return None
        start_ns = self._switch_ns(now_ns)
        progress = self._current.phase_at(start_ns)
        return self._plan(now_ns, start_ns, self._current.at(start_ns), *progress)

    def _plan(self, now_ns, start_ns, start, phase, rate, acceleration) -> Command | None:
        prediction = self._prediction
        self._unused = False
        onset_s = (prediction.onset_ns - start_ns) * 1e-9
        nominal = NominalTiming(onset_s, prediction.path.duration_s)
        settings = self._settings
        plan = plan_interaction(
            prediction.path,
            nominal,
            start,
            phase,
            rate,
            settings.limits,
            settings.plan,
            phase_acceleration=acceleration,
        )
        if plan is None:
            self._reject("infeasible", f"no plan for {prediction.label} keeps the limits")
            return None
        self._executed = prediction
        self.counts["planned"] += 1
        self.counts["slowed"] += plan.slowed
        self.counts["clamped"] += bool(plan.clamped)
        return self._send(now_ns, Command(start_ns, plan))

    def _stop(self, now_ns: int, reason: str) -> Command:
        start_ns = self._switch_ns(now_ns)
        self.mode, self.stop_reason = Mode.STOPPED, reason
        self.counts[f"stopped: {reason}"] += 1
        command = self._send(now_ns, Command(start_ns, self._stop_plan(start_ns)))
        self._stopped_ns = command.end_ns
        return command

    def _stop_plan(self, start_ns: int) -> JointPlan:
        start = self._current.at(start_ns)
        phase, rate, acceleration = self._current.phase_at(start_ns)
        limits, settings = self._settings.limits, self._settings.plan
        if self._executed is None or self._current.plan.kind == "home":
            return brake_plan(start, phase, limits, settings)
        return stop_plan(
            self._executed.path,
            start,
            phase,
            rate,
            limits,
            settings,
            phase_acceleration=acceleration,
        )

    def _go_home(self, now_ns: int) -> Command | None:
        """Return home, braking first where no plan home starts from this motion."""
        if not self._settings.return_home:
            self._rest()
            return None
        if self._current.plan.kind == "home" and now_ns < self._current.end_ns:
            return None
        start_ns = self._switch_ns(now_ns)
        start, settings = self._current.at(start_ns), self._settings
        plan = home_plan(start, self._home, settings.limits, settings.plan)
        if plan is None:
            plan = self._stop_plan(start_ns)
        self.mode = Mode.HOMING
        return self._send(now_ns, Command(start_ns, plan))

    def _rest(self) -> None:
        self.mode, self.active_task, self.stop_reason = Mode.IDLE, "", ""
        self._executed, self._over = None, False

    def _send(self, now_ns: int, command: Command) -> Command:
        self._previous, self._current = self._current, command
        self._last_command_ns = now_ns
        return command

    # Questions

    def _switch_ns(self, now_ns: int) -> int:
        """When a command planned now takes over; never before the one in force does."""
        ahead = now_ns + round(self._settings.lead_s * 1e9)
        return ahead if self._current is None else max(ahead, self._current.start_ns)

    def _finished(self, now_ns: int) -> bool:
        if self._arrived_ns is not None:
            return True
        return self._current.phase_at(now_ns)[0] >= _ARRIVED

    def _silent(self, now_ns: int) -> bool:
        return now_ns - self._heard_ns > self._settings.timeout_s * 1e9

    def _reason_to_stop(self, now_ns: int) -> str:
        """Why a motion under way must stop, or an empty text."""
        if self._silent(now_ns):
            return "stream_stopped"
        if not self._fresh(now_ns):
            return "stale_joint_states"
        if not self._arm_follows(now_ns):
            return "arm_off_reference"
        withdrawn = not self.decision.active and not self._over
        return "withdrawn" if withdrawn and now_ns < self._executed.end_ns else ""

    def _reference(self, time_ns: int) -> Reference | None:
        """What the arm is asked for at a time, by the command in force then."""
        late = self._current is None or time_ns >= self._current.start_ns
        command = self._current if late else self._previous
        return None if command is None else command.at(time_ns)

    def _fresh(self, now_ns: int) -> bool:
        """Whether the measured arm is recent; reported once for each joint state that is not."""
        stamp_ns = None if self._measured is None else self._measured.stamp_ns
        age_ns = self._settings.max_joint_state_age_s * 1e9
        if stamp_ns is not None and abs(now_ns - stamp_ns) <= age_ns:
            return True
        self._report_once("stale_joint_states", stamp_ns, "no recent joint_states")
        return False

    def _report_once(self, reason: str, key: object, text: str) -> None:
        """Reject, once as long as reason and key stay the same."""
        if self._reported != (reason, key):
            self._reported = (reason, key)
            self._reject(reason, text)

    def _error(self) -> float:
        """Largest difference between the measured arm and its reference then [rad]."""
        reference = self._reference(self._measured.stamp_ns)
        if reference is None:
            return 0.0
        return float(np.abs(self._measured.position - reference.position).max())

    def _arm_follows(self, now_ns: int) -> bool:
        if not self._fresh(now_ns):
            return False
        error = self._error()
        if error <= self._settings.max_tracking_error_rad:
            return True
        key = self._last_command_ns
        self._report_once("arm_off_reference", key, f"arm is {error:.2f} rad off its reference")
        return False

    def _start_reference(self, now_ns: int, start_ns: int) -> Reference | None:
        """Where a new interaction starts from: the reference, or the arm if it was moved."""
        if not self._fresh(now_ns):
            return None
        if self._current is not None and self._error() <= self._settings.max_tracking_error_rad:
            return self._current.at(start_ns)
        if self._current is not None and now_ns < self._current.end_ns:
            self._report_once("arm_off_reference", self._last_command_ns, "arm is off its path")
            return None
        if np.abs(self._measured.velocity).max() > self._settings.rest_speed_rad_s:
            self._report_once("arm_moving", self._measured.stamp_ns, "arm is moved by others")
            return None
        self._previous = self._current = None
        return Reference.at_rest(self._measured.position)
