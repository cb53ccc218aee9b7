# SPDX-License-Identifier: Apache-2.0
"""The tasks of a worker: task lists with changes of mind, a habit, or a share of a plan.

The habit is a plate, a screw and the screwdriver for each box, with a part sometimes skipped or
taken twice. It is a first-order Markov chain, drawn from a seed. The robot does not know it, and
learns it from recordings of earlier sessions.
"""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intent_recognition.errors import ArgumentError
from intent_recognition.plans import LIKELY_BEFORE, WorkPlan
from intent_recognition.untrusted import UntrustedError, load_yaml, read_text
from sim_bridge.coworker.styles import STYLES, TASKS

CHANGED = re.compile(r"(?P<task>[^>@]+)>(?P<then>[^>@]+)@(?P<share>[^>@]+)")
"""Pattern of a task that is changed to another one: OLD>NEW@SHARE."""
CHANGE_SHARES = (0.15, 0.25, 0.4)
"""Shares of the movement's time at which changes of `change_some` happen."""


REST = "rest"
"""Entry of a task list: wait as long as an interaction usually takes."""


class Intention(NamedTuple):
    """One entry of a task list."""

    task: str  # the task with which the reach begins
    then: str = ""  # the task it is changed to; empty without a change
    share: float = 0.0  # share of the movement's time at which the change begins


def read_intention(text: str) -> Intention:
    """Read one entry of a task list: a label, `REST`, or OLD>NEW@SHARE.

    `plate_handover>hold_screwdriver@0.25` begins as `plate_handover` and changes to the other task
    after a quarter of the movement's time.

    Raises:
        ArgumentError: a label is unknown, both are equal, or the share is not between 0 and 1.
    """
    found = CHANGED.fullmatch(text)
    if not found:
        return Intention(REST if text == REST else _known(text))
    task, then = _known(found["task"].strip()), _known(found["then"].strip())
    try:
        share = float(found["share"])
    except ValueError:
        share = np.nan
    if task == then or not 0.0 < share < 1.0:
        expected = "OLD>NEW@SHARE, two tasks and a share of the movement between 0 and 1"
        raise ArgumentError.about("task_list", expected, repr(text), "Correct the entry.")
    return Intention(task, then, share)


def change_some(tasks: tuple[str, ...], seed: int, count: int) -> tuple[str, ...]:
    """Let the worker change their mind in `count` more interactions, drawn from a seed.

    Raises:
        ArgumentError: fewer than `count` entries can be changed.
    """
    known = map(read_intention, tasks)
    plain = [k for k, one in enumerate(known) if not one.then and one.task != REST]
    if count > len(plain):
        cure = "Let fewer be changed, or do more interactions."
        raise ArgumentError.about("changes", f"at most {len(plain)}", count, cure)
    rng = np.random.default_rng([seed, 13])
    changed = list(tasks)
    for k in sorted(rng.choice(plain, count, replace=False).tolist()) if count else ():
        others = [task for task in TASKS if task != tasks[k]]
        changed[k] = f"{tasks[k]}>{rng.choice(others)}@{rng.choice(CHANGE_SHARES):g}"
    return tuple(changed)


def _known(label: str) -> str:
    if label not in STYLES:
        expected = f"labels of {', '.join(sorted(STYLES))}, or a file of them"
        got, cure = f"{label!r}, which is neither", "Correct the label or the path."
        raise ArgumentError.about("task_list", expected, got, cure)
    return label


def parse_task_list(task_list: str, seed: int, interactions: int) -> tuple[str, ...]:
    """Turn a node's `task_list` parameter into labels.

    Args:
        task_list: "random" (every task equally often, in random order), "habit" (in the
            coworker's habitual order, with variation), labels separated by commas, or a text or
            YAML file with a list of labels. See `read_intention` for changes of mind.
        seed: seed of the order.
        interactions: number of labels, to which a given list is repeated or cut; 0 takes a given
            list as it is, and means 40 for "random" and "habit".

    Raises:
        ArgumentError: a label is unknown, the list is empty, or the file cannot be read.
    """
    if interactions < 0:
        cure = "Give the number of reaches."
        raise ArgumentError.about("interactions", "0 or more", interactions, cure)
    text = task_list.strip()
    if text == "habit":
        return habitual_tasks(seed, interactions or 40)
    if text == "random":
        count = interactions or 40
        rng = np.random.default_rng([seed, 7])
        dealt = [TASKS[k % len(TASKS)] for k in range(count)]
        return tuple(dealt[k] for k in rng.permutation(count))
    labels = _labels_of(text)
    if not labels:
        expected = "labels, a file of them, 'random' or 'habit'"
        cure = f"Name some of {', '.join(sorted(STYLES))}."
        raise ArgumentError.about("task_list", expected, repr(task_list), cure)
    for label in labels:
        read_intention(label)
    if not interactions:
        return labels
    return tuple(labels[k % len(labels)] for k in range(interactions))


def _labels_of(text: str) -> tuple[str, ...]:
    if text and "," not in text and text not in STYLES and Path(text).is_file():
        try:
            content = load_yaml(read_text(Path(text)))
        except (OSError, UntrustedError) as error:
            cure = f"Repair it: {error}."
            raise ArgumentError.about("task_list", "a text or YAML file", text, cure) from error
        if isinstance(content, dict):
            content = content.get("task_list", content.get("tasks", []))
        if isinstance(content, list):
            return tuple(str(label) for label in content)
        text = str(content or "").replace(" ", ",")
    return tuple(label.strip() for label in text.split(",") if label.strip())


FIRST = np.array([0.8, 0.1, 0.1])
"""Probabilities of the first task, in the order of `TASKS`."""
FOLLOWS = np.array([[0.05, 0.85, 0.10], [0.05, 0.10, 0.85], [0.85, 0.10, 0.05]])
"""Probabilities of the next task (columns) after each task (rows), in the order of `TASKS`."""


def habitual_tasks(seed: int, count: int) -> tuple[str, ...]:
    """Draw the tasks of a session from the habit with a seed."""
    rng = np.random.default_rng([seed, 11])
    tasks: list[str] = []
    row = FIRST
    for _ in range(count):
        k = int(rng.choice(len(TASKS), p=row))
        tasks.append(TASKS[k])
        row = FOLLOWS[k]
    return tuple(tasks)


def work_shares(
    plan: WorkPlan, seed: int, n_people: int, n_steps: int = 0
) -> tuple[tuple[str, ...], ...]:
    """Tasks of each of several people who share an assembly, or its first `n_steps` (0 for all).

    In each round, people take steps that may be next, as long as there are any, and else rest;
    whoever has done the fewest chooses first. All steps that may be next are equally probable.
    """
    rng = np.random.default_rng([seed, 23])
    before = plan.before > LIKELY_BEFORE
    left = list(range(len(plan.steps)))
    most = len(left) - (n_steps or len(left))
    shares: list[list[str]] = [[] for _ in range(n_people)]
    while len(left) > most:
        due = [k for k in left if not before[left, k].any()]
        for share in sorted(shares, key=lambda share: len(share) - share.count(REST)):
            task = REST
            if due and len(left) > most:
                step = due.pop(due.index(int(rng.choice(due))))
                left.remove(step)
                task = plan.steps[step].task
            share.append(task)
    ends = (max((k for k, one in enumerate(s, 1) if one != REST), default=0) for s in shares)
    return tuple(tuple(share[:end]) for share, end in zip(shares, ends, strict=True))
