# SPDX-License-Identifier: Apache-2.0
"""From task probabilities and predictions to motion: what to execute, when to stop and go home.

A state machine without ROS: the caller passes all times, as integer nanoseconds of one clock.

    Idle, Homing -> Executing: a task is active and its prediction can be followed
    Executing -> Arrived -> Homing: the arm has stayed at the end for `hold_s`
    Executing -> Stopped: stream silent, task withdrawn, arm pushed away
    Stopped -> Executing (resumed) or Homing
    Executing, Arrived -> Yielding: somebody moves the arm
    Yielding -> Executing: the person has let go; the arm goes on from there
    Idle, Homing, Arrived -> Pretriggered: the arm goes ahead to the start of the expected task
    Pretriggered -> Executing, Stopped or Homing

A command is a plan and the time, a little ahead of now, at which it takes over from the plan
before. Position and velocity are continuous at that time. The plan in force always ends at rest
within the limits: when nothing better can be planned, it stays in force.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

from intent_recognition.activation.correcting import Correcting
from intent_recognition.activation.inbox import EstimatorInbox, TaskEstimate
from intent_recognition.activation.parts import Parts
from intent_recognition.activation.settings import ActivationSettings, Common
from intent_recognition.activation.states import (
    UNDER_WAY,
    Arrived,
    Command,
    Executing,
    Homing,
    Idle,
    Mode,
    Outcome,
    PredictedInteraction,
    Pretriggered,
    State,
    Stopped,
    Transition,
    interaction_of,
    outcome_of,
)
from intent_recognition.activation.transitions import Transitions
from intent_recognition.activation.waiting import Waiting
from intent_recognition.array_types import Floats
from intent_recognition.motion import PredictedPerson


class Activation:
    """Takes observations and predictions; `step` returns the next command.

    `reject` is called with (reason, text) for each input or motion that is rejected.

    Attributes:
        counts: how often plans were made, slowed, clamped, stopped and so on.
        outcomes: outcomes of the last 100 interactions that ended, until the caller removes them.
        arm, motions, people, pretrigger: the parts, for diagnostics.
    """

    def __init__(self, settings: ActivationSettings, reject: Callable[[str, str], None]):
        self._parts, self._reject = Parts(Common(settings, reject)), reject
        parts = self._parts
        self.arm, self.motions, self.people = parts.arm, parts.motions, parts.people
        self.counts, self.pretrigger = parts.counts, parts.pretrigger
        self._correcting, self._waiting = Correcting(parts), Waiting(parts)
        self._transitions = Transitions(parts, self._waiting, self._correcting)
        self._now_ns, self._helped = 0, ""
        self.outcomes: deque[Outcome] = deque(maxlen=100)
        self.state: State = Idle()

    def _start_over(self) -> None:
        """Return to the initial state, but keep the measured arm and the command in force."""
        self.state = Idle()
        self.people.forget()
        self._transitions.interacting.forget()
        self.pretrigger.forget()

    def change(self, settings: ActivationSettings) -> None:
        """Replace the settings, for the same joints; the motion under way goes on."""
        self._parts.common.settings = settings
        self.pretrigger.settings, self.pretrigger.decision = settings.pretrigger, settings.decision
        self._waiting.change()

    @property
    def _settings(self) -> ActivationSettings:
        return self._parts.settings

    @property
    def attended(self) -> str:
        """The person whom the arm helps while a task is active; empty if people have no names."""
        return self._helped if self.active_task else ""

    @property
    def mode(self) -> Mode:
        """The state's name."""
        return self.state.mode

    def moves(self, now_ns: int) -> bool:
        """Whether the arm is not idle, or a command such as a brake has not ended yet."""
        return self.mode is not Mode.IDLE or self.arm.under_way(now_ns)

    @property
    def home(self) -> Floats | None:
        """Posture to which the arm returns, (n,) [rad]; None until it is known."""
        return self._waiting.home

    @property
    def active_task(self) -> str:
        """The task being executed, until the arm is home again; empty if there is none."""
        interaction = interaction_of(self.state)
        return "" if interaction is None else interaction.prediction.label

    @property
    def inbox(self) -> EstimatorInbox:
        """Inbox of the person whom the arm attends to."""
        return self.people.inbox

    @property
    def arrived(self) -> bool:
        """Whether the arm is at the end of the active task."""
        return isinstance(self.state, Arrived)

    @property
    def stop_reason(self) -> str:
        """Why the arm is stopped; empty if it is not."""
        return self.state.reason if isinstance(self.state, Stopped) else ""

    @property
    def waits_for(self) -> str:
        """The task that waits for a clear way, and what is in the way; empty if none waits."""
        return self._transitions.interacting.waits_for

    # Inputs

    def take_tasks(
        self,
        now_ns: int,
        stamp_ns: int,
        labels: Sequence[str],
        probabilities: Floats,
        log_evidence: Floats | None = None,
        person: str = "",
    ) -> None:
        """Take the probabilities (K + 1,) of the K tasks and `none` by one observation of a person.

        The probabilities sum to one. `log_evidence` (K + 1,) holds the log density of the movement
        under each; None if unknown. The arm helps one of several named people at a time.

        Raises:
            ArgumentError: `decide` rejects the arguments.
        """
        helped = isinstance(self.state, UNDER_WAY) and person == self._helped
        estimate = TaskEstimate(labels, probabilities, log_evidence)
        decision = self.people.take_tasks(person, helped, now_ns, stamp_ns, estimate)
        if decision is None:
            return
        if decision.event:
            self.counts[decision.event] += 1
        if person != self.people.attended:
            return
        state = self.state
        if decision.event == "over" and isinstance(state, UNDER_WAY) and state.interaction:
            self.state = replace(state, interaction=replace(state.interaction, over=True))
        self.pretrigger.observe(decision, labels, probabilities)

    def take_prediction(
        self, now_ns: int, prediction: PredictedInteraction, person: str = ""
    ) -> None:
        """Take the newest prediction of a person; it is followed while its task is active."""
        self.people.of(person).take_prediction(now_ns, prediction)

    def take_next_task(
        self, now_ns: int, stamp_ns: int, labels: Sequence[str], probabilities: Floats
    ) -> None:
        """Take the probabilities (K,) of each of K labels to be the next task.

        Raises:
            ArgumentError: the numbers are no probabilities, or not one per label.
        """
        if not self.inbox.is_ahead(now_ns, stamp_ns, "intent/next_task"):
            self.pretrigger.take_expectation(stamp_ns, labels, probabilities)

    def take_exchange(self, until_ns: int) -> None:
        """Note that an object changes hands until a time: until then the arm does not go home."""
        self._transitions.exchanging_until_ns = until_ns

    def take_people(self, people: tuple[PredictedPerson, ...]) -> None:
        """Take where people are predicted to be, as far as that is known."""
        self.motions.slowing.people = people

    def take_person(self, person: PredictedPerson | None) -> None:
        """Take where the only person is predicted to be; None if that is unknown."""
        self.take_people(() if person is None else (person,))

    def take_joint_state(
        self,
        stamp_ns: int,
        position: Floats,
        velocity: Floats | None = None,
        *,
        now_ns: int | None = None,
    ) -> bool:
        """Take measured joint positions and velocities, (n,) each [rad, rad/s].

        They arrived at `now_ns`, by default at their stamp. Without velocities, a motion begins
        only once the positions have stood still for 0.1 s. Returns whether they are used.
        """
        arrival_ns = stamp_ns if now_ns is None else now_ns
        used = self.arm.take_joint_state(arrival_ns, stamp_ns, position, velocity)
        self._correcting.observe()
        return used

    def reset(self, now_ns: int) -> Command | None:
        """Forget the interaction; an arm under way goes home."""
        self.people.forget_interaction()
        self._transitions.interacting.forget()
        self.pretrigger.forget()
        state = self.state
        self.inbox.mark_served(interaction_of(state))
        if isinstance(state, Pretriggered):
            return self._enter(self._waiting.withdraw(now_ns) or Transition(Homing(None)))
        if isinstance(state, UNDER_WAY):
            home = self._waiting.go_home(now_ns, state.interaction)
            return self._enter(home or Transition(Homing(state.interaction)))
        return None

    def halt(self, now_ns: int) -> Command | None:
        """Brake and forget the interaction; for a node that is being deactivated.

        The brake stays in force: the next motion starts from it, or from the measured posture if
        somebody has moved the arm meanwhile.
        """
        command = self.motions.stop(now_ns) if self.arm.under_way(now_ns) else None
        self._start_over()
        return command

    def give_up(self, now_ns: int, reason: str) -> None:
        """Forget the interaction and the command in force, which the controller does not execute.

        The arm stays where the controller holds it. The movement under way starts no motion any
        more; the next movement starts one from the measured posture.
        """
        self.counts[f"stopped: {reason}"] += 1
        interaction = interaction_of(self.state)
        if interaction is not None:
            self.inbox.mark_served(interaction)
        self._enter(Transition(Idle()))
        self._transitions.interacting.forget()
        self.pretrigger.forget()
        self.arm.forget_commands()

    # Time

    def step(self, now_ns: int) -> Command | None:
        """Advance to now, and return the command to send, if there is one."""
        if now_ns < self._now_ns - 100_000_000:  # more than the jitter of threads
            self._now_ns = now_ns
            self._reject("clock_jumped_back", "the node's clock went back; starting over")
            self.arm.forget_joints()
            self.arm.forget_commands()
            self._start_over()
            return None
        self._now_ns = max(now_ns, self._now_ns)
        if self.people.named and self._is_free(now_ns):
            self.people.choose(now_ns)
        return self._enter(self._transitions.following(self.state, now_ns))

    def _is_free(self, now_ns: int) -> bool:
        state = self.state
        if not (isinstance(state, Arrived) and state.interaction.over):
            return isinstance(state, (Idle, Homing))
        waits = now_ns < self._transitions.exchanging_until_ns
        asked = bool(self.inbox.decision.active) and not waits
        return asked or self._transitions.held(state, now_ns)

    def _enter(self, transition: Transition) -> Command | None:
        outcome = outcome_of(self.state, transition.state)
        if outcome is not None:
            self.outcomes.append(outcome)
        self.state = transition.state
        if isinstance(self.state, Executing):  # until then, another person may be chosen
            self._helped = self.people.attended
        return transition.command
