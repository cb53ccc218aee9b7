# SPDX-License-Identifier: Apache-2.0
"""The launch files against stand-ins of `launch` and `launch_ros`, which no package index has."""

import runpy
import sys
import types
from dataclasses import dataclass, field

import pytest
import yaml

EXECUTABLES = {
    "intent.launch.py": {"mocap_ingest", "intent_estimator", "primitive_activation"},
    "sim.launch.py": {"lwr_sim", "coworker_sim"},
    "demo.launch.py": set(),
}


@dataclass
class Call:
    """What a launch action or substitution was made with."""

    kind: str
    args: tuple
    options: dict = field(default_factory=dict)


def recorder(kind):
    return lambda *args, **options: Call(kind, args, options)


MODULES = {
    "launch": ["LaunchDescription"],
    "launch.actions": [
        "DeclareLaunchArgument",
        "IncludeLaunchDescription",
        "SetEnvironmentVariable",
    ],
    "launch.conditions": ["IfCondition"],
    "launch.launch_description_sources": ["PythonLaunchDescriptionSource"],
    "launch.substitutions": ["LaunchConfiguration", "PathJoinSubstitution"],
    "launch_ros": [],
    "launch_ros.actions": ["Node"],
    "launch_ros.parameter_descriptions": ["ParameterValue"],
    "launch_ros.substitutions": ["FindPackageShare"],
}


@pytest.fixture
def describe(repository, monkeypatch):
    """Function from the name of a launch file to its entities."""
    for name, members in MODULES.items():
        module = types.ModuleType(name)
        for member in members:
            setattr(module, member, recorder(member))
        monkeypatch.setitem(sys.modules, name, module)

    def run(name):
        namespace = runpy.run_path(str(repository / "launch" / name))
        return namespace["generate_launch_description"]().args[0]

    return run


def walk(value):
    """Every Call inside `value`."""
    if isinstance(value, Call):
        yield value
        yield from walk(value.args)
        yield from walk(list(value.options.values()))
    elif isinstance(value, dict):
        yield from walk(list(value.values()))
    elif isinstance(value, (list, tuple, type({}.items()))):
        for item in value:
            yield from walk(item)


def declared(entities):
    return {e.args[0] for e in entities if e.kind == "DeclareLaunchArgument"}


@pytest.mark.parametrize("name", EXECUTABLES)
def test_every_argument_used_is_declared(describe, name):
    entities = describe(name)
    used = {call.args[0] for call in walk(entities) if call.kind == "LaunchConfiguration"}
    assert used == declared(entities)
    assert {"params_file", "namespace", "use_sim_time"} <= declared(entities)


@pytest.mark.parametrize("name", EXECUTABLES)
def test_arguments_are_described(describe, name):
    for entity in describe(name):
        if entity.kind == "DeclareLaunchArgument":
            assert entity.options["description"].endswith(".")


@pytest.mark.parametrize("name", EXECUTABLES)
def test_nodes_are_executables_with_parameters(describe, repository, name):
    nodes = [entity for entity in describe(name) if entity.kind == "Node"]
    assert {node.options["executable"] for node in nodes} == EXECUTABLES[name]
    sections = yaml.safe_load((repository / "config" / "params.yaml").read_text(encoding="utf-8"))
    for node in nodes:
        assert node.options["package"] == "intent_recognition"
        assert node.options["name"] == node.options["executable"]
        assert f"/**/{node.options['name']}" in sections


@pytest.mark.parametrize("name", EXECUTABLES)
def test_every_node_takes_the_namespace_and_the_simulated_time(describe, name):
    for node in (entity for entity in describe(name) if entity.kind == "Node"):
        _, *values = node.options["parameters"]
        assert any("use_sim_time" in given for given in values), node.options["name"]
        assert node.options["namespace"].args == ("namespace",)


def test_demo_passes_only_arguments_that_exist(describe):
    for entity in describe("demo.launch.py"):
        if entity.kind == "IncludeLaunchDescription":
            (path,) = entity.args[0].args
            included = declared(describe(path.args[0][-1]))
            assert {argument for argument, _ in entity.options["launch_arguments"]} <= included
