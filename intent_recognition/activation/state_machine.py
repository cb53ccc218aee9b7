# SPDX-License-Identifier: Apache-2.0
"""From task probabilities and predictions to motion: what to execute, when to stop and go home.

A state machine without ROS: times are integer nanoseconds of one clock, handed in.

    idle -> executing -> (arrived, held) -> homing -> idle
    executing -> stopped (stream silent, task withdrawn, arm pushed away) -> executing or homing
    idle, homing -> pretriggered (at the start of the expected task) -> executing or homing

A command is a plan and the time at which it takes over from the plan before, a little ahead of
now, so that position and velocity are continuous where it does. The plan in force always ends at
rest within the limits: when nothing better can be planned, it stays in force.
"""

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from intent_recognition.activation.arm_tracking import ArmTracking
from intent_recognition.activation.inbox import EstimatorInbox
from intent_recognition.activation.motions import Motions
from intent_recognition.activation.pretrigger import Pretrigger
from intent_recognition.activation.settings import ActivationSettings, Command, Mode, Prediction
from intent_recognition.recognition import DecisionState

_ARRIVED = 1.0 - 1e-6
_LARGEST_BACK_NS = 100_000_000


class Activation:
    """Takes what is observed, and gives the next command when `step` is called.

    Args:
        settings: how to act.
        reject: called with (reason, text) for everything not acted on.

    Attributes:
        mode: see `Mode`.
        active_task: task being executed, empty when idle.
        stop_reason: why the last stop happened, empty when none is in force.
        counts: how often plans were made, slowed, clamped, stopped and so on.
        pretrigger: which task the arm has gone ahead for.
    """

    def __init__(self, settings: ActivationSettings, reject: Callable[[str, str], None]):
        self._settings = settings
        self._reject = reject
        self.counts: Counter[str] = Counter()
        self.pretrigger = Pretrigger(settings.pretrigger, settings.decision)
        self._heard = EstimatorInbox(settings, reject)
        self._arm = ArmTracking(settings, reject)
        self._motions = Motions(settings, self._arm, reject, self.counts)
        self._home = None if settings.home is None else np.array(settings.home, dtype=float)
        self._now_ns = 0
        self._forget()

    def _forget(self) -> None:
        """Back to the beginning, but for the measured arm."""
        self.mode = Mode.IDLE
        self.active_task = self.stop_reason = ""
        self._heard.forget()
        self._arm.forget_commands()
        self.pretrigger.forget()
        self._executed: Prediction | None = None
        self._arrived_ns: int | None = None
        self._stopped_ns = 0
        self._over = False
        self._served_end_ns: int | None = None
        self._came_from: np.ndarray | None = None

    def change(self, settings: ActivationSettings) -> None:
        """Act by other settings from now on, for the same joints; what is under way goes on."""
        self._settings = settings
        for part in (self._heard, self._arm, self._motions):
            part.settings = settings
        self.pretrigger.settings, self.pretrigger.decision = settings.pretrigger, settings.decision
        if settings.home is not None:
            self._home = np.array(settings.home, dtype=float)

    @property
    def decision(self) -> DecisionState:
        """The state of the decision."""
        return self._heard.decision

    @property
    def held_back(self) -> str:
        """Why a recognised task is not executed (its end is uncertain), or empty."""
        return self._heard.held_back

    # Inputs

    def take_tasks(
        self,
        now_ns: int,
        stamp_ns: int,
        labels: Sequence[str],
        probabilities: np.ndarray,
        log_evidence: np.ndarray | None = None,
    ) -> None:
        """Take the probabilities of one observation; raises what `decide` raises."""
        if not self._heard.take_tasks(now_ns, stamp_ns, labels, probabilities, log_evidence):
            return
        state = self.decision
        if state.event:
            self.counts[state.event] += 1
        if state.event == "over":
            self._over = True
        if state.idle:
            self._served_end_ns = None
        self.pretrigger.observe(state, labels, probabilities)

    def take_prediction(self, now_ns: int, prediction: Prediction) -> None:
        """Take the newest prediction; it is used if its task is the active one."""
        self._heard.take_prediction(now_ns, prediction)

    def take_joint_state(self, stamp_ns: int, position: np.ndarray, velocity: np.ndarray) -> None:
        """Take what the arm measured, (n,) each [rad, rad/s]."""
        self._arm.take_joint_state(stamp_ns, position, velocity)

    def reset(self, now_ns: int) -> Command | None:
        """Forget the interaction; an arm under way goes home."""
        self._heard.forget_interaction()
        self._served_end_ns = None
        was_ahead = bool(self.pretrigger.label)
        self.pretrigger.forget()
        if was_ahead:
            return self._leave(now_ns)
        if self.mode in (Mode.EXECUTING, Mode.STOPPED):
            self._served_end_ns = None if self._executed is None else self._executed.end_ns
            return self._go_home(now_ns)
        return None

    def halt(self, now_ns: int) -> Command | None:
        """Brake where the arm is, and forget everything; for a node being deactivated."""
        under_way = self._arm.under_way(now_ns)
        command = self._motions.stop(now_ns, self._executed) if under_way else None
        self._forget()
        return command

    # Time

    def step(self, now_ns: int) -> Command | None:
        """Advance to now; returns a command to send, if there is one."""
        if now_ns < self._now_ns - _LARGEST_BACK_NS:
            self._now_ns = now_ns
            self._reject("clock_jumped_back", "the node's clock went back; starting over")
            self._arm.forget_joints()
            self._forget()
            return None
        self._now_ns = max(now_ns, self._now_ns)
        act = {
            Mode.IDLE: self._idle,
            Mode.EXECUTING: self._executing,
            Mode.STOPPED: self._stopped,
            Mode.HOMING: self._homing,
            Mode.PRETRIGGERED: self._pretriggered,
        }
        return act[self.mode](now_ns)

    def _idle(self, now_ns: int) -> Command | None:
        return self._activate(now_ns) or self._go_ahead(now_ns)

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
            command = self._go_ahead(now_ns)
            return command if self.mode is Mode.PRETRIGGERED else self._go_home(now_ns)
        return self._update(now_ns)

    def _stopped(self, now_ns: int) -> Command | None:
        if self._arm.under_way(now_ns):
            return None
        silent = self._heard.silent(now_ns)
        resumes = self.decision.active and not silent and not self._over
        if resumes and self.decision.active == self.active_task:
            command = self._update(now_ns)
            if command is not None:
                self.mode, self.stop_reason = Mode.EXECUTING, ""
                return command
        elif resumes:
            return self._activate(now_ns)
        back_without_task = not silent and not self.decision.active
        held = now_ns - self._stopped_ns >= self._settings.hold_s * 1e9
        if held or (back_without_task and self.decision.idle):
            if self._executed is None:
                return self._leave(now_ns)
            if self.stop_reason != "withdrawn":
                self._served_end_ns = None if self._over else self._executed.end_ns
            return self._go_home(now_ns)
        return None

    def _homing(self, now_ns: int) -> Command | None:
        command = self._activate(now_ns) or self._go_ahead(now_ns)
        if command is not None or self._arm.under_way(now_ns) or self.mode is not Mode.HOMING:
            return command
        if self._arm.current is not None and self._arm.current.plan.kind != "home":
            return self._leave(now_ns) if self._came_from is not None else self._go_home(now_ns)
        self._rest()
        return None

    def _pretriggered(self, now_ns: int) -> Command | None:
        command = self._activate(now_ns)
        if command is not None:
            return command
        if self._arm.under_way(now_ns):
            reason = self._reason_to_halt(now_ns)
            if reason:
                self.pretrigger.end()
                return self._stop(now_ns, reason)
        reason = self.pretrigger.reason_to_withdraw(now_ns, self.decision)
        if not reason:
            return None
        self.counts[f"pretrigger withdrawn: {reason}"] += 1
        return self._leave(now_ns)

    # Motions

    def _activate(self, now_ns: int) -> Command | None:
        """Start the active task, if there is one to start and it can be started."""
        prediction = self._heard.prediction
        if not self.decision.active or prediction is None or not self._heard.unused:
            return None
        if prediction.label != self.decision.active or self._heard.silent(now_ns):
            return None
        if self._served_end_ns is not None and prediction.onset_ns < self._served_end_ns:
            return None
        start_ns = self._arm.switch_ns(now_ns)
        start = self._arm.start_reference(now_ns, start_ns)
        if start is None:
            self._heard.unused = False
            return None
        if self._home is None:
            self._home = start.position
        self._heard.unused = False
        command = self._motions.interact(now_ns, prediction, start_ns, start)
        if command is not None:
            self._executed = prediction
            if self.pretrigger.label:
                right = self.pretrigger.label == prediction.label
                self.counts["pretrigger right" if right else "pretrigger wrong"] += 1
            self.pretrigger.interaction_began()
            self.mode, self.active_task, self.stop_reason = Mode.EXECUTING, prediction.label, ""
            self._arrived_ns, self._over, self._served_end_ns = None, False, None
            self._came_from = None
            self.counts["started"] += 1
        return command

    def _update(self, now_ns: int) -> Command | None:
        """Follow the newest prediction of the running task."""
        inbox, arm = self._heard, self._arm
        mine = inbox.prediction is not None and inbox.prediction.label == self.active_task
        due = now_ns - arm.last_command_ns >= 0.9 * self._settings.command_period_s * 1e9
        if not (mine and due and inbox.unused) or self._over:
            return None
        if self.decision.active != self.active_task or not arm.follows(now_ns):
            return None
        start_ns = arm.switch_ns(now_ns)
        start, progress = arm.current.at(start_ns), arm.current.phase_at(start_ns)
        inbox.unused = False
        command = self._motions.interact(now_ns, inbox.prediction, start_ns, start, progress)
        if command is not None:
            self._executed = inbox.prediction
        return command

    def _stop(self, now_ns: int, reason: str) -> Command:
        self.mode, self.stop_reason = Mode.STOPPED, reason
        self.counts[f"stopped: {reason}"] += 1
        command = self._motions.stop(now_ns, self._executed)
        self._stopped_ns = command.end_ns
        return command

    def _go_home(self, now_ns: int) -> Command | None:
        """Return home, braking first where no plan home starts from this motion."""
        if not self._settings.return_home:
            self._rest()
            return None
        self.mode = Mode.HOMING
        return self._motions.go_home(now_ns, self._home, self._executed)

    def _go_ahead(self, now_ns: int) -> Command | None:
        """Go to where the expected next task begins, if it is time for that; see `pretrigger`."""
        label = self.pretrigger.wanted(self._heard.idle_since_ns)
        if not label or not self.decision.idle or self._heard.silent(now_ns):
            return None
        start_ns = self._arm.switch_ns(now_ns)
        start = self._arm.start_reference(now_ns, start_ns)
        if start is None:
            return None
        current, command = self._arm.current, None
        destination = start.position if current is None else current.plan.end
        if not self.pretrigger.is_near(destination, label):
            at_home = self._home is not None and self.pretrigger.is_near(self._home, label)
            target = self._home if at_home else self.pretrigger.start(label)
            command = self._motions.go_ahead(now_ns, start_ns, start, target)
            if command is None:
                self.pretrigger.forget()
                return None
        self._came_from = destination if self._home is None else self._home
        arrival_ns = now_ns if self._arm.current is None else self._arm.current.end_ns
        self.pretrigger.begin(label, max(now_ns, arrival_ns))
        self._rest()
        self.mode = Mode.PRETRIGGERED
        self.counts["pretriggered"] += 1
        return command

    def _leave(self, now_ns: int) -> Command | None:
        """Withdraw from where the arm had gone ahead to: home, or where it came from."""
        self.pretrigger.end()
        target, current = self._came_from, self._arm.current
        if current is None or np.abs(current.plan.end - target).max() <= 1e-3:
            self._rest()
            self.mode = Mode.HOMING if self._arm.under_way(now_ns) else Mode.IDLE
            return None
        self.mode = Mode.HOMING
        return self._motions.go_home(now_ns, target, None)

    def _rest(self) -> None:
        self.mode, self.active_task, self.stop_reason = Mode.IDLE, "", ""
        self._executed, self._over = None, False

    # Questions

    def _finished(self, now_ns: int) -> bool:
        if self._arrived_ns is not None:
            return True
        return self._arm.current.phase_at(now_ns)[0] >= _ARRIVED

    def _reason_to_halt(self, now_ns: int) -> str:
        """Why no motion may go on, or an empty text."""
        if self._heard.silent(now_ns):
            return "stream_stopped"
        if not self._arm.fresh(now_ns):
            return "stale_joint_states"
        return "" if self._arm.follows(now_ns) else "arm_off_reference"

    def _reason_to_stop(self, now_ns: int) -> str:
        """Why an interaction under way must stop, or an empty text."""
        withdrawn = not self.decision.active and not self._over
        reason = self._reason_to_halt(now_ns)
        return reason or ("withdrawn" if withdrawn and now_ns < self._executed.end_ns else "")
