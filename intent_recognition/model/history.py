# SPDX-License-Identifier: Apache-2.0
"""The history of a folder of tasks: one line per change, written at once at the file's end."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from intent_recognition.untrusted import UntrustedError, load_json, read_log

HISTORY = "history.jsonl"
START, LEARN, WAIT, UNDO, KEEP = "start", "learn", "wait", "undo", "keep"
IMPROVE = "improve"
ACTIONS = (START, LEARN, WAIT, UNDO, KEEP, IMPROVE)


@dataclass(frozen=True)
class Change:
    """One line of the history."""

    time: str  # ISO 8601, local time with its offset
    # "start" (a model to begin with), "learn", "wait" (recorded, too few yet to learn from), "keep"
    # (a correction, which moved its task), "improve" (what practice came to) or "undo"
    action: str
    task: str  # label of the recording; empty for none, as the paths, relative to the folder, are
    bag: str  # the recording, or the folder of practice
    model: str  # the model since then, with demonstrations per task in `tasks`
    tasks: Mapping[str, int]


def read_history(path: Path) -> list[Change]:
    """All changes of a folder of tasks, the oldest first; nothing in it is touched."""
    return [change for _, change in history_lines(path) if change is not None]


def standing(changes: Sequence[Change]) -> list[Change]:
    """The changes that were not taken back, of all, the oldest first."""
    kept: list[Change] = []
    for change in changes:
        if change.action == UNDO:
            del kept[-1:]
        else:
            kept.append(change)
    return kept


def undoable(changes: Sequence[Change]) -> Change | None:
    """The change that an undo takes back: the last that stands, unless it is what came first."""
    last = standing(changes)[-1:]
    return last[0] if last and last[0].action != START else None


def history_lines(path: Path) -> list[tuple[str, Change | None]]:
    """Lines of the history, each with its change; None for what is not whole."""
    try:
        lines = read_log(path / HISTORY).decode(errors="replace").split("\n")
    except FileNotFoundError:
        return []
    return [(line, _change(line)) for line in lines if line]


def _change(line: str) -> Change | None:
    """The change of a line, None where it is not a whole one."""
    try:
        change = Change(**load_json(line))
    except (TypeError, UntrustedError):
        return None
    texts = (change.time, change.action, change.task, change.bag, change.model)
    if not are_texts(texts) or not isinstance(change.tasks, dict) or not are_texts(change.tasks):
        return None
    counted = all(isinstance(n, int) and 0 <= n < 10**9 for n in change.tasks.values())
    inside = is_inside(change.bag) and is_inside(change.model)
    return change if counted and inside and change.action in ACTIONS else None


def are_texts(values: Iterable[object]) -> bool:
    """Whether all are texts that a terminal may see, and no longer than paths are."""
    return all(isinstance(v, str) and len(v) <= 300 and v.isprintable() for v in values)


def is_inside(name: str) -> bool:
    """Whether a path relative to a folder stays in it."""
    return ".." not in Path(name).parts and name[:1] != "/"
