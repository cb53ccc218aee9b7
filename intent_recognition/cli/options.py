# SPDX-License-Identifier: Apache-2.0
"""How a command says what it takes: its help as text, types of arguments, and a node's options."""

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
"""A name of ROS 2: relative, absolute or private; parts of it may be substitutions in braces."""

PATHS = {
    *("BAG", "BAGS", "BAGS|FILE", "BAG|MODEL|TASKS", "DIR", "F", "FILE", "FOLDER", "M.npz"),
    *("MAP.yaml", "OUT.html", "PLAN.yaml", "SESSION", "SESSIONS", "SOURCE", "TARGET", "URDF"),
}
"""Metavars of arguments that are paths."""
PRINTED = Path("-")
"""The value of `--json` without OUT: standard output."""


class CommandParser(argparse.ArgumentParser):
    """Takes options by their whole names only; an unknown one is the first thing it complains of.

    The parsers of the commands are of this class, too.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**({"allow_abbrev": False} | kwargs))

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse, once all options are known."""
        words = list(sys.argv[1:] if args is None else args)
        self._refuse_unknown(words)
        return super().parse_known_args(words, namespace)

    def _refuse_unknown(self, words: Sequence[str]) -> None:
        known = self._option_string_actions
        for word in words:
            if word == "--" or (self._subparsers is not None and not word.startswith("-")):
                return  # what follows is no option, or one of the command
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
    """The `type` of an option that takes a finite number within limits, both included."""
    limits = f"{minimum:g} or more" if maximum == math.inf else f"{minimum:g} to {maximum:g}"
    if minimum == -math.inf:
        limits = "a finite number"

    def read(text: str) -> Number:
        value = kind(text)
        if not (math.isfinite(value) and minimum <= value <= maximum):
            raise argparse.ArgumentTypeError(f"expected {limits}, got {text}")
        return value

    read.__name__ = kind.__name__  # argparse names it where `text` is no number
    return read


def add_module(subparsers: Subparsers, name: str, module: ModuleType) -> None:
    """Add the command of a module by `add_command`.

    Its function `run` does it, if it has one, and its docstring is the text. `OPTIONS` are further
    keywords, and functions in `MORE` add to the parser what is no row of a table.
    """
    if module.__doc__ is None:
        expected = "0 or 1, as the docstrings of commands are their options"
        raise ArgumentError.about("PYTHONOPTIMIZE", expected, sys.flags.optimize, "Unset it.")
    run, more = getattr(module, "run", None), getattr(module, "OPTIONS", {})
    parser = add_command(subparsers, name, run, module.__doc__, **more)
    for add in getattr(module, "MORE", ()):
        add(parser)


def add_command(
    subparsers: Subparsers,
    name: str,
    run: Callable[..., object] | None,
    text: str,
    /,
    **more: Any,
) -> argparse.ArgumentParser:
    """Add a command, or an action of one.

    Args:
        subparsers: get it.
        name: of the command.
        run: what does it, from its arguments to the exit code; None: one of its actions.
        text: what its help says, the docstring of a command's file: in sections between empty
            lines what it does, the tables of `add_options`, and its examples, each a line
            `# what it does` above the command.
        more: as of `add_options`.
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
    """Where the actions of a command are added, of which one has to be named."""
    return parser.add_subparsers(
        title="actions", dest="action", metavar="ACTION", required=True, help="what to do"
    )


def add_options(group: argparse._ActionsContainer, tables: str, /, **more: Any) -> None:
    """Add the arguments of tables, in which they stand as in the help of the command.

    Args:
        group: parser or group that gets them.
        tables: for each argument its name and its metavar, two spaces or more, and what it does;
            without a metavar it is a switch, `...` takes one or more, and `PATHS` are paths. A line
            that ends in a colon is the title of a group. Of `--json OUT` it says what is written;
            that option means the same in every command.
        more: by the name of an argument its type, or other keywords of `add_argument`.
    """
    for section in filter(None, textwrap.dedent(tables).strip().split("\n\n")):
        # each row with the lines below that are indented
        rows = [re.sub(r"\n +", "  ", row, count=1) for row in re.split(r"\n(?! )", section)]
        within = group
        if rows[0].endswith(":"):
            within = group.add_argument_group(rows.pop(0)[:-1])
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
    """Name of an argument, and what its row says for `add_argument`."""
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
    """The `type` of an option that takes a path: the empty one is no name of the present folder."""
    if not text:
        raise argparse.ArgumentTypeError("expected a path, got nothing; the present folder is .")
    return Path(text)


def matching(pattern: str, expected: str) -> Callable[[str], str]:
    """The `type` of an option whose whole text matches a pattern."""

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
    """Options of every command that runs a node: namespace and remapping."""
    group = parser.add_argument_group("topics")
    add_options(
        group,
        """
        --namespace NS    namespace of the topics
        --remap FROM:=TO  use another topic name; may be repeated
        """,
        namespace={"type": _namespace, "default": ""},
        remap={"type": _remapping, "action": "append", "default": []},
    )


def node_arguments(args: argparse.Namespace, parameters: Mapping[str, object]) -> list[str]:
    """Command line of a node; the first entry is the program's name."""
    command = ["intent", "--ros-args"]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={yaml_value(value)}"]
    if args.namespace:
        command += ["-r", f"__ns:=/{args.namespace.strip('/')}"]
    for rule in args.remap:
        command += ["-r", rule]
    return command
