# SPDX-License-Identifier: Apache-2.0
"""How `intent --help` and the help of each command read."""

import argparse
from collections.abc import Generator
from typing import Any

GROUPS = {
    "see it work": ("demo", "experiments"),
    "from recordings to a model": ("inspect", "segment", "train", "evaluate", "replay"),
    "record and play": ("record", "play", "recover"),
    "files of others": ("import", "export"),
    "teach while the nodes run": ("teach", "keep", "undo"),
    "compose skills": ("via",),
    "practise": ("improve",),
    "measure objects": ("warp",),
}
"""The commands by purpose, in the order in which the help lists them."""

COMMANDS = tuple(command for commands in GROUPS.values() for command in commands)

HEADING = "examples:\n"


class Formatter(argparse.HelpFormatter):
    """Wraps descriptions and leaves examples as they are; commands stand in their groups."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith(HEADING):
            return "".join(f"{indent}{line}\n" for line in text.splitlines())
        return super()._fill_text(text, width, indent)

    def _iter_indented_subactions(
        self, action: argparse.Action
    ) -> Generator[argparse.Action, None, None]:
        if not isinstance(action, argparse._SubParsersAction):
            yield from super()._iter_indented_subactions(action)
            return
        if not action.choices.keys() & set(COMMANDS):  # the actions of a command
            yield from super()._iter_indented_subactions(action)
            return
        by_name = {choice.dest: choice for choice in super()._iter_indented_subactions(action)}
        for title, commands in GROUPS.items():
            self._indent()
            present = [by_name[command] for command in commands if command in by_name]
            if present:
                yield _Title([], f"\n{' ' * self._current_indent}{title}")
            self._indent()
            yield from present
            self._dedent()
            self._dedent()

    def _format_action(self, action: argparse.Action) -> str:
        if isinstance(action, _Title):
            return f"{action.dest}\n"
        if isinstance(action, argparse._SubParsersAction):
            return self._join_parts(
                map(self._format_action, self._iter_indented_subactions(action))
            )
        return super()._format_action(action)


class _Title(argparse.Action):
    """The line above a group of commands; no argument."""


def examples(*lines: tuple[str, str]) -> dict[str, Any]:
    """Arguments of `add_parser` for a command with examples below its options.

    Args:
        lines: what each does, and its command line.
    """
    shown = "\n".join(f"  # {what}\n  {command}" for what, command in lines)
    return {"formatter_class": Formatter, "epilog": HEADING + shown}
