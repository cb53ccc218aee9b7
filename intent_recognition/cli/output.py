# SPDX-License-Identifier: Apache-2.0
"""What commands write: checked before long work, then written to a file or printed as JSON."""

import json
import os
import sys
from pathlib import Path

from intent_recognition.errors import ResourceBusyError, describe


def check_output(option: str, path: Path | None) -> None:
    """Find out before long work that its result could not be written.

    Raises:
        ResourceBusyError: the path is a folder, or its folder cannot be made or written to.
    """
    if path is None:
        return
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    problem = ""
    if path.is_dir():
        problem = "a folder"
    elif not folder.is_dir():
        problem = f"{folder}, which is no folder"
    elif not os.access(folder, os.W_OK):
        problem = f"{folder}, which is write-protected"
    if problem:
        raise ResourceBusyError(
            describe(f"{option} {path}", "a file that can be written", problem, "Choose another.")
        )


def write_json(path: Path, content: object, indent: int | None = None) -> None:
    """Write JSON; its folder is made if it is missing.

    Raises:
        ResourceBusyError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(content, indent=indent) + "\n", encoding="utf-8")
    except OSError as error:
        raise ResourceBusyError(
            describe(f"--json {path}", "a file that can be written", error, "Choose another.")
        ) from error


def print_json(content: object) -> None:
    """Print JSON to standard output."""
    sys.stdout.write(json.dumps(content, indent=2, default=str) + "\n")
