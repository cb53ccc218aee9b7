# SPDX-License-Identifier: Apache-2.0
"""Find and open the tables in files of every supported kind, by suffix."""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from intent_recognition.errors import BagError
from intent_recognition.tables.arrays import open_hdf5, open_npy, open_npz
from intent_recognition.tables.c3d import open_c3d
from intent_recognition.tables.landmarks import FRAMES, open_frames, open_landmarks
from intent_recognition.tables.parquet import open_lerobot, open_parquet
from intent_recognition.tables.skeletons import open_bvh, open_mvnx
from intent_recognition.tables.table import MOST_TEXT, Table, unusable
from intent_recognition.tables.text import TEXTS, open_text
from intent_recognition.untrusted import UntrustedError, check_regular

LEROBOT = "meta/info.json"
SUFFIXES: dict[str, Callable[[Path], Table]] = {
    ".npz": open_npz,
    ".npy": open_npy,
    ".parquet": open_parquet,
    ".c3d": open_c3d,
    ".bvh": open_bvh,
    ".mvnx": open_mvnx,
    ".mat": open_hdf5,
    ".h5": open_hdf5,
    ".hdf5": open_hdf5,
    ".json": open_landmarks,
    ".jsonl": open_landmarks,
}


MOST_TRIED = 10
"""Most files of a folder that are opened to find one that tells what is in all."""


def open_table(path: Path, skip_rows: int = 0) -> Table:
    """Open the table in a file, or in a folder with a LeRobot data set or OpenPose's frames."""
    if is_lerobot(path):
        return open_lerobot(path)
    if path.is_dir():
        return open_frames(path)
    if _is_packed(path):
        raise unusable(path, "an unpacked file", path.suffix, "Unpack it first.")
    is_text = path.suffix.lower() in TEXTS
    try:
        check_regular(path, MOST_TEXT if is_text else None)
    except (OSError, UntrustedError) as error:
        raise unusable(path, "a file that can be read", error, "Check the path.") from error
    return open_text(path, skip_rows) if is_text else SUFFIXES[path.suffix.lower()](path)


def is_lerobot(path: Path) -> bool:
    """Whether a folder is a LeRobot data set."""
    return (path / LEROBOT).is_file()


def is_table(path: Path) -> bool:
    """Whether a file has the suffix of a table, packed or not."""
    suffix = (path.with_suffix("") if _is_packed(path) else path).suffix.lower()
    return suffix in TEXTS or suffix in SUFFIXES


def _is_packed(path: Path) -> bool:
    return path.suffix.lower() in (".gz", ".bz2", ".xz", ".zip")


def find_tables(source: Path) -> list[Path]:
    """The tables at a path or in a folder, sorted by name; raises BagError if there is none."""
    if found := tables_at(source):
        return found
    kinds = ", ".join([*TEXTS, *SUFFIXES])
    got = "nothing of that name" if not source.exists() else "none"
    cure = (
        "Check the path; unpack what is packed; save spreadsheets as CSV, pickles and Feather as"
        " Parquet, and messages with `ros2 bag record` or `ros2 topic echo --csv`."
    )
    raise BagError.about(str(source), f"{kinds} or a LeRobot data set", got, cure)


def tables_at(source: Path) -> list[Path]:
    """The tables at a path or in a folder, sorted by name; empty if there is none."""
    if is_lerobot(source) or source.is_file():
        return [source] if is_lerobot(source) or is_table(source) else []
    # names that begin so are of locks of LibreOffice and Excel, and of copies by macOS
    files = [
        path
        for path in source.rglob("*")
        if path.is_file() and is_table(path) and not path.name.startswith((".", "~$"))
    ]
    files = [path for path in files if path.suffix.lower() != ".log"] or files  # else of programs
    frames = {path.parent for path in files if path.name.endswith(FRAMES)}
    sets = {path.parent.parent for path in files if path.relative_to(source).match(LEROBOT)}
    alone = [
        path
        for path in files
        if path.parent not in frames and not any(one in path.parents for one in sets)
    ]
    return sorted({*alone, *frames, *sets})


def name_below(source: Path, path: Path) -> str:
    """A path relative to the folder `source`; for the source itself, its name."""
    return path.name if path == source else path.relative_to(source).as_posix()


NUMBERED = re.compile(
    r"(?P<task>.+?)(?P<date>(?:[_\- ](?:\d{6,}|\d{4}-\d\d-\d\d))?)"
    r"(?P<between>[_\- ])\d+(?:[-.]\d\d[-.]\d\d)?"
)
"""Names such as `give_bracket_07`, `give_20240131_100000` and `give_2024-01-31-10-00-00`."""
DATED = re.compile(r"\d{4}[_.-]\d\d[_.-]\d\d")
"""Dates in a name that is no task, such as rosbag2's `rosbag2_2024_01_31-10_00_00`."""
STREAM = re.compile(r"(?P<recording>.+[_\- ]\d+)(?P<end>[_\- ]\D+)")
"""Names such as `give_07_wrist`, beside `give_07_cup`."""
CONDITION = re.compile(
    r"(?i).(?:fast|slow|normal|near|far|high|low|easy|hard|pre|post|good|bad|success|fail(?:ed)?)"
)
"""Ends of file names for the condition of a recording, which do not distinguish its streams."""
NO_TASK = re.compile(
    r"(?i)(?:demo|demonstration|traj|trajectory|episode|ep|trial|take|rec|recording|run|data|log"
    r"|p|s|sub|subj|subject|participant|person|user|day|ses|session)?[\W_\d]*"
)
"""Numbered or dated names that describe recordings or people rather than tasks."""
OF_ROBOT = re.compile(
    r"(?i)(?<![^\W_])(?:robot|gripper|tcp|eef?|end_?effector)(?:[_\- ]?(?:left|right|[lrab]))?"
    r"(?![^\W\d_])"
)
"""Names of files of a robot's movement, or of one of its arms."""


class FileKind(NamedTuple):
    """Files with the same columns: their folder's name or the common end of their names, the first
    file's path relative to the source, its table, and the pattern of their names, "" for none.
    """

    name: str
    first: str
    table: Table
    pattern: str


def file_kinds(source: Path, paths: Sequence[Path]) -> list[FileKind]:
    """The kinds of files in a folder: one, or several of which each recording has a file.

    Folders of files with the same columns are one kind. Several kinds belong together only if their
    files are named alike; else only the kind with most files is returned. Rarer kinds, such as
    notes and calibrations, are ignored.

    Raises:
        BagError: no file can be read.
    """
    if of_recordings := _of_recordings(source, paths):
        return of_recordings
    folders: dict[tuple[Path, str, bool], list[Path]] = {}
    for path in paths:
        is_numbered = NUMBERED.fullmatch(path.stem) is not None
        folders.setdefault((path.parent, path.suffix.lower(), is_numbered), []).append(path)
    kinds: dict[tuple[str, tuple[str, ...]], list[Path]] = {}
    tables: dict[tuple[str, tuple[str, ...]], Table] = {}
    errors: list[BagError] = []
    for files in folders.values():
        try:
            first, table = _first_table(files)
        except BagError as error:
            errors.append(error)
            continue
        for end, own in _streams(files[files.index(first) :]).items():
            kinds.setdefault((end, table.names), []).extend(own)
            tables.setdefault((end, table.names), open_table(own[0]) if end else table)
    if not kinds:
        raise errors[0]
    most = max(map(len, kinds.values()))
    kinds = {key: files for key, files in kinds.items() if 2 * len(files) >= most}
    found = []
    for (end, names), files in kinds.items():
        name = re.sub(r"\W+", "_", end.lstrip("_- ") or files[0].parent.name)
        below, pattern = name_below(source, files[0]), name_pattern(source, files, end)
        found.append(FileKind(name, below, tables[end, names], pattern))
    stems = [{path.stem.removesuffix(end) for path in files} for (end, _), files in kinds.items()]
    together = all(kind.pattern for kind in found) and len({k.name for k in found}) == len(found)
    if together and set.intersection(*stems):
        return found
    (_, names), _ = max(kinds.items(), key=lambda item: (len(item[1]), len(item[0][1])))
    main, *same = [kind for kind in found if kind.table.names == names]
    if others := [kind.first for kind in found if kind.table.names != names]:
        said = f"{', '.join(others)} and its like are left out: no file here has the same name."
        main = main._replace(table=replace(main.table, notes=(*main.table.notes, said)))
    return [main, *same]


def _first_table(files: Sequence[Path]) -> tuple[Path, Table]:
    """The first file that can be read, and its table; raises the BagError of the first of all."""
    for path in files[:MOST_TRIED]:
        with suppress(BagError):
            return path, open_table(path)
    return files[0], open_table(files[0])


def _of_recordings(source: Path, paths: Sequence[Path]) -> list[FileKind]:
    """Kinds of files of which each recording has one, in a folder or with a number of its own.

    Such are `give_1/human.csv` beside `give_1/robot.csv`, `human_1.csv` beside `robot_1.csv`, also
    in a folder for each task or person, or a lone `human.csv` beside `robot.csv`.
    """
    by_folder: dict[str, dict[str, Path]] = {}
    by_number: dict[str, dict[str, Path]] = {}
    for path in () if paths == [source] else paths:
        by_folder.setdefault(path.name, {})[str(path.parent)] = path
        if source in path.parents[:2] and (match := re.fullmatch(r"(\D+)(\d+)", path.stem)):
            of = "group" if NO_TASK.fullmatch(path.parent.name) else "task"
            above = "" if path.parent == source else f"{{{of}}}/"
            key = f"{path.parent}/{match[2]}"
            by_number.setdefault(f"{above}{match[1]}{{number}}{path.suffix}", {})[key] = path
    recordings = {Path(key) for keys in by_number.values() for key in keys}
    # in folders with one number each, such as `give_1/marker_1.csv`, it is no recording's
    are_alone = 1 < len(recordings) == len({recording.parent for recording in recordings})
    first, second = (by_folder, by_number) if are_alone else (by_number, by_folder)
    return _kinds_of_parts(source, first) or _kinds_of_parts(source, second)


def _kinds_of_parts(source: Path, parts: Mapping[str, Mapping[str, Path]]) -> list[FileKind]:
    """Kinds of the files that most recordings have, by file name or pattern, then by recording.

    Empty unless there are several, with names of their own and mostly other columns, as those with
    the same may be of several tasks; the columns do not matter where others are named like a
    robot's file but for the robot, such as `give_human` or `give_robot_right` beside `give_robot`.
    """
    stems = [Path(name).stem for name in parts]
    rests = [OF_ROBOT.split(stem) for stem in stems if OF_ROBOT.search(stem)]
    are_pairs = any(all(part in stem for stem in stems for part in rest) for rest in rests)
    is_named = are_pairs or 0 < len(rests) < len(stems)
    counts = Counter(chain.from_iterable(parts.values()))
    shared = {recording for recording, count in counts.items() if count > 1}
    most = max(map(len, parts.values()), default=0)
    found: list[FileKind] = []
    for name, files in parts.items():
        is_whole = is_named and all(path.parent == source for path in files.values())
        is_whole = is_whole or "{number}" in name
        pattern = name if is_whole else _pattern_of_folders(source, name, files)
        if not pattern or 2 * len(files.keys() & shared) <= most:
            continue
        try:
            first, table = _first_table([*files.values()])
        except BagError:  # notes
            continue
        columns = {*table.names}
        for kind in () if are_pairs else found:
            if 2 * len(columns & {*kind.table.names}) >= min(len(columns), len(kind.table.names)):
                return []
        short = re.sub(r"\W+", "_", Path(name.replace("{number}", "")).stem).strip("_")
        found.append(FileKind(short, name_below(source, first), table, pattern))
    return found if len({kind.name for kind in found}) == len(found) > 1 else []


def _pattern_of_folders(source: Path, name: str, files: Mapping[str, Path]) -> str:
    """Pattern of files of one name in a folder for each recording; empty if none fits."""
    folders = [path.parent for path in files.values()]
    are_flat = all(folder.parent == source for folder in folders)
    folder = name_pattern(source, folders) or "{number}" * are_flat
    return f"{folder}/{name}" if folder else ""


def _streams(files: Sequence[Path]) -> dict[str, list[Path]]:
    """Files by the ends of their names, if each recording has a file with each end, and those of
    one recording have equal lengths or different columns; else all files under "".
    """
    found: dict[str, dict[str, Path]] = {}
    for match, path in ((STREAM.fullmatch(path.stem), path) for path in files):
        if match is None:
            return {"": [*files]}
        found.setdefault(match["end"], {})[match["recording"]] = path
    first, *others = found.values()
    if others and all(of.keys() == first.keys() for of in others):
        tables = [open_table(next(iter(of.values()))) for of in found.values()]
        differ = len({table.names for table in tables}) == len(tables)
        are_takes = any(map(CONDITION.fullmatch, found))
        if differ or (not are_takes and len({t.read([0])[0].size for t in tables}) == 1):
            return {end: [*of.values()] for end, of in found.items()}
    return {"": [*files]}


def name_pattern(source: Path, files: Sequence[Path], end: str = "") -> str:
    """Pattern of the names of files below a folder, with the common `end`; empty if none fits."""
    if files[0] == source:
        return ""
    inside = [path.relative_to(source) for path in files]
    above, suffix = {path.parent.as_posix() for path in inside}, files[0].suffix
    if len(above) > 1:
        are_flat = all("/" not in folder and folder != "." for folder in above)
        if are_flat and not all(map(NO_TASK.fullmatch, above)):
            return "{task}/{number}" + suffix
        return ""
    (folder,) = above
    before = "" if folder == "." else f"{folder}/"
    matches = [NUMBERED.fullmatch(path.stem.removesuffix(end)) for path in inside]
    ends = {(match["date"][:1], match["between"]) for match in matches if match}
    tasks = {match["task"] for match in matches if match}
    are_tasks = not any(map(DATED.search, tasks)) and not all(map(NO_TASK.fullmatch, tasks))
    if all(matches) and are_tasks and len(ends) == 1:
        date, between = ends.pop()
        return f"{before}{{task}}{date}{'{date}' * bool(date)}{between}{{number}}{end}{suffix}"
    return f"{before}{{number}}{end}{suffix}" if end or (len(files) > 1 and before) else ""
