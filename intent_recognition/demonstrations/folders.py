# SPDX-License-Identifier: Apache-2.0
"""Bags in folders."""

from collections.abc import Iterable
from pathlib import Path

from intent_recognition.bags import FILE_NAME, cure_of
from intent_recognition.errors import BagError
from intent_recognition.signals import Rejection

Paths = str | Path | Iterable[str | Path]


def as_paths(paths: Paths) -> list[Path]:
    """One path or several, as several."""
    return [Path(p) for p in ([paths] if isinstance(paths, str | Path) else paths)]


def find_bags(path: Path, above: frozenset[Path] = frozenset()) -> list[Path]:
    """The bag `path` is, or all bags below it, sorted by name.

    Args:
        path: a bag, a file or a folder.
        above: folders that it lies in, with links resolved; a link to one of them is not followed.

    Raises:
        BagError: the path does not exist.
    """
    if not path.exists():
        raise BagError(f"{path}: expected a bag or a folder of bags, got nothing. Check the path.")
    if path.is_file() or _is_bag(path):
        return [path]
    folders = sorted(f for f in path.iterdir() if f.is_dir() and not f.name.startswith("."))
    inside = above | {path.resolve()}
    return [
        bag
        for folder in folders
        if folder.resolve() not in inside
        for bag in find_bags(folder, inside)
    ]


def no_bag(folder: Path) -> Rejection:
    """Of a folder without bags."""
    cure = cure_of(folder, "Check the path.")
    return Rejection(str(folder), "", 0, "there is no bag in this folder", cure)


def _is_bag(folder: Path) -> bool:
    return (folder / FILE_NAME).exists() or any(folder.glob("*.mcap"))
