# SPDX-License-Identifier: Apache-2.0
"""Find bags in folders and check their task labels."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from intent_recognition.bags import cure_of, recordings_in
from intent_recognition.errors import BagError, as_path
from intent_recognition.signals import LABEL, LONGEST_LABEL, Rejection, can_name_task

Paths = str | Path | Iterable[str | Path]


def as_paths(paths: Paths) -> list[Path]:
    """A list of paths, given one path or several."""
    if isinstance(paths, str | Path) or not isinstance(paths, Iterable):
        paths = [paths]
    return [as_path("paths", path) for path in paths]


def find_bags(path: Path, above: frozenset[Path] = frozenset()) -> list[Path]:
    """The bag at `path`, or all bags below it, sorted by name.

    Links to the enclosing folders `above` are not followed.

    Raises:
        BagError: the path does not exist.
    """
    if not path.exists():
        raise BagError(f"{path}: expected a bag or a folder of bags, got nothing. Check the path.")
    own = [path] if path.is_file() else recordings_in(path)
    if own == [path]:
        return own
    inside = above | {path.resolve()}
    own += [f for end in ("", ".active") for f in path.glob(f"*.bag{end}") if f.is_file()]
    folders = [
        folder
        for folder in path.iterdir()
        if folder.is_dir() and not folder.name.startswith(".") and folder.resolve() not in inside
    ]
    return [
        bag
        for found in sorted([*own, *folders])
        for bag in ([found] if found.is_file() else find_bags(found, inside))
    ]


def no_bag(folder: Path) -> Rejection:
    """Rejection of a folder without bags."""
    cure = cure_of(folder, "Check the path.")
    return Rejection(str(folder), "", 0, "there is no bag in this folder", cure)


def check_label(label: str, cure: str = "Give one such as give_cup.") -> None:
    """Make sure that a text can name a task.

    Raises:
        BagError: the label is empty, too long or reserved for no task, or has characters that a
            folder name or terminal cannot show.
    """
    if not can_name_task(label):
        shown = repr(label[:LONGEST_LABEL]) + ("..." if len(label) > LONGEST_LABEL else "")
        raise BagError.about("task", LABEL, shown, cure)


def label_problem(label: str, path: str, topic: str = "", stamp_ns: int = 0) -> Rejection | None:
    """Rejection of a recording whose label cannot name a task; None if the label is valid."""
    try:
        check_label(label)
    except BagError as error:
        return replace(Rejection.of(path, error, "label", stamp_ns), topic=topic)
    return None
