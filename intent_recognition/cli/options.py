# SPDX-License-Identifier: Apache-2.0
"""What the options of several commands share: numbers within limits, and those of a node."""

import argparse
import json
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

Subparsers: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
Number = TypeVar("Number", int, float)

XYZ: dict[str, Any] = {"nargs": 3, "metavar": ("X", "Y", "Z")}
"""Of an option that takes a point or a way."""
PART = r"[A-Za-z_{][\w{}]*"
NAME = rf"(?:~/|/)?{PART}(?:/{PART})*"
"""A name of ROS 2: relative, absolute or private; parts of it may be substitutions in braces."""


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


def a_path(text: str) -> Path:
    """The `type` of an option that takes a path: the empty one is no name of the present folder."""
    if not text:
        raise argparse.ArgumentTypeError("expected a path, got nothing; the present folder is .")
    return Path(text)


def topic_name(text: str) -> str:
    """The `type` of an option that takes the name of a topic."""
    if not re.fullmatch(NAME, text, re.ASCII):
        raise argparse.ArgumentTypeError(
            f"expected a topic such as /joint_states, of letters, digits, _ and /, got {text!r}"
        )
    return text


def _namespace(text: str) -> str:
    if not re.fullmatch(rf"/*(?:{PART}(?:/{PART})*)?/*", text, re.ASCII):
        raise argparse.ArgumentTypeError(
            f"expected a namespace such as /cell_1, of letters, digits, _ and /, got {text!r}"
        )
    return text


def _remapping(text: str) -> str:
    if not re.fullmatch(rf"(?:(?!:=)\S)+:={NAME}", text, re.ASCII):
        raise argparse.ArgumentTypeError(
            f"expected FROM:=TO, such as /mocap/wrist/pose:=/vrpn/wrist/pose, got {text!r}"
        )
    return text


def add_node_options(parser: argparse.ArgumentParser) -> None:
    """Options of every command that runs a node: namespace and remapping."""
    group = parser.add_argument_group("topics")
    group.add_argument(
        "--namespace", type=_namespace, default="", metavar="NS", help="namespace of the topics"
    )
    group.add_argument(
        "--remap",
        type=_remapping,
        action="append",
        default=[],
        metavar="FROM:=TO",
        help="use another topic name; may be repeated",
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


def yaml_value(value: object) -> str:
    """A parameter's value as YAML that keeps its type: texts quoted, floats with a point."""
    return json.dumps(value, ensure_ascii=False)
