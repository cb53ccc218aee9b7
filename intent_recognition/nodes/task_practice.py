# SPDX-License-Identifier: Apache-2.0
"""Practice of a teacher's tasks: computed between recordings, or judged by a person.

With a computed cost, rollouts are executed in the arm's kinematics, one after the other, while
nothing is recorded and no task is active. With `thumbs`, the estimator gets the library with a
trial point; a person's judgement of the next execution, on `intent/feedback`, is the cost of this
point, and the next point follows. The library stays unchanged until `~/accept`.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.improvement import Cost, PracticeSession, Rollout, load_cost
from intent_recognition.model import DOWN, THUMBS, UP, PractisedTask
from intent_recognition.nodes.diagnostics import Level

COST_OF = {UP: 0.0, DOWN: 1.0}


class _Begun(NamedTuple):
    """Practice that was begun, and its cost."""

    practised: PractisedTask
    session: PracticeSession
    cost: str

    @property
    def by_thumbs(self) -> bool:
        return self.cost == THUMBS


class TaskPracticeService:
    """Begins, ends and accepts practice of a task; `trial` is the model on trial, or None."""

    def __init__(self, teacher: Any) -> None:
        self._teacher = teacher
        self.running = False
        self.trial: Path | None = None
        self._begun: _Begun | None = None
        self._point: Floats | None = None
        self._judged_before: str | None = None

    def start(self) -> str:
        """Begin or continue practice; returns what is practised."""
        if self.running:
            raise ArgumentError.about("~/practise", "no practice", "one", "End it first.")
        self._begun = begun = self._open()
        judged = self._teacher.estimator_runs() and self._teacher.executions.records
        if begun.by_thumbs and not judged:
            cure = "Start the graph, and leave `executions` above 0."
            expected = "an estimator, and recordings of executions"
            raise ArgumentError.about("practice by thumbs", expected, "none", cure)
        self.running = True
        text = f"practising {begun.practised.task} by {begun.cost}"
        self._teacher.report(Level.OK, f"{text}, {len(begun.session.tried)} rollouts so far")
        if begun.by_thumbs:
            self._try_next()
        return text

    def stop(self) -> str:
        """End practice, which can be continued later; returns its state."""
        if not self.running or self._begun is None:
            raise ArgumentError.about("~/practise", "practice to end", "none", "Begin one first.")
        return self._end("ended")

    def accept(self) -> str:
        """Put the result of practice into the library; returns what changed."""
        begun = self._open() if self._begun is None else self._begun
        what = f"accepted practice of {begun.practised.task}"
        change = begun.practised.accept(begun.session)
        self.running, self.trial, self._begun = False, None, None
        return self._teacher.changed(change, what)

    def step(self) -> None:
        """Execute one rollout, if the arm and the recorder have nothing else to do."""
        begun = self._begun
        if not self.running or begun is None or begun.by_thumbs or self._teacher.is_recording:
            return
        try:
            begun.session.step()
        except IntentError as error:
            self._fail(error)
            return
        self._after_one(begun)

    def in_use(self) -> None:
        """Count executions that begin from now on: the estimator has loaded the trial."""
        if self.running and self._begun is not None and self._begun.by_thumbs:
            task = self._begun.practised.task
            self._judged_before = self._teacher.executions.last(task)

    def judge(self, task: str, execution: str, thumbs: str) -> None:
        """Take a person's judgement of the last execution of a task, named by its recording."""
        begun = self._begun
        if not self.running or begun is None or not begun.by_thumbs or self._point is None:
            return
        before = self._judged_before
        if begun.practised.task != task or before is None or execution in ("", before):
            return
        if thumbs not in COST_OF:
            return
        bag = f"executions/{task}/{execution}"
        try:
            begun.session.keep(self._point, COST_OF[thumbs], bag, {THUMBS: COST_OF[thumbs]})
        except IntentError as error:
            self._fail(error)
            return
        self._after_one(begun)
        if self.running:
            self._try_next()

    def _open(self) -> _Begun:
        teacher = self._teacher
        names = ("task", "practice_cost", "practice_beside", "practice_seed")
        task, cost, beside, seed = (teacher.get_parameter(name).value for name in names)
        if not task:
            cure = "Set the parameter task."
            raise ArgumentError.about("parameter task", "the label of a task", "none", cure)
        practised = PractisedTask(teacher.folder, task, beside_m=_numbers(beside))
        known = (*practised.practice.costs, THUMBS)
        costs = Cost(THUMBS, _unjudged) if cost == THUMBS else load_cost(cost, known, files=False)
        session = practised.session(costs, int(seed))
        return _Begun(practised, session, cost)

    def _try_next(self) -> None:
        assert self._begun is not None
        begun = self._begun
        self._judged_before = None
        try:
            self._point = begun.session.next()
            self.trial = begun.practised.write_trial(begun.session)
        except IntentError as error:
            self._fail(error)
            return
        self._teacher.send_model(f"trying point {len(begun.session.tried) + 1}")

    def _after_one(self, begun: _Begun) -> None:
        tried = begun.session.tried
        wanted = int(self._teacher.get_parameter("practice_rollouts").value)
        diagnostics = self._teacher.diagnostics
        diagnostics.value("practice", f"{begun.practised.task}, {len(tried)} of {wanted}")
        costs = begun.session.costs
        shown = ", ".join(f"{cost:.3g}" for cost in (costs[0], costs.min(), costs[-1]))
        diagnostics.value("practice cost first, cheapest, last", shown)
        if len(tried) >= wanted:
            self._end("practised")

    def _end(self, how: str) -> str:
        assert self._begun is not None
        self.running, tried = False, self._begun.session.tried
        text = f"{how}: {self._begun.practised.task}, {len(tried)} rollouts; ~/accept takes it over"
        if self.trial is not None:
            self.trial = None
            self._teacher.send_model(text)
        else:
            self._teacher.report(Level.OK, text)
        return text

    def _fail(self, error: IntentError) -> None:
        self.running = False
        self._teacher.report(Level.WARN, f"practice ended: {error}")
        if self.trial is not None:
            self.trial = None
            self._teacher.send_model("the model of the library again")


def _numbers(text: str) -> tuple[float, ...] | None:
    if not text.strip():
        return None
    try:
        found = tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        found = ()
    if len(found) != 3 or not np.all(np.isfinite(found)):
        cure = "Such as `-0.17 0 0.01`."
        raise ArgumentError.about("practice_beside", "three numbers in m", repr(text), cure)
    return found


def _unjudged(_: Rollout) -> float:
    raise ValueError("only a person judges")
