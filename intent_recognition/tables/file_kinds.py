# SPDX-License-Identifier: Apache-2.0
"""Kinds of files in a folder of recordings, and what their names say."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from intent_recognition.errors import BagError
from intent_recognition.tables.files import name_below, open_table
from intent_recognition.tables.table import Table

NUMBERED = re.compile(r"(?P<task>.+?)(?P<between>[_\- ])\d+")
"""Names such as `give_bracket_07`."""


class FileKind(NamedTuple):
    """Files with the same columns.

    Attributes:
        name: of their folder, or what they are called by.
        first: path of the first one below the source.
        table: what it holds.
        pattern: of their names; empty where they follow none.
    """

    name: str
    first: str
    table: Table
    pattern: str

    @property
    def says_task(self) -> bool:
        """Whether their names tell the task."""
        return "{task}" in self.pattern


def file_kinds(source: Path, paths: Sequence[Path]) -> list[FileKind]:
    """The kinds of the files in a folder: one, or several that each recording has.

    Folders of files with the same columns are one kind. Several kinds belong together only where
    their files are named alike; else the one with most files is meant. Others beside them, such as
    notes and calibrations, are none.

    Raises:
        BagError: nothing can be read.
    """
    folders: dict[tuple[Path, str, bool], list[Path]] = {}
    for path in paths:
        is_numbered = NUMBERED.fullmatch(path.stem) is not None
        folders.setdefault((path.parent, path.suffix.lower(), is_numbered), []).append(path)
    kinds: dict[tuple[str, ...], list[Path]] = {}
    tables: dict[tuple[str, ...], Table] = {}
    errors: list[BagError] = []
    for files in folders.values():
        try:
            table = open_table(files[0])
        except BagError as error:
            errors.append(error)
            continue
        kinds.setdefault(table.names, []).extend(files)
        tables.setdefault(table.names, table)
    if not kinds:
        raise errors[0]
    most = max(map(len, kinds.values()))
    kinds = {names: files for names, files in kinds.items() if 2 * len(files) >= most}
    found = []
    for names, files in kinds.items():
        first, pattern = files[0], name_pattern(source, files)
        found.append(FileKind(_name(first), name_below(source, first), tables[names], pattern))
    stems = [{path.stem for path in files} for files in kinds.values()]
    together = all(kind.pattern for kind in found) and len({k.name for k in found}) == len(found)
    if together and set.intersection(*stems):
        return found
    (names, _) = max(kinds.items(), key=lambda item: (len(item[1]), len(item[0])))
    return [kind for kind in found if kind.table.names == names]


def _name(path: Path) -> str:
    return re.sub(r"\W+", "_", path.parent.name)


def name_pattern(source: Path, files: Sequence[Path]) -> str:
    """How the files are named below a folder; empty where no rule is seen."""
    if files[0] == source:
        return ""
    inside = [path.relative_to(source) for path in files]
    above, suffix = {path.parent.as_posix() for path in inside}, files[0].suffix
    if len(above) > 1:
        if all("/" not in folder and folder != "." for folder in above):
            return "{task}/{number}" + suffix
        return ""
    (folder,) = above
    before = "" if folder == "." else f"{folder}/"
    matches = [NUMBERED.fullmatch(path.stem) for path in inside]
    betweens = {match["between"] for match in matches if match}
    if all(matches) and len(betweens) == 1:
        return f"{before}{{task}}{betweens.pop()}{{number}}{suffix}"
    return f"{before}{{number}}{suffix}" if len(files) > 1 and before else ""
