# SPDX-License-Identifier: Apache-2.0
"""Watches a session of `intent demo`: shows progress, and waits for nodes and signals."""

import time
from collections.abc import Callable, Iterable, Iterator, Set
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from rich.console import Console

from intent_recognition.cli.console import news
from intent_recognition.errors import IntentError
from intent_recognition.interrupts import Noted

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from intent_recognition.nodes.processes import NodeProcesses

COWORKER, PLAYER = "coworker_sim", "bag_player"
"""Nodes that end by themselves."""
START_S = 60.0
"""Longest wait for nodes to start and to discover one another [s]."""
HUNG_S = 30.0
"""Silence on /diagnostics after which a node counts as hung [s]: six times the longest time for
which learning blocks one, since other work may slow all of them."""


class Heartbeats:
    """Duration of the silence of all nodes that have reported once.

    Attributes:
        unanswered: nodes for which simulated time no longer waits, in words; empty for none.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._looked_s = clock()
        self._silent_s: dict[str, float] = {}
        self.unanswered = ""
        self._failing: dict[str, bool] = {}

    @property
    def names(self) -> Set[str]:
        """Names of the nodes that have reported."""
        return self._silent_s.keys()

    def hear(self, name: str, unanswered: str = "") -> None:
        """Note a node's report; a node with a clock also reports whom it no longer waits for."""
        self._silent_s[name] = 0.0
        self.unanswered = unanswered or self.unanswered

    def begins_to_fail(self, name: str, fails: bool) -> bool:
        """Whether a node reports an error that it did not report before."""
        failed, self._failing[name] = self._failing.get(name, False), fails
        return fails and not failed

    def check(self, names: Iterable[str]) -> None:
        """Require that none of these nodes hangs."""
        now_s = self._clock()
        # limited, as this process itself may have been stopped
        step_s, self._looked_s = min(now_s - self._looked_s, 1.0), now_s
        for name in self._silent_s:
            self._silent_s[name] += step_s
        for name in names:
            if self._silent_s.get(name, 0.0) > HUNG_S:
                got = f"none for {HUNG_S:.0f} s"
                cure = "It hangs; see its log."
                raise IntentError.about(f"node {name}", "reports on /diagnostics", got, cure)


class NodeWatch:
    """Runs the callbacks of this process while the nodes run.

    Signals must not interrupt a callback: they are noted, and end the wait after the callback.
    """

    def __init__(
        self,
        processes: "NodeProcesses",
        executor: "Executor",
        heartbeats: Heartbeats,
        interrupts: Noted,
    ) -> None:
        self.processes = processes
        self.heartbeats = heartbeats
        self._executor = executor
        self._interrupts = interrupts

    def until(self, condition: Callable[[], bool], deadline_s: float, what: str) -> None:
        """Wait until a condition holds.

        Raises:
            IntentError: a node died or hangs, or the deadline has passed.
            KeyboardInterrupt: a signal arrived.
        """
        if not self.until_or(condition, deadline_s):
            cure = "See the nodes' logs."
            raise IntentError.about(what, f"within {deadline_s:.0f} s", "nothing", cure)

    def until_or(self, condition: Callable[[], bool], longest_s: float) -> bool:
        """Wait until a condition holds or a time has passed; return whether it holds."""
        end_s = time.monotonic() + longest_s
        while not condition():
            if time.monotonic() > end_s:
                return False
            self._step()
        return True

    def for_seconds(self, seconds: float) -> None:
        """Wait for a time; raises as `until` does."""
        self.until_or(lambda: False, seconds)

    def until_interrupted(self) -> None:
        """Wait for a signal."""
        with suppress(KeyboardInterrupt):
            self.until_or(lambda: False, float("inf"))

    def _step(self) -> None:
        if self._interrupts.take():
            raise KeyboardInterrupt
        self.processes.check(may_end=(COWORKER, PLAYER))
        self.heartbeats.check(filter(self.processes.running, self.processes.names))
        self._executor.spin_once(timeout_sec=0.1)


class ProgressLine:
    """One line with the progress of the session.

    With several people, whom the arm helps in turn, it counts no right activations; their report
    does. It then counts movements that have ended, as the plan on the page does.
    """

    def __init__(self, total: int, console: Console):
        self.total = total
        self._number, self._active, self._right = 0, "", 0
        self._truth: dict[str, str] = {}
        self._changed = False
        self._text = "waiting for the coworker"
        self._console, self._status = console, console.status(self._text)

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Context in which the line is on the console."""
        with self._status, news(self._console, lambda: self._text):
            yield

    def on_task(self, label: str, person: str = "") -> None:
        """Note the ground truth: a person's movement started, changed, or ended."""
        before, self._truth[person] = self._truth.get(person, ""), label
        self._changed = bool(label and before)
        if label and not before:
            self._active = self._active if person else ""
        elif before and not label:
            self._right += self._active == before
        self._number += bool(before and not label) if person else bool(label and not before)
        self._show()

    def on_active(self, label: str) -> None:
        """Note the active task; with one person the first counts, or the first after a change."""
        keeps = "" in self._truth and not (label and self._changed)
        self._active = (self._active if keeps else "") or label
        self._show()

    def _show(self) -> None:
        agents = [*self._truth.items(), ("robot", self._active)]
        doing = ", ".join(f"{name or 'human'}: {task or '-'}" for name, task in agents)
        right = f", {self._right} right so far" if "" in self._truth else ""
        what = "interaction" if right else "done"
        self._text = f"{what} {self._number}/{self.total}{right}; {doing}"
        self._status.update(self._text)
