# SPDX-License-Identifier: Apache-2.0
"""`intent COMMAND`: one parser, one module per command."""

import argparse
import importlib
import sys
from collections.abc import Sequence

from intent_recognition import __version__
from intent_recognition.errors import IntentError

COMMANDS = (
    "demo",
    "train",
    "evaluate",
    "replay",
    "inspect",
    "recover",
    "record",
    "play",
    "teach",
    "undo",
    "experiments",
)


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="intent",
        description="Learn interaction primitives, recognise a coworker's task, move the robot.",
    )
    parser.add_argument("--version", action="version", version=f"intent {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for command in COMMANDS:
        importlib.import_module(f"intent_recognition.cli.{command}").add_parser(subparsers)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; an error of this package is one line on stderr and exit code 1."""
    args = make_parser().parse_args(argv)
    try:
        return int(args.run(args) or 0)
    except IntentError as error:
        sys.stderr.write(f"intent {args.command}: {' '.join(str(error).split())}\n")
        return 1
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return 0


if __name__ == "__main__":
    sys.exit(main())
