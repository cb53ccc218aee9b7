# SPDX-License-Identifier: Apache-2.0
"""Files that are whole after a crash at any instant: written, synchronised, renamed; and locks."""

import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import ResourceBusyError, describe


@contextmanager
def writing(what: str, cure: str = "Free space, or choose another.") -> Iterator[None]:
    """Write a file, by the name that an error gives it.

    Raises:
        ResourceBusyError: the disk is full, or what is written to cannot be.
    """
    try:
        yield
    except OSError as error:
        raise ResourceBusyError.about(what, "a file that can be written", error, cure) from error


def commit(temporary: Path, target: Path) -> None:
    """Give a file that is complete its name; the old file or the new one is there, on the disk."""
    descriptor = os.open(temporary, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
    temporary.replace(target)
    sync_folder(target.parent)


def copy(source: Path, target: Path) -> None:
    """Copy a file; the target is whole at every moment."""
    part = target.with_suffix(".part")
    shutil.copyfile(source, part)
    commit(part, target)


def write_text(path: Path, text: str) -> None:
    """Write a text; the file is the old one or the new one. Its folder is made if it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(text, encoding="utf-8")
    commit(part, path)


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write an `.npz`, in a folder that is made where it is missing.

    The file is the old one or the new one, whoever else writes it at the same time.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".npz.part")
    part, everything = Path(name), dict[str, Any](arrays)
    try:
        with os.fdopen(handle, "wb") as stream:
            np.savez_compressed(stream, **everything)
        part.chmod(0o644)
        commit(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def append_line(path: Path, line: str) -> None:
    """Append a line in one write, on the disk before this returns."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(descriptor, f"{line}\n".encode())
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Have the names in a folder on the disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def locked(
    path: Path, patience_s: float = 60.0, clock: Callable[[], float] = time.monotonic
) -> Iterator[None]:
    """Hold a lock among processes; the system releases it when one dies.

    Args:
        path: of the file that stands for it.
        patience_s: longest wait [s].
        clock: seconds, monotonic.

    Raises:
        ResourceBusyError: another process has held it for so long.
    """
    end_s = clock() + patience_s
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError as error:
                if clock() > end_s:
                    cure = "End the other teacher, or choose another folder."
                    got = f"one that another process has used for {patience_s:g} s"
                    raise ResourceBusyError(
                        describe(str(path.parent), "a folder that is free", got, cure)
                    ) from error
                time.sleep(0.02)
        yield
    finally:
        os.close(descriptor)
