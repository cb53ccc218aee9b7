# SPDX-License-Identifier: Apache-2.0
"""Files that stay intact in a crash at any instant: write, synchronise, rename; and locks."""

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
    """Context for writing a file; `what` names it in the error.

    Raises:
        ResourceBusyError: the disk is full, or the file cannot be written.
    """
    try:
        yield
    except OSError as error:
        raise ResourceBusyError.about(what, "a file that can be written", error, cure) from error


def commit(temporary: Path, target: Path) -> None:
    """Rename a complete file to its target atomically and synchronise it to disk."""
    descriptor = os.open(temporary, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
    temporary.replace(target)
    sync_folder(target.parent)


def copy(source: Path, target: Path) -> None:
    """Copy a file atomically."""
    part = target.with_suffix(".part")
    shutil.copyfile(source, part)
    commit(part, target)


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically; create its folder if it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    part.write_text(text, encoding="utf-8")
    commit(part, path)


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write an `.npz` file; create its folder if it is missing.

    The file is replaced atomically, even if several processes write it at the same time.
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
    """Append a line in a single write, and synchronise it to disk before returning."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(descriptor, f"{line}\n".encode())
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Synchronise the names in a folder to disk."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def locked(
    path: Path, patience_s: float = 60.0, clock: Callable[[], float] = time.monotonic
) -> Iterator[None]:
    """Hold a lock between processes; the system releases it when its process dies.

    Args:
        path: path of the lock file.
        patience_s: longest wait [s].
        clock: monotonic clock [s].

    Raises:
        ResourceBusyError: another process held the lock during the whole wait.
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
