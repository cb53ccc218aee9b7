# SPDX-License-Identifier: Apache-2.0
"""`intent COMMAND`: one parser, and one module per command."""

import argparse
import contextlib
import importlib
import io
import keyword
import os
import sys
from collections.abc import Iterable, Sequence
from difflib import get_close_matches

from intent_recognition import __version__
from intent_recognition.cli.completion import COMPLETION, add_completion_option
from intent_recognition.cli.help import COMMANDS, Formatter
from intent_recognition.cli.options import CommandParser, add_module
from intent_recognition.errors import IntentError, missing_package, one_line
from intent_recognition.interrupts import (
    INTERRUPTED,
    end_command_at_interrupt,
    ignore_interrupts,
    raise_interrupts,
)

CURES = {
    MemoryError: "Give it fewer or smaller files, or more memory.",
    OSError: "Check the path, its permissions and the free space.",
}
"""Cures for errors that name none themselves."""


def make_parser(commands: Iterable[str] = COMMANDS, whole: bool = True) -> argparse.ArgumentParser:
    """The parser of all or some commands; `whole` adds their options, else only the names.

    Only the modules of whole commands are imported.
    """
    parser = CommandParser(
        prog="intent",
        description="Learn interaction primitives from recordings, recognise a coworker's task,"
        " and move the robot in time.",
        epilog="`intent COMMAND --help` explains a command and shows examples.",
        formatter_class=Formatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    add_completion_option(parser)
    subparsers = parser.add_subparsers(
        title="commands", dest="command", metavar="COMMAND", required=True
    )
    for command in commands:
        if not whole:
            subparsers.add_parser(command, help=COMMANDS[command])
            continue
        name = f"intent_recognition.cli.{command}" + "_" * keyword.iskeyword(command)
        add_module(subparsers, command, importlib.import_module(name))
    return parser


class _Version(argparse.Action):
    """Prints the version and the kernel that updates the hypotheses."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from intent_recognition.gaussian import KERNEL  # here, as it imports numpy and scipy

        written = "numpy (install a C compiler and the package again for the fast one)"
        update = "compiled C" if KERNEL == "c" else written
        sys.stdout.write(f"intent {__version__}\nupdate: {update}\n")
        parser.exit()


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; an error of this package is one line on stderr and exit code 1."""
    if argv is None:
        end_command_at_interrupt()
    _print_whatever_comes()
    words = list(sys.argv[1:] if argv is None else argv)
    known = words[0] in COMMANDS if words else False
    whole = known or any(word.startswith(COMPLETION) for word in words)
    name = f"intent {words[0]}" if known else "intent"
    try:
        parser = make_parser(words[:1] if known else COMMANDS, whole)
        if words and not known and (near := get_close_matches(words[0], COMMANDS, 1)):
            parser.error(f"expected a command, got {words[0]!r}: did you mean {near[0]!r}?")
        args = parser.parse_args(words)
        raise_interrupts()
        code = int(args.run(args) or 0)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # the reader closed the pipe
        _drop_output()
        return 0
    except ImportError as error:
        if (missing := missing_package(error)) is None:
            raise
        sys.stderr.write(f"{name}: {one_line(missing)}\n")
        return 1
    except (IntentError, OSError, MemoryError, RecursionError) as error:
        cure = next((f". {cure}" for kind, cure in CURES.items() if isinstance(error, kind)), "")
        sys.stderr.write(f"{name}: {one_line(error)}{cure}\n")
        if isinstance(error, OSError):
            _drop_output()
        return 1
    finally:
        ignore_interrupts()


def _print_whatever_comes() -> None:
    """Escape characters that the encoding of standard output lacks, as stderr does."""
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")


def _drop_output() -> None:
    """Redirect standard output to null after a closed pipe, for Python's final flush, too."""
    with contextlib.suppress(OSError, ValueError):  # in tests it is no file
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)


if __name__ == "__main__":
    sys.exit(main())
