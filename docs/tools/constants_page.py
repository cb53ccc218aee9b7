# SPDX-License-Identifier: Apache-2.0
"""The reference of constants, from the docstrings beside them: value, meaning, unit and source."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

LIBRARY = Path(__file__).resolve().parents[2] / "intent_recognition"
ROOMS = (
    "signals",
    "tracking",
    "demonstrations",
    "promp",
    "alignment",
    "filtering",
    "learning",
    "recognition",
    "activation",
    "composing",
    "motion",
    "kinematics",
    "gaussian",
    "warping",
    "improvement",
    "nodes",
)
INTRODUCTION = """\
# Constants

<!-- Written by docs/tools/write_reference.py from the docstrings; do not edit. -->

Every number that tunes how the package behaves, with its unit and where the value comes from: an \
equation, a measurement (the page that shows it is named), or a convention. What a user may change \
at run time is a parameter ([nodes](nodes.md)) or an option ([commands](commands.md)) instead.
"""


class Constant(NamedTuple):
    """A module-level number, or tuple of numbers, and what its docstring says."""

    name: str
    value: str
    text: str


def constants_page() -> str:
    """The page as Markdown."""
    return "\n".join([INTRODUCTION, *(_section(room) for room in ROOMS)])


def _section(room: str) -> str:
    files = sorted((LIBRARY / room).rglob("*.py"))
    rows = [
        f"| `{path.relative_to(LIBRARY)}` | `{name}` | {value} | {text} |"
        for path in files
        for name, value, text in constants(path)
    ]
    head = ["| file | constant | value | meaning, unit, source |", "|---|---|---|---|"]
    return "\n".join([f"## {room}\n", *head, *rows, ""])


def constants(path: Path) -> Iterator[Constant]:
    """The numeric constants of a file; one that follows another shares the docstring below both."""
    waiting: list[tuple[str, str]] = []
    for statement in ast.parse(path.read_text(encoding="utf-8")).body:
        if _is_text(statement):
            text = " ".join(statement.value.value.split()).replace("|", r"\|")
            yield from (Constant(name, value, text) for name, value in waiting)
            waiting = []
        elif found := _number(statement):
            waiting.append(found)
        else:
            yield from (Constant(name, value, "") for name, value in waiting)
            waiting = []
    yield from (Constant(name, value, "") for name, value in waiting)


def _is_text(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def _number(statement: ast.stmt) -> tuple[str, str] | None:
    """Name and value of a public or private constant in capitals that holds numbers only."""
    if not (isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)):
        return None
    name = statement.targets[0].id
    leaves = [n for n in ast.walk(statement.value) if isinstance(n, ast.Constant)]
    others = [n for n in ast.walk(statement.value) if isinstance(n, (ast.Name, ast.Call))]
    numeric = leaves and all(type(leaf.value) in (int, float) for leaf in leaves)
    if not name.isupper() or not numeric or others:
        return None
    return name, ast.unparse(statement.value)
