# SPDX-License-Identifier: Apache-2.0
"""Every parameter of the shipped file is one its node declares."""

import ast

import yaml

NODES = {"lwr_sim": "sim_bridge", "coworker_sim": "sim_bridge"}


def texts(path):
    """All string constants of a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant)}


def test_shipped_parameters_are_declared(repository):
    sections = yaml.safe_load((repository / "config" / "params.yaml").read_text(encoding="utf-8"))
    shared = texts(repository / "intent_recognition" / "nodes" / "lifecycle.py")
    for key, section in sections.items():
        name = key.removeprefix("/**/")
        room = NODES.get(name, "intent_recognition")
        known = texts(repository / room / "nodes" / f"{name}.py") | shared
        assert set(section["ros__parameters"]) <= known, name
