# SPDX-License-Identifier: Apache-2.0
"""Output files of commands: checked before long work, then written, or printed as JSON."""

import argparse
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from intent_recognition.cli.console import busy, make_console, say
from intent_recognition.cli.options import PRINTED
from intent_recognition.durable import writing
from intent_recognition.errors import ArgumentError, ResourceBusyError, optional

if TYPE_CHECKING:
    from intent_recognition.report import ReportPage


def console_beside(args: argparse.Namespace, *options: str) -> Console:
    """Console for all other output: standard error if `--json` writes to standard output.

    Also checks `--json` and these options with `check_outputs`.
    """
    check_outputs(args, *options)
    return make_console(stderr=args.json == PRINTED)


def table_console(args: argparse.Namespace) -> Console:
    """Console for tables, which stay away if `--json` writes to standard output."""
    return Console(quiet=True) if args.json == PRINTED else make_console()


def check_outputs(args: argparse.Namespace, *options: str) -> None:
    """Check these options and `--json`, which may have swallowed the next argument."""
    path: Path | None = args.json
    others = {f"--{name}": getattr(args, name) for name in options}
    for option, other in others.items():
        check_output(option, other)
    if path is None or path == PRINTED:
        return
    check_output("--json", path)
    for option, other in others.items():
        if other is not None and other.resolve() == path.resolve():
            expected = f"another file than {option}"
            raise ArgumentError.about(f"--json {path}", expected, "the same", "Rename one.")
    if path.is_file() and path.suffix != ".json":
        cure = "Write `--json` last, or choose another OUT."
        expected = "a new file, or one that ends in .json"
        raise ResourceBusyError.about(f"--json {path}", expected, "an existing file", cure)


def check_output(option: str, path: Path | None) -> None:
    """Refuse a path to which the result of long work could not be written."""
    if path is None:
        return
    if option == "--report":
        optional("matplotlib")
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    problem = ""
    if path.is_dir():
        problem = "a folder"
    elif not folder.is_dir():
        problem = f"{folder}, which is no folder"
    elif not os.access(folder, os.W_OK):
        problem = f"{folder}, which is write-protected"
    if problem:
        expected = "a file that can be written"
        raise ResourceBusyError.about(f"{option} {path}", expected, problem, "Choose another.")


def write_report(
    console: Console, path: Path, page: Callable[..., "ReportPage"], *content: object
) -> None:
    """Write the page that a function makes of some content, and say so."""
    from intent_recognition.report import write_page

    with busy(console, "writing the report"):
        write_page(path, page(*content))
    say(console, f"wrote {path}")


def check_new(path: Path, text: str) -> None:
    """Refuse an `--output` at which a different text exists, before anything is written."""
    if path.exists() and path.read_bytes() != text.encode():
        got, cure = f"{path}, which has other content", "Choose another, or delete it."
        raise ResourceBusyError.about("--output", "a new file", got, cure)


def write_json(path: Path | None, content: object, indent: int | None = 2) -> None:
    """Write JSON to where `--json` points; create the folder if it is missing.

    Args:
        path: a file, PRINTED, or None for nowhere.
        content: plain values.
        indent: spaces per level; None for one line.
    """
    if path is None:
        return
    text = json.dumps(content, indent=indent) + "\n"
    if path == PRINTED:
        sys.stdout.write(text)
        sys.stdout.flush()
        return
    with writing(f"--json {path}"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
