# SPDX-License-Identifier: Apache-2.0
"""Every number at the top of a file says what it is, in which unit and why."""

import ast

from docs.shown import ROOT


def undocumented(path):
    """The numbers at the top of a file that nothing is said of; several may share a docstring."""
    waiting = []
    for statement in ast.parse(path.read_text(encoding="utf-8")).body:
        if is_number(statement):
            waiting.append(statement.targets[0].id)
            continue
        text = statement.value if isinstance(statement, ast.Expr) else None
        if not (isinstance(text, ast.Constant) and isinstance(text.value, str)):
            yield from waiting
        waiting = []
    yield from waiting


def is_number(statement):
    """Whether it gives a name in capitals numbers only."""
    if not (isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name)):
        return False
    inside = list(ast.walk(statement.value))
    leaves = [node.value for node in inside if isinstance(node, ast.Constant)]
    return (
        statement.targets[0].id.isupper()
        and bool(leaves)
        and all(type(leaf) in (int, float) for leaf in leaves)
        and not any(isinstance(node, (ast.Name, ast.Call)) for node in inside)
    )


def test_every_constant_has_a_docstring():
    files = (p for top in ("intent_recognition", "sim_bridge") for p in (ROOT / top).rglob("*.py"))
    assert [f"{path}: {name}" for path in files for name in undocumented(path)] == []
