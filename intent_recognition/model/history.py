# SPDX-License-Identifier: Apache-2.0
"""History of a task folder: one line per change, appended in a single write."""

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
    """One change, stored as a line of the history."""

    time: str  # ISO 8601, local time with offset
    # "start" (from an existing model), "learn", "wait" (recorded, but too few to learn yet), "keep"
    # (a correction that changed its task), "improve" (accepted practice) or "undo"
    action: str
    task: str  # label of the recording; empty for none. Paths are relative to the folder
    bag: str  # recording, or folder of practice
    model: str  # model since then; `tasks` counts its demonstrations
    tasks: Mapping[str, int]


def read_history(path: Path) -> list[Change]:
    """All changes of a folder, oldest first; does not modify the folder."""
    return [change for _, change in history_lines(path) if change is not None]


def standing(changes: Sequence[Change]) -> list[Change]:
    """Changes that were not undone, oldest first."""
    kept: list[Change] = []
    for change in changes:
        if change.action == UNDO:
            del kept[-1:]
        else:
            kept.append(change)
    return kept


def undoable(changes: Sequence[Change]) -> Change | None:
    """Change that an undo takes back: the last one in force, unless it is the start."""
    last = standing(changes)[-1:]
    return last[0] if last and last[0].action != START else None


def history_lines(path: Path) -> list[tuple[str, Change | None]]:
    """Lines of the history, each with its change; None for an invalid line."""
    try:
        lines = read_log(path / HISTORY).decode(errors="replace").split("\n")
    except FileNotFoundError:
        return []
    return [(line, _change(line)) for line in lines if line]


def _change(line: str) -> Change | None:
    """Change stored in a line; None if the line is invalid."""
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
    """Whether all values are printable texts, no longer than a path."""
    return all(isinstance(v, str) and len(v) <= 300 and v.isprintable() for v in values)


def is_inside(name: str) -> bool:
    """Whether a path relative to a folder stays inside it."""
    return ".." not in Path(name).parts and name[:1] != "/"
