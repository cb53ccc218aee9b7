# SPDX-License-Identifier: Apache-2.0
"""The executables of the nodes explain themselves without starting."""

import sys

import pytest

from intent_recognition.dashboard.start import main as dashboard
from intent_recognition.nodes import start
from intent_recognition.nodes.start import tell_missing
from sim_bridge.nodes import start as bridge

NODES = {
    name: main
    for room in (start, bridge)
    for name, main in vars(room).items()
    if getattr(main, "func", None) is start.start
}


@pytest.mark.parametrize("name", [*NODES, "dashboard"])
def test_help_says_what_it_does_and_where_its_parameters_are(name, capsys, monkeypatch):
    main = NODES.get(name, dashboard)
    monkeypatch.setattr(sys, "argv", [f"/bin/{name}", "--help"])
    assert main() == 0
    first, _, usage, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{name}: ") and first.endswith(".") and "ode" not in first.split()[1]
    assert usage.startswith(f"usage: {name} [--ros-args [-p NAME:=VALUE")
    assert "docs/reference/nodes.md" in "\n".join(rest)


def test_an_import_that_fails_for_another_reason_is_shown_whole():
    with pytest.raises(ImportError, match="scipy"):
        tell_missing("node", ModuleNotFoundError("No module named 'scipy'", name="scipy"))
