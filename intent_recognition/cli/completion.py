# SPDX-License-Identifier: Apache-2.0
"""`intent --print-completion SHELL`: a script that completes commands, options and paths."""

import argparse
import re
import sys
from typing import Any

from intent_recognition.cli.options import a_path

COMPLETION = "--print-completion"
SHELLS = ("bash", "zsh", "fish")


class PrintCompletion(argparse.Action):
    """Prints the completion script of its parser, and ends the program."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: Any, values: Any, _: object = None
    ) -> None:
        """Print the script."""
        sys.stdout.write(completion(parser, values) + "\n")
        parser.exit()


def add_completion_option(parser: argparse.ArgumentParser) -> None:
    """Add `--print-completion`, an option of `intent` itself."""
    parser.add_argument(
        COMPLETION,
        action=PrintCompletion,
        choices=SHELLS,
        metavar="|".join(SHELLS),
        help="print a script that completes commands, options and paths, and stop",
    )


def completion(parser: argparse.ArgumentParser, shell: str) -> str:
    """Completion script for a shell; when it runs it does not load this package."""
    import shtab

    _prepare(parser, shtab.FILE, shtab.DIRECTORY)
    script = shtab.complete(parser, shell=shell)
    if shell != "zsh":
        return script
    # zsh takes shtab's form of `nargs` + and * for exactly one argument
    return re.sub(r'^  "\(\*\)::?', '  "*:', script, flags=re.MULTILINE)


def offer(parser: argparse.ArgumentParser, name: str, words: tuple[str, ...]) -> None:
    """Offer these words as completions of an argument."""
    (action,) = (action for action in parser._actions if action.dest == name)
    vars(action)["offered"] = words


def _prepare(parser: argparse.ArgumentParser, files: dict, folders: dict) -> None:
    """Tell shtab which arguments are files and folders, and the short text of each command."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for shown in action._choices_actions:
                action.choices[shown.dest].description = shown.help
            for command in action.choices.values():
                _prepare(command, files, folders)
            continue
        if action.type is a_path:
            vars(action)["complete"] = folders if action.metavar == "DIR" else files
        elif words := getattr(action, "offered", ()):
            action.choices = words
