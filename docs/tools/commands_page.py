# SPDX-License-Identifier: Apache-2.0
"""The reference of commands, from the parsers themselves."""

import argparse

from intent_recognition.cli.help import GROUPS
from intent_recognition.cli.main import make_parser

INTRODUCTION = """\
# Commands

<!-- Written by docs/tools/write_reference.py from the parsers; do not edit. -->

`intent COMMAND --help` says the same in the terminal, with examples. Wherever `BAG` stands, \
[a folder of bags](../bags.md#folders) may stand, unless the command says otherwise. \
[Completion](../shell.md#completion), and [exit codes and `--json`](../shell.md#for-scripts), have \
a page of their own.
"""

MANY = {None: "{}", "+": "{} ...", "*": "[{} ...]"}


def commands_page() -> str:
    """The page as Markdown."""
    parser = make_parser()
    subparsers = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    parts, explained = [INTRODUCTION, _overview()], {}
    for commands in GROUPS.values():
        for name in commands:
            parts += [_command(f"intent {name}", subparsers.choices[name], explained)]
            for inner in subparsers.choices[name]._actions:
                if isinstance(inner, argparse._SubParsersAction):
                    parts += [_command(p.prog, p, explained) for p in inner.choices.values()]
    parts.append("## intent\n\n" + _table(parser, explained))
    return "\n".join(parts)


def _overview() -> str:
    lines = ["| | commands |", "|---|---|"]
    for title, commands in GROUPS.items():
        links = ", ".join(f"[`{command}`](#intent-{command})" for command in commands)
        lines.append(f"| {title[0].upper()}{title[1:]} | {links} |")
    return "\n".join([*lines, ""])


def _command(name: str, parser: argparse.ArgumentParser, explained: dict[str, str]) -> str:
    parts = [f"## {name}", parser.description or ""]
    if _shown(parser):  # else it has commands of its own
        parts += [f"`{_usage(parser)}`", _table(parser, explained)]
    return "\n\n".join(parts) + "\n" * (not _shown(parser))


def _usage(parser: argparse.ArgumentParser) -> str:
    """In one line: what must be given, and that there are options."""
    words = [parser.prog]
    for action in _shown(parser):
        if action.option_strings and action.required:
            words += [action.option_strings[0], str(action.metavar)]
        elif not action.option_strings:
            words.append(MANY[action.nargs].format(_name(action)))
    return " ".join([*words, "[OPTION ...]"])


def _table(parser: argparse.ArgumentParser, explained: dict[str, str]) -> str:
    """The arguments; those that another command explained in the same words by name only."""
    rows: list[str] = []
    known: dict[str, list[str]] = {}
    for action in _shown(parser):
        help_text = parser._get_formatter()._expand_help(action) if action.help else ""
        name = _name(action)
        where = explained.setdefault(f"{name}: {help_text}", parser.prog)
        if name == "--json OUT":
            known.setdefault("", []).append(f"`{name}`")
        elif where != parser.prog:
            known.setdefault(f"as of `{where}`: ", []).append(f"`{name}`")
        else:
            rows.append(f"- `{name}`{help_text and ': '}{help_text}")
    rows += [f"- {where}{', '.join(names)}" for where, names in known.items()]
    return "\n".join(rows) + "\n"


def _name(action: argparse.Action) -> str:
    """The argument with what is to be given; a bar would end the cell of a table."""
    takes_value = action.nargs != 0
    value = action.metavar or "|".join(map(str, action.choices or ()))
    value = " ".join(value) if isinstance(value, tuple) else value
    value = str(value or (action.dest.upper() if takes_value else ""))
    if not action.option_strings:
        return value
    if action.nargs == "+":
        value += " ..."
    return " ".join([", ".join(action.option_strings), value]).strip()


def _shown(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    hidden = (argparse._HelpAction, argparse._SubParsersAction)
    return [
        a for a in parser._actions if not isinstance(a, hidden) and a.help is not argparse.SUPPRESS
    ]
