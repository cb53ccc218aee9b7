# SPDX-License-Identifier: Apache-2.0
"""Plans and sessions as YAML, which people can read and edit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import yaml

from intent_recognition.errors import ArgumentError, nearest
from intent_recognition.plans.work_plan import CHECKS, Pair, WorkPlan, WorkStep

BEFORE = " < "
STEP_KEYS = ("step", "task", "share", "who", "objects", "duration", "after")
PLAN_KEYS = ("assemblies", "repeated", "wrong", "steps", "order", "by_hand")


class DoneTask(NamedTuple):
    """A task that a person or robot did in an assembly, and how many objects of each kind it used.

    An unknown name is empty, and an unknown time is 0.
    """

    task: str
    who: str = ""
    objects: Mapping[str, float] = {}
    duration_s: float = 0.0


Assembly = tuple[DoneTask, ...]
"""One assembly: the tasks done, in order."""


def write_plan(plan: WorkPlan) -> str:
    """YAML of a plan, for `read_plan`.

    Raises:
        ArgumentError: a step has a name that the file cannot hold.
    """
    steps = []
    for step in plan.steps:
        row = {"step": _named("plan", step.name), "task": step.task, "share": step.share}
        known = dict(step.who), dict(step.objects), step.duration_s, dict(step.after)
        more = zip(STEP_KEYS[len(row) :], known, strict=True)
        steps.append(row | {key: value for key, value in more if value})
    content = {
        "assemblies": plan.n_assemblies,
        "repeated": plan.repeated,
        "wrong": plan.wrong,
        "steps": steps,
        "order": {BEFORE.join(pair): p for pair, p in plan.order.items()},
        "by_hand": {BEFORE.join(pair): p for pair, p in plan.by_hand.items()},
    }
    return str(yaml.safe_dump(content, sort_keys=False, allow_unicode=True))


def read_plan(text: str) -> WorkPlan:
    """Read a plan from YAML.

    For example::

        steps:
        - {step: base, task: base_handover, share: 0.97, duration: 3.1}
        - {step: screw, task: screw_handover, objects: {screw: 2}, who: {anna: 1.0}}
        order:
          base < screw: 0.96
        by_hand:
          base < screw: 1

    Only `steps` is required, and for each step its name or its task.

    Raises:
        ArgumentError: the text is not a plan.
    """
    content = CHECKS.load("plan", text)
    steps = content.get("steps") if isinstance(content, Mapping) else None
    if not isinstance(steps, list) or not steps:
        CHECKS.refuse("plan", "steps: [...]", content)
    CHECKS.keys("plan", content, PLAN_KEYS)
    numbers = {
        key: CHECKS.number(f"plan, {key}", content[key], 0.0)
        for key in ("repeated", "wrong")
        if key in content
    }
    return WorkPlan(
        tuple(_step(f"plan, step {k + 1}", one) for k, one in enumerate(steps)),
        _relations("plan, order", content.get("order")),
        _relations("plan, by_hand", content.get("by_hand")),
        n_assemblies=int(CHECKS.number("plan, assemblies", content.get("assemblies", 0), 0.0)),
        **numbers,
    )


def read_assemblies(text: str) -> tuple[Assembly, ...]:
    """Read sessions from YAML: a list of tasks is one assembly, a list of lists is several.

    A task is a label, or a mapping with `task`, `who`, `start` and `end` [s], and `objects`::

        - [base, screw, {task: lid, who: anna, start: 7.5, end: 9.0, objects: {lid: 1}}]
        - [base, lid, screw]

    Raises:
        ArgumentError: the text does not hold sessions.
    """
    content = CHECKS.load("session", text)
    if not isinstance(content, list) or not content:
        CHECKS.refuse("session", "a list of tasks, or of such lists", content)
    several = content if isinstance(content[0], list) else [content]
    if not all(isinstance(one, list) for one in several):
        CHECKS.refuse("session", "either tasks or lists of tasks", content)
    if (n_tasks := sum(map(len, several))) > 100_000:
        CHECKS.refuse("session", "at most 100000 tasks", n_tasks)
    return tuple(
        tuple(_done(f"assembly {a + 1}, task {k + 1}", one) for k, one in enumerate(assembly))
        for a, assembly in enumerate(several)
    )


def begun_with(assemblies: Sequence[Assembly], task: str) -> tuple[Assembly, ...]:
    """Split assemblies before each occurrence of the task with which every assembly begins.

    Raises:
        ArgumentError: no assembly has the task.
    """
    tasks = {one.task for assembly in assemblies for one in assembly}
    if task not in tasks:
        cure = nearest(task, tasks, "Name a task that was recorded.")
        raise ArgumentError.about("first", f"one of {', '.join(sorted(tasks))}", task, cure)
    out: list[list[DoneTask]] = []
    for assembly in assemblies:
        for k, one in enumerate(assembly):
            if k == 0 or one.task == task:
                out.append([])
            out[-1].append(one)
    return tuple(map(tuple, out))


def _done(place: str, content: Any) -> DoneTask:
    if not isinstance(content, Mapping):
        content = {"task": content}
    CHECKS.keys(place, content, ("task", "who", "start", "end", "objects"))
    task, who = content.get("task"), content.get("who")
    start = CHECKS.number(place, content.get("start", content.get("end", 0.0)))
    end = CHECKS.number(place, content.get("end", start))
    if end < start:
        CHECKS.refuse(place, "an end after the start", f"{start:g} to {end:g}")
    return DoneTask(
        _text(place, "a task", None if task == "" else task),
        "" if who in (None, "") else _text(place, "one person as who", who),
        _numbers(f"{place}, objects", content.get("objects")),
        end - start,
    )


def _step(place: str, content: Any) -> WorkStep:
    if not isinstance(content, Mapping) or not {"step", "task"} & set(content):
        CHECKS.refuse(place, "a step and its task", content)
    CHECKS.keys(place, content, STEP_KEYS)
    name = _text(place, "a text as step", content.get("step", content.get("task")))
    return WorkStep(
        _named(place, name),
        _text(place, "a text as task", content.get("task", name)),
        CHECKS.number(f"{place}, share", content.get("share", 1.0), 0.0),
        _numbers(f"{place}, who", content.get("who")),
        _numbers(f"{place}, objects", content.get("objects")),
        CHECKS.number(f"{place}, duration", content.get("duration", 0.0), 0.0),
        _numbers(f"{place}, after", content.get("after")),
    )


def _text(place: str, expected: str, content: Any) -> str:
    if type(content) not in (str, int):
        CHECKS.refuse(place, expected, content)
    return str(content)


def _named(place: str, name: str) -> str:
    if not name or name != name.strip() or BEFORE.strip() in name:
        CHECKS.refuse(place, "a name without <, or spaces around it", repr(name))
    return name


def _relations(place: str, content: Any) -> dict[Pair, float]:
    found: dict[Pair, float] = {}
    for key, p in _numbers(place, content).items():
        first, sign, then = (part.strip() for part in key.partition(BEFORE.strip()))
        if not (first and sign and then) or BEFORE.strip() in then or (first, then) in found:
            CHECKS.refuse(place, "FIRST < THEN: probability, once for each pair", key)
        found[first, then] = p
    return found


def _numbers(place: str, content: Any) -> dict[str, float]:
    if content is None:
        return {}
    if not isinstance(content, Mapping):
        CHECKS.refuse(place, "names with a number each", content)
    return {
        str(key): CHECKS.number(f"{place}, {key}", value, 0.0) for key, value in content.items()
    }
