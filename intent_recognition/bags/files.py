# SPDX-License-Identifier: Apache-2.0
"""Find the files of a recording and read its metadata.yaml."""

import gzip
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path, PureWindowsPath
from typing import Any

import zstandard

from intent_recognition.bags.mcap.chunk import MOST_CHUNK
from intent_recognition.bags.mcap.scan import MAGIC, MOST_EXPANSION
from intent_recognition.bags.messages import ZSTD
from intent_recognition.bags.metadata import FILE_NAME, BagMetadata, read_metadata
from intent_recognition.errors import BagError, one_line

GZIP = b"\x1f\x8b"
KINDS = {MAGIC: ".mcap", b"SQLite format 3\0": ".db3", b"#ROSBAG V2.0": ".bag"}
"""File suffix by the first bytes of a recording: the two storages of ROS 2 and that of ROS 1."""
GZ = ".gz"
PACKED = (".zstd", ".zst", GZ)
ENDINGS = tuple(kind + packed for kind in (".mcap", ".db3") for packed in ("", *PACKED))
"""Ends of the names of the storage files that make a folder a bag."""


def find_metadata(path: Path, *, tolerant: bool) -> tuple[BagMetadata | None, list[str]]:
    """Read metadata.yaml and note oddities; None for a single file or without metadata.yaml."""
    if not path.exists():
        raise BagError.about(str(path), "a bag", "nothing there", "Check the path.")
    if path.is_file():
        _check_file(path)
        return None, []
    if not is_bag(path):
        n_bags = len([*storage_files(path), *path.glob(f"*/{FILE_NAME}")])
        cure = cure_of(path, "Check the path; recordings are MCAP (`ros2 bag record -s mcap`).")
        got = f"a folder of {n_bags} bags" if n_bags else "a folder without .mcap or .db3 files"
        raise BagError.about(str(path), "a bag", got, "Name one." if n_bags else cure)
    try:
        return read_metadata(path), []
    except BagError as error:
        if not storage_files(path):
            cure = "Record with MCAP storage (`ros2 bag record -s mcap`)."
            raise BagError.about(str(path), "a bag", error, cure) from error
        if (path / FILE_NAME).exists() and not tolerant:
            raise
        files = len(storage_files(path))
        parts = f": its {files} files count as parts of one recording" if files > 1 else ""
        return None, [f"no usable {FILE_NAME}{parts}"]


TABLES = (".csv", ".tsv", ".npy", ".parquet", ".c3d", ".trc", ".bvh", ".mvnx", ".h5", ".hdf5",
          ".mat", ".json", ".jsonl")  # fmt: skip
"""Suffixes of files that can be imported as bags."""


def cure_of(path: Path, otherwise: str) -> str:
    """Advice for a path without bags: to import its tables if it has any, else `otherwise`."""
    tables = any(file.suffix.lower() in TABLES for file in (path, *path.rglob("*")))
    first = f"`intent import {path} --suggest` writes a first map to make bags of it"
    return f"{first} (docs/import.md)." if tables else otherwise


def _check_file(path: Path) -> None:
    """Raise BagError unless a file can be a recording; any .mcap file may be a damaged one."""
    is_table = kind_of(path) == GZ and path.with_suffix("").suffix not in KINDS.values()
    if is_table or (path.suffix != ".mcap" and kind_of(path) not in (*KINDS.values(), *PACKED)):
        give = "Give a bag: a folder with .mcap files, or one of them."
        other = "Save other tables as CSV or Parquet: docs/import.md lists what can be made bags."
        cure = cure_of(path, f"{give} {other}")
        raise BagError.about(str(path), "a recording", "another kind of file", cure)


def is_bag(folder: Path) -> bool:
    """Whether a folder is one ROS 2 bag: it has a metadata.yaml, a single storage file, or the
    parts of one recording as rosbag2 numbers them from 0 on.
    """
    files = storage_files(folder)
    name, first = _name_and_number(files[0]) if files else ("", -1)
    parts = [f"{name}_{_name_and_number(path)[1]}" for path in files]
    is_whole = len(files) == 1 or (first == 0 and parts == [_stem(path) for path in files])
    return (folder / FILE_NAME).exists() or is_whole


def kind_of(path: Path) -> str:
    """Suffix by a file's first bytes: a value of `KINDS`, `.zstd` or `.gz`; else its own suffix."""
    with path.open("rb") as file:
        start = file.read(max(map(len, KINDS)))
    known = {**KINDS, ZSTD: PACKED[0], GZIP: GZ}
    return next((kind for magic, kind in known.items() if start.startswith(magic)), path.suffix)


def unpack(path: Path, folder: Path) -> Path:
    """Decompress a file into `folder`; a truncated file is decompressed as far as possible."""
    target = folder / path.stem
    most, written = MOST_CHUNK + MOST_EXPANSION * path.stat().st_size, 0
    why = "one that is cut off"
    unzstd = partial(zstandard.ZstdDecompressor().stream_reader, read_across_frames=True)
    unpacker: Callable[..., Any] = gzip.open if kind_of(path) == GZ else unzstd
    try:
        with path.open("rb") as source, unpacker(source) as reader, target.open("wb") as sink:
            while written <= most and (piece := reader.read1(2**20)):
                written += sink.write(piece)
    except (zstandard.ZstdError, OSError, EOFError, zlib.error) as error:
        why = one_line(error)
    if not written:
        raise BagError.about(str(path), "a whole file of zstd or gzip", why, "Copy it again.")
    if written > most:
        cure = "No recorder writes such a file; record again."
        raise BagError.about(str(path), f"at most {most} bytes unpacked", "more", cure)
    return target


def find_files(
    path: Path, metadata: BagMetadata | None, *, tolerant: bool
) -> tuple[list[Path], list[str], bool]:
    """The files of a recording in order, notes about oddities, and whether all seem to be renamed.

    Without metadata these are all storage files, sorted by name and number. Missing files are an
    error unless `tolerant` or as many others are there.
    """
    if path.is_file():
        return [path], [], False
    notes = []
    if metadata is None or not metadata.files:
        files = storage_files(path)
        if len(files) > 1 and not files[-1].stat().st_size:  # left by a killed recorder
            notes.append(f"empty: {files.pop().name}")
    else:
        files = [_packed_or_not(path / PureWindowsPath(name).name) for name in metadata.files]
    missing, there = [file.name for file in files if not file.is_file()], storage_files(path)
    renamed = 0 < len(missing) == len(files) == len(there)
    if renamed or (missing and tolerant):
        notes.append(f"{'renamed' if renamed else 'missing'}: {', '.join(missing)}")
        files = [file for file in files if file.is_file()] or there
        missing = []
    if missing or not files:
        cure = "Copy the whole directory of the bag."
        got = f"no {', '.join(missing) or 'file of a storage'}"
        raise BagError.about(str(path), "the files of the bag", got, cure)
    return files, notes, renamed


def storage_files(folder: Path) -> list[Path]:
    """All regular storage files (a FIFO would never end), sorted by name and number."""
    found = {path for path in folder.glob("*") if path.name.endswith(ENDINGS) and path.is_file()}
    twice = {path for path in found if path.suffix in PACKED and path.with_suffix("") in found}
    return sorted(found - twice, key=_name_and_number)


def _packed_or_not(path: Path) -> Path:
    """The given file if it exists, else its compressed or decompressed version."""
    others = [path.with_name(path.name + suffix) for suffix in PACKED]
    others += [path.with_suffix("")] * (path.suffix in PACKED)
    return next((other for other in others if not path.exists() and other.exists()), path)


def _stem(path: Path) -> str:
    return path.with_suffix("").stem if path.suffix in PACKED else path.stem


def _name_and_number(path: Path) -> tuple[str, int]:
    """Sort key for file names as rosbag2 numbers them, NAME_10 after NAME_9."""
    name, _, number = _stem(path).rpartition("_")
    return (name, int(number)) if number.isdecimal() else (_stem(path), -1)
