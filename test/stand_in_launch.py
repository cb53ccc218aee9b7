# SPDX-License-Identifier: Apache-2.0
"""Stand-ins of `launch` and `launch_ros`, which no package index has, and what they make."""

from dataclasses import dataclass, field

NEEDED = {"model": __file__, "bag": __file__}
"""Any files: they are only looked for."""
ALL_ON = {"dashboard": "true", "rviz": "true", "record": "a/bag"}


@dataclass
class Call:
    """What a launch action was made with."""

    kind: str
    args: tuple
    options: dict = field(default_factory=dict)


class Context(dict):
    """The values of launch arguments."""

    launch_configurations = property(lambda self: self)


class Configuration(Call):
    def perform(self, context):
        return context[self.args[0]]


def recorder(kind):
    make = Configuration if kind == "LaunchConfiguration" else Call
    return lambda *args, **options: make(kind, args, options)


MODULES = {
    "launch": ["LaunchContext", "LaunchDescription"],
    "launch.actions": [
        *("DeclareLaunchArgument", "IncludeLaunchDescription", "OpaqueFunction"),
        "SetEnvironmentVariable",
    ],
    "launch.launch_description_sources": ["PythonLaunchDescriptionSource"],
    "launch.substitutions": ["LaunchConfiguration"],
    "launch_ros": [],
    "launch_ros.actions": ["Node"],
    "launch_ros.parameter_descriptions": ["ParameterValue"],
}


def declared(entities):
    return {e.args[0]: e.options for e in entities if e.kind == "DeclareLaunchArgument"}


def start(entities, **given):
    """The nodes, by name, as launch would start them with these arguments."""
    context = Context(ros_namespace="")
    for name, options in declared(entities).items():
        context[name] = options["default_value"] if "default_value" in options else NEEDED[name]
    (action,) = [e for e in entities if e.kind == "OpaqueFunction"]
    unknown = set(given) - set(context)
    assert not unknown, unknown
    context.update(given)
    nodes = action.options["function"](context, *action.options["args"])
    return {node.options["name"]: node.options for node in nodes}


def on(entities):
    """The arguments that start everything there is."""
    return {name: value for name, value in ALL_ON.items() if name in declared(entities)}


def values(node):
    """What a node's parameters are set to, the file aside."""
    *_, given = node["parameters"]
    return {k: v.args[0] if isinstance(v, Call) else v for k, v in given.items()}
