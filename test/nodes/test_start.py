# SPDX-License-Identifier: Apache-2.0
"""The executables of the nodes explain themselves without starting."""

import pytest

from intent_recognition.nodes import start
from intent_recognition.nodes.start import tell_missing
from intent_recognition.registry import NODES


@pytest.mark.parametrize("name", NODES)
def test_help_says_what_it_does_and_where_its_parameters_are(name, capsys):
    assert start.start(name, [name, "--help"]) == 0
    first, _, usage, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{name}: ") and first.endswith(".") and "ode" not in first.split()[1]
    assert usage.startswith(f"usage: {name} [--ros-args [-p NAME:=VALUE")
    assert "docs/reference/nodes.md" in "\n".join(rest)


def test_an_import_that_fails_for_another_reason_is_shown_whole():
    with pytest.raises(ImportError, match="scipy"):
        tell_missing("node", ModuleNotFoundError("No module named 'scipy'", name="scipy"))


def test_there_is_no_executable_but_the_nodes():
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        start.nonsense  # noqa: B018
