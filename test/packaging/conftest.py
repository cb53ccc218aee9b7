# SPDX-License-Identifier: Apache-2.0
"""Launch files without `launch`."""

import runpy
import sys
import types

import pytest
from stand_in_launch import MODULES, recorder

from intent_recognition.nodes import launch_checks


@pytest.fixture
def describe(repository, monkeypatch):
    """Function from the name of a launch file to its entities."""
    monkeypatch.setattr(launch_checks, "get_package_prefix", lambda name: name)
    for name, members in MODULES.items():
        module = types.ModuleType(name)
        for member in members:
            setattr(module, member, recorder(member))
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "intent_recognition.nodes.launching", raising=False)

    def run(name):
        namespace = runpy.run_path(str(repository / "launch" / f"{name}.launch.py"))
        return namespace["generate_launch_description"]().args[0]

    yield run
    sys.modules.pop("intent_recognition.nodes.launching", None)
