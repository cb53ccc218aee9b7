# SPDX-License-Identifier: Apache-2.0
"""Every number at the top of a file says what it is, in which unit and why."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from docs.shown import ROOT

UNIT = re.compile(r"(?<!_PER)_(?:S|M|MM|CM|RAD|HZ|N|KG|NS|M_S|RAD_S|RAD_M|PIXELS)$")


class Constant(NamedTuple):
    """A module-level number, or tuple of numbers, and what its docstring says."""

    name: str
    value: str
    text: str


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


def undocumented(documented):
    files = (p for top in ("intent_recognition", "sim_bridge") for p in (ROOT / top).rglob("*.py"))
    return [
        f"{path.relative_to(ROOT)}: {constant.name}"
        for path in sorted(files)
        for constant in constants(path)
        if not documented(constant)
    ]


def test_every_constant_has_a_docstring():
    assert undocumented(lambda constant: constant.text) == []


def test_a_constant_whose_name_has_a_unit_names_it():
    def names_it(constant):
        return not UNIT.search(constant.name) or "[" in constant.text

    assert undocumented(names_it) == []
