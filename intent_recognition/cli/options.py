# SPDX-License-Identifier: Apache-2.0
"""Builds a command's parser from its help text; argument types and options of nodes."""

import argparse
import math
import re
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from types import ModuleType
from typing import Any, TypeAlias, TypeVar

from intent_recognition.cli.help import COMMANDS, HEADING, Formatter
from intent_recognition.errors import ArgumentError
from intent_recognition.nodes.processes import yaml_value

Subparsers: TypeAlias = "argparse._SubParsersAction[Any]"
Number = TypeVar("Number", int, float)

PART = r"[A-Za-z_{][\w{}]*"
NAME = rf"(?:~/|/)?{PART}(?:/{PART})*"
"""Pattern of a ROS 2 name: relative, absolute or private, possibly with substitutions in braces."""

PATHS = {
    *("BAG", "BAGS", "BAGS|FILE", "BAG|MODEL|TASKS", "DIR", "F", "FILE", "FOLDER", "M.npz"),
    *("MAP.yaml", "OUT.html", "PLAN.yaml", "SESSION", "SESSIONS", "SOURCE", "TARGET", "URDF"),
}
"""Metavars of arguments that are paths."""
PRINTED = Path("-")
"""Value of `--json` without OUT: standard output."""


class CommandParser(argparse.ArgumentParser):
    """Accepts options by their full names only, and reports an unknown option before all else.

    The parsers of the commands are of this class, too.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**({"allow_abbrev": False} | kwargs))

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Check that all options are known, then parse."""
        words = list(sys.argv[1:] if args is None else args)
        self._refuse_unknown(words)
        return super().parse_known_args(words, namespace)

    def _refuse_unknown(self, words: Sequence[str]) -> None:
        known = self._option_string_actions
        for word in words:
            if word == "--" or (self._subparsers is not None and not word.startswith("-")):
                return  # an argument follows, or a command with own options
            name = word.partition("=")[0]
            short = not word.startswith("--") and word[:2] in known
            if not re.match("--?[A-Za-z]", word) or " " in name or name in known or short:
                continue
            longer = [option for option in known if option.startswith(name)]
            near = longer or get_close_matches(name, known, 1)
            cure = f"did you mean {near[0]}?" if near else f"`{self.prog} --help` lists them"
            self.error(f"unknown option {name}: {cure}")


def number(
    kind: type[Number], minimum: float = -math.inf, maximum: float = math.inf
) -> Callable[[str], Number]:
    """Argument type of a finite number within inclusive limits."""
    limits = f"{minimum:g} or more" if maximum == math.inf else f"{minimum:g} to {maximum:g}"
    if minimum == -math.inf:
        limits = "a finite number"

    def read(text: str) -> Number:
        value = kind(text)
        if not (math.isfinite(value) and minimum <= value <= maximum):
            raise argparse.ArgumentTypeError(f"expected {limits}, got {text}")
        return value

    read.__name__ = kind.__name__  # argparse prints this name if `text` is not a number
    return read


def add_module(subparsers: Subparsers, name: str, module: ModuleType) -> None:
    """Add a module's command with `add_command`.

    Its docstring is the help text; its function `run`, if any, runs the command. `OPTIONS` holds
    further keywords; functions in `MORE` add what the tables of the docstring cannot express.
    """
    if module.__doc__ is None:
        expected = "0 or 1, as the docstrings of commands are their options"
        raise ArgumentError.about("PYTHONOPTIMIZE", expected, sys.flags.optimize, "Unset it.")
    run, more = getattr(module, "run", None), getattr(module, "OPTIONS", {})
    parser = add_command(subparsers, name, run, module.__doc__, **more)
    for add in getattr(module, "MORE", ()):
        add(parser)


def add_command(
    subparsers: Subparsers, name: str, run: Callable[..., object] | None, text: str, /, **more: Any
) -> argparse.ArgumentParser:
    """Add a command, or an action of a command.

    Args:
        subparsers: parsers to which it is added.
        name: name of the command.
        run: function from the arguments to the exit code; None if the command has actions.
        text: help text, usually the docstring of the command's file. Empty lines separate its
            sections: description, tables for `add_options`, and examples, each with a line
            `# what it does` above the command.
        more: keywords of `add_options`.
    """
    about, *sections = textwrap.dedent(text).strip().split("\n\n")
    examples = sections.pop() if sections and sections[-1].startswith("#") else ""
    shown = textwrap.indent(re.sub(r"\n +", r" \\\n    ", examples), "  ")
    parser = subparsers.add_parser(
        name,
        help=COMMANDS.get(name) or about[:1].lower() + about[1:].rstrip("."),
        description=" ".join(about.split()),
        formatter_class=Formatter,
        epilog=HEADING + shown if examples else None,
    )
    if run is not None:
        parser.set_defaults(run=run)
    add_options(parser, "\n\n".join(sections), **more)
    return parser


def add_actions(parser: argparse.ArgumentParser) -> Subparsers:
    """Make the actions of a command, one of which must be given."""
    return parser.add_subparsers(
        title="actions", dest="action", metavar="ACTION", required=True, help="what to do"
    )


def add_options(group: argparse._ActionsContainer, tables: str, /, **more: Any) -> None:
    """Add the arguments listed in tables, which have the form of the command's help.

    Args:
        group: parser or group to which the arguments are added.
        tables: one row per argument: its name and metavar, two or more spaces, and its help. A
            row without metavar is a switch, `...` takes one or more values, and metavars in
            `PATHS` are paths. A line that ends in a colon is the title of a group; after `one of:`
            its arguments exclude one another. The row of `--json OUT` says what is written; the
            rest of its help is the same everywhere.
        more: by argument name its type, or keywords of `add_argument`.
    """
    for section in filter(None, textwrap.dedent(tables).strip().split("\n\n")):
        # one row is a line with the indented lines below it
        rows = [re.sub(r"\n +", "  ", row, count=1) for row in re.split(r"\n(?! )", section)]
        within = group
        if rows[0].endswith(":"):
            title = rows.pop(0)[:-1]
            within = group.add_argument_group(title)
            if title.endswith("one of"):
                within = within.add_mutually_exclusive_group()
        for row in rows:
            name, options = _argument(row)
            given = more.pop(name.lstrip("-").replace("-", "_"), {})
            options |= given if isinstance(given, dict) else {"type": given}
            if name.startswith("-") and not {"metavar", "choices", "nargs"} & options.keys():
                options.setdefault("action", "store_true")
            within.add_argument(name, **options)
    if more:
        raise TypeError(f"expected arguments of the table, got {', '.join(more)}")


def _argument(row: str) -> tuple[str, dict[str, Any]]:
    """Name of an argument and its keywords for `add_argument`, from its row."""
    spec, text = re.split(r" {2,}", row, maxsplit=1)
    name, *metavars = spec.split(" ")
    options: dict[str, Any] = {"help": " ".join(text.split())}
    if name == "--json":
        said = f"write {options['help']} as JSON to OUT; without OUT print that, and nothing else,"
        return name, {
            "help": f"{said} to standard output",
            "metavar": "OUT",
            "type": a_path,
            "nargs": "?",
            "const": PRINTED,
        }
    if len(metavars) > 1:
        options |= {"nargs": len(metavars), "metavar": tuple(metavars)}
    elif metavars:
        metavar = metavars[0].removesuffix("...")
        options |= {"metavar": metavar} | ({"nargs": "+"} if metavar != metavars[0] else {})
        options |= {"type": a_path} if metavar in PATHS else {}
    return name, options


def a_path(text: str) -> Path:
    """Argument type of a path; refuses the empty text, which pathlib takes for this folder."""
    if not text:
        raise argparse.ArgumentTypeError("expected a path, got nothing; the present folder is .")
    return Path(text)


def matching(pattern: str, expected: str) -> Callable[[str], str]:
    """Argument type of a text that matches a pattern as a whole."""

    def read(text: str) -> str:
        if not re.fullmatch(pattern, text, re.ASCII):
            raise argparse.ArgumentTypeError(f"expected {expected}, got {text!r}")
        return text

    return read


topic_name = matching(NAME, "a topic such as /joint_states, of letters, digits, _ and /")
_namespace = matching(
    rf"/*(?:{PART}(?:/{PART})*)?/*", "a namespace such as /cell_1, of letters, digits, _ and /"
)
_remapping = matching(
    rf"(?:(?!:=)\S)+:={NAME}", "FROM:=TO, such as /mocap/wrist/pose:=/vrpn/wrist/pose"
)


def add_node_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of commands that run a node: namespace and remapping."""
    add_options(
        parser,
        """
        topics:
        --namespace NS    namespace of the topics
        --remap FROM:=TO  use another topic name; may be repeated
        """,
        namespace={"type": _namespace, "default": ""},
        remap={"type": _remapping, "action": "append", "default": []},
    )


def node_arguments(args: argparse.Namespace, parameters: Mapping[str, object]) -> list[str]:
    """Command line of a node; its first entry is the program's name."""
    command = ["intent", "--ros-args"]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={yaml_value(value)}"]
    if args.namespace:
        command += ["-r", f"__ns:=/{args.namespace.strip('/')}"]
    for rule in args.remap:
        command += ["-r", rule]
    return command
