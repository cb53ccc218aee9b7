# SPDX-License-Identifier: Apache-2.0
"""`intent --print-completion SHELL`: a script that completes commands, options and paths."""

import argparse
import sys
from pathlib import Path

from intent_recognition.errors import ArgumentError, describe

SHELLS = ("bash", "zsh")
FILES = {"bash": "_shtab_compgen_files", "zsh": "_files"}
FOLDERS = {"bash": "_shtab_compgen_dirs", "zsh": "_files -/"}


class PrintCompletion(argparse.Action):
    """Prints the script of the parser it belongs to, and ends."""

    def __call__(self, parser, namespace, values, option_string=None) -> None:
        """Print it; one line on stderr and exit code 1 without shtab."""
        try:
            sys.stdout.write(completion(parser, values) + "\n")
        except ArgumentError as error:
            parser.exit(1, f"intent: {error}\n")
        parser.exit()


def add_completion_option(parser: argparse.ArgumentParser) -> None:
    """The option of `intent` itself."""
    parser.add_argument(
        "--print-completion",
        action=PrintCompletion,
        choices=SHELLS,
        metavar="|".join(SHELLS),
        help="print a script that completes commands, options and paths, and stop",
    )


def completion(parser: argparse.ArgumentParser, shell: str) -> str:
    """The script for a shell; it needs nothing of this package when a key is pressed.

    Raises:
        ArgumentError: shtab is not installed.
    """
    try:
        import shtab
    except ImportError as error:
        cure = "Install it with `pip install shtab`."
        raise ArgumentError(describe("shtab", "an installed library", "none", cure)) from error
    _mark_paths(parser)
    return shtab.complete(parser, shell=shell)


def _mark_paths(parser: argparse.ArgumentParser) -> None:
    """Say which arguments are files and which are folders."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _mark_paths(command)
        elif action.type is Path:
            action.complete = FOLDERS if action.metavar == "DIR" else FILES
