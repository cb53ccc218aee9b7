# SPDX-License-Identifier: Apache-2.0
"""Tables of every kind of file, by its suffix."""

from collections.abc import Callable
from pathlib import Path

from intent_recognition.errors import BagError
from intent_recognition.tables.bvh import open_bvh
from intent_recognition.tables.c3d import open_c3d
from intent_recognition.tables.hdf5 import open_hdf5
from intent_recognition.tables.landmarks import FRAMES, open_frames, open_landmarks
from intent_recognition.tables.lerobot import open_lerobot
from intent_recognition.tables.mvnx import open_mvnx
from intent_recognition.tables.npz import open_npy, open_npz
from intent_recognition.tables.parquet import open_parquet
from intent_recognition.tables.table import Table, unusable
from intent_recognition.tables.text import MOST_CSV, TEXTS, open_text
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


def open_table(path: Path, skip_rows: int = 0) -> Table:
    """The table in a file, or in the folder of a LeRobot data set or of OpenPose's frames."""
    if is_lerobot(path):
        return open_lerobot(path)
    if path.is_dir():
        return open_frames(path)
    is_text = path.suffix.lower() in TEXTS
    try:
        check_regular(path, MOST_CSV if is_text else None)
    except (OSError, UntrustedError) as error:
        raise unusable(path, "a file that can be read", error, "Check the path.") from error
    return open_text(path, skip_rows) if is_text else SUFFIXES[path.suffix.lower()](path)


def is_lerobot(path: Path) -> bool:
    """Whether a folder is a LeRobot data set."""
    return (path / LEROBOT).is_file()


def is_table(path: Path) -> bool:
    """Whether a file can be imported, by its name."""
    return path.suffix.lower() in TEXTS or path.suffix.lower() in SUFFIXES


def has_tables(source: Path) -> bool:
    """Whether something of a path can be imported as a table."""
    if source.is_file() or is_lerobot(source):
        return is_lerobot(source) or is_table(source)
    return any(path.is_file() and is_table(path) for path in source.rglob("*"))


def find_tables(source: Path) -> list[Path]:
    """What of a path can be imported: itself, or what is in a folder, sorted by name."""
    if is_lerobot(source) or (source.is_file() and is_table(source)):
        return [source]
    files = [path for path in source.rglob("*") if path.is_file() and is_table(path)]
    frames = {path.parent for path in files if path.name.endswith(FRAMES)}
    sets = {path.parent.parent for path in files if path.match(LEROBOT)}
    alone = [
        path
        for path in files
        if path.parent not in frames and not any(one in path.parents for one in sets)
    ]
    found = sorted({*alone, *frames, *sets})
    if not found:
        kinds = ", ".join([*TEXTS, *SUFFIXES])
        got = "nothing of that name" if not source.exists() else "none"
        cure = "Check the path; save spreadsheets as CSV."
        raise BagError.about(str(source), f"{kinds} or a LeRobot data set", got, cure)
    return found


def name_below(source: Path, path: Path) -> str:
    """A path as it is seen from a folder; of the source itself its name."""
    return path.name if path == source else path.relative_to(source).as_posix()
