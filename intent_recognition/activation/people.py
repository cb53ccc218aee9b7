# SPDX-License-Identifier: Apache-2.0
"""Several people and one arm: whom it helps first, and what is known of each person."""

from collections.abc import Sequence
from typing import NamedTuple

from intent_recognition.activation.inbox import EstimatorInbox, TaskEstimate
from intent_recognition.activation.settings import Common
from intent_recognition.activation.states import PredictedInteraction
from intent_recognition.recognition import DecisionState


class HelpRequest(NamedTuple):
    """A person whose task is recognised, and when the arm is needed at the end of its path."""

    person: str
    probability: float
    needed_ns: int
    duration_s: float


def first_to_help(requests: Sequence[HelpRequest], now_ns: int, between_s: float = 0.0) -> str:
    """The person to help first, so that the expected cost of all waits is least.

    The arm comes to a person when it is needed, or at the end of its motion if that is later. A
    wait of w seconds costs p w^2, where p is the probability that the task is right. The square
    prevents starvation: delaying somebody who has waited for w costs 2 p w per second, delaying
    somebody new costs nothing at first. After the first person, the others follow in the order in
    which they need the arm.

    `between_s` passes from the arrival at one person until the arm can begin with the next.
    """
    by_need = sorted(requests, key=lambda request: (request.needed_ns, request.person))

    def cost(first: HelpRequest) -> float:
        total, free_s = 0.0, 0.0
        for request in (first, *(other for other in by_need if other is not first)):
            needed_s = (request.needed_ns - now_ns) * 1e-9
            arrival_s = max(needed_s, free_s + request.duration_s)
            total += request.probability * (arrival_s - needed_s) ** 2
            free_s = arrival_s + between_s
        return total

    return min(by_need, key=cost).person


class People:
    """The inbox of each person, and whom the arm attends to.

    A single person has no name. If people have names, a person whose movement ends before the arm
    is free waits until the arm comes, the person moves again or is no longer seen.

    `attended` is the person whom the arm helps or would help; `reasons` lists who asked then.
    """

    def __init__(self, common: Common):
        self._common = common
        self._inboxes: dict[str, EstimatorInbox] = {}
        self._waiting: dict[str, HelpRequest] = {}
        self.attended = self.reasons = ""
        self.inbox = self.of("")

    @property
    def named(self) -> bool:
        """Whether there are people with names."""
        return len(self._inboxes) > 1

    def of(self, person: str) -> EstimatorInbox:
        """The inbox of a person."""
        if person not in self._inboxes:
            self._inboxes[person] = EstimatorInbox(self._common)
        return self._inboxes[person]

    def forget(self) -> None:
        """Return every inbox to its initial state."""
        for inbox in self._inboxes.values():
            inbox.forget()

    def forget_interaction(self) -> None:
        """Forget decisions and predictions, but not the stamps of the last observations."""
        for inbox in self._inboxes.values():
            inbox.forget_interaction()

    def take_tasks(
        self, person: str, helped: bool, now_ns: int, stamp_ns: int, estimate: TaskEstimate
    ) -> DecisionState | None:
        """Decide on an observation of a person; None if its stamp is rejected (`EstimatorInbox`).

        `helped` says whether the arm is in an interaction with this person.
        """
        inbox = self.of(person)
        if self.named and inbox.silent(now_ns):  # it may be somebody else by now
            inbox.forget_interaction()
        needed = inbox.wanted()
        request = self._request(person, needed) if self.named and needed else None
        if not inbox.take_tasks(now_ns, stamp_ns, estimate):
            return None
        if self.named and not inbox.decision.idle:
            inbox.order(None)
        elif request is not None and inbox.decision.event == "over" and not helped:
            inbox.order(needed)
            self._waiting[person] = request
        return inbox.decision

    def choose(self, now_ns: int) -> None:
        """Attend to the person whom the arm is to help first, if anybody needs it."""
        found: dict[bool, list[HelpRequest]] = {False: [], True: []}
        for person, inbox in self._inboxes.items():
            needed = inbox.needed()
            if inbox.silent(now_ns):
                inbox.order(None)
            elif needed is not None:
                found[inbox.refused].append(self._request(person, needed))
            elif inbox.ordered is not None:
                ordered = self._request(person, inbox.ordered)  # by a caller if it does not wait
                found[inbox.refused].append(self._waiting.get(person, ordered))
        if requests := found[False] or found[True]:  # a refused request blocks nobody else
            self.attended = first_to_help(requests, now_ns, self._common.settings.hold_s)
            self.inbox = self.of(self.attended)
            by_need = sorted(requests, key=lambda request: request.needed_ns)
            self.reasons = "; ".join(_in_words(request, now_ns) for request in by_need)

    def _request(self, person: str, needed: PredictedInteraction) -> HelpRequest:
        return HelpRequest(person, self.of(person).certainty, needed.end_ns, needed.path.duration_s)


def _in_words(request: HelpRequest, now_ns: int) -> str:
    wait_s = (request.needed_ns - now_ns) * 1e-9
    when = f"in {wait_s:.1f} s" if wait_s > 0.0 else f"{-wait_s:.1f} s ago"
    return f"{request.person} {when} ({request.probability:.0%})"
