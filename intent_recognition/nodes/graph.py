# SPDX-License-Identifier: Apache-2.0
"""The graphs of nodes as data, for the launch files and `intent demo`.

A graph lists its nodes; a node lists the launch arguments that set its parameters and remappings.
`resolve` turns a graph and values of the arguments into node calls. An argument without a value
sets nothing: the parameter file or the node's own default applies.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from intent_recognition import registry
from intent_recognition.errors import ArgumentError
from intent_recognition.nodes.arguments import ARGUMENTS, Argument
from intent_recognition.registry import ARMS, OWN_TOPICS, RECORDED
from intent_recognition.share import PACKAGE

TRANSFORMS = (("/tf", "tf"), ("/tf_static", "tf_static"))
"""Remappings to relative names, so that robots in two namespaces keep their frames apart."""


COMMON = ("params_file", "namespace", "use_sim_time", "respawn")


@dataclass(frozen=True)
class NodeSpec:
    """A node of a graph."""

    parameters: Mapping[str, str] = field(default_factory=dict)  # parameter to its argument
    fixed: Mapping[str, object] = field(default_factory=dict)  # parameters with a fixed value
    remappings: Mapping[str, str] = field(default_factory=dict)  # topic to its argument
    topics: Mapping[str, str] = field(default_factory=dict)  # topic name to its name in this graph
    executable: str = ""
    frames: bool = False
    clock: str = ""  # parameter that makes the node publish /clock, which it then does not follow
    when: str = ""  # argument that must be set for the node to start; empty: always started
    unless: str = ""  # argument that must not be set
    package: str = PACKAGE
    # whether a node that died is restarted; not if it ends with its bag or window
    respawns: bool = True
    # nodes that must be ready, if started, before this one begins to play or to move
    waits: tuple[str, ...] = ()

    def arguments(self) -> set[str]:
        """Names of the arguments that the node depends on."""
        named = {*self.parameters.values(), *self.remappings.values()}
        return named | ({self.when, self.unless} - {""})


def _from(*same: str, **other: str) -> dict[str, str]:
    """Parameters set by arguments of the same name, or of another as `parameter="argument"`."""
    return {name: name for name in same} | other


RECOGNITION = ("mocap_ingest", "intent_estimator", "primitive_activation")
_STATES = {"joint_states": "joint_states_topic"}
_ARM = _STATES | {"joint_trajectory": "command_topic"}
_SIMULATED = _from(
    *("publish_clock", "headless", "sensor_noise", "seed", "cup", "second", "second_opening"),
    real_time_factor="rate",
    scene="arm_scene",
)


def _warper(name: str, **toward: str) -> NodeSpec:
    own = {f"object/{topic}": f"{name}/{topic}" for topic in _SEEN}
    return NodeSpec(
        _from(stands_above="stands_above"),
        topics=own | {f"object/{topic}": there for topic, there in toward.items()},
        executable="object_warper",
        frames=True,
    )


_SEEN = ("cloud", "grasp", "labelled_cloud", "parameters", "pose")
NODES = {
    "lwr_sim": NodeSpec(_SIMULATED, remappings=_ARM, clock="publish_clock", unless="arm"),
    "arm_sim": NodeSpec(
        _SIMULATED | {"robot": "arm"}, remappings=_ARM, clock="publish_clock", when="arm"
    ),
    "mocap_ingest": NodeSpec(_from("bodies"), frames=True),
    "intent_estimator": NodeSpec(
        _from("model", "dofs", "transition_prior", "plan", "hand_link"),
        remappings=_STATES,
        frames=True,
    ),
    "primitive_activation": NodeSpec(
        _from("model", "pretrigger_threshold", "hand_link", "sequences", "command_action")
        | {"autostart": "activate"},
        remappings=_ARM,
    ),
    "object_transfer": NodeSpec(_from("command_action"), remappings=_ARM, when="transfers"),
    "cup_warper": _warper("cup", toward="second/pose"),
    "second_warper": _warper("second"),
    "warped_primitive": NodeSpec(_from("skill", "fluid"), remappings=_STATES),
    "coworker_sim": NodeSpec(
        _from("seed", "task_list", "scenario"),
        when="coworker",
        waits=(*ARMS, *RECOGNITION, "object_transfer", "bag_recorder"),
    ),
    "bag_player": NodeSpec(
        _from("bag", "rate", "loop", "start_paused"),
        fixed={"clock": True, "without": list(OWN_TOPICS)},
        remappings=_STATES,
        clock="clock",
        respawns=False,
        waits=("mocap_ingest", "intent_estimator"),
    ),
    "bag_recorder": NodeSpec(
        _from(output="record"),
        fixed={"topics": list(RECORDED)},
        remappings=_ARM,
        when="record",
        respawns=False,
    ),
    "task_teacher": NodeSpec(
        _from("model", "library", "dofs", "hand_link"), remappings=_ARM, when="dashboard"
    ),
    "dashboard": NodeSpec(
        _from("port", "models", "hand_link", "scene", "light"), remappings=_ARM, when="dashboard"
    ),
    "robot_state_publisher": NodeSpec(
        remappings=_STATES, frames=True, when="rviz", package="robot_state_publisher"
    ),
    "rviz2": NodeSpec(frames=True, when="rviz", package="rviz2", respawns=False),
}
PAGE = ("task_teacher", "dashboard")


@dataclass(frozen=True)
class GraphSpec:
    """Nodes that start together, in this order.

    The user's parameter file overrides the shipped one, `params`. The graph does not take the
    arguments in `without`. With `respawn` (default true), nodes that die are restarted; see
    `NodeSpec.respawns`.
    """

    nodes: tuple[str, ...]
    defaults: Mapping[str, object]
    params: str = "config/params.yaml"
    without: tuple[str, ...] = ()

    def arguments(self) -> list[Argument]:
        """Arguments of the graph, in the order of `ARGUMENTS`."""
        used = set(COMMON).union(*(NODES[name].arguments() for name in self.nodes))
        used -= set(self.without)
        return [argument for name, argument in ARGUMENTS.items() if name in used]


_TASKS: dict[str, object] = {"library": "tasks"}
_SIM: dict[str, object] = {"use_sim_time": True, "publish_clock": True, "coworker": True}
_WHOLE = (*ARMS, *RECOGNITION, "object_transfer", "coworker_sim", "bag_recorder", *PAGE) + (
    *("robot_state_publisher", "rviz2"),
)
GRAPHS = {
    "demo": GraphSpec(
        _WHOLE, _TASKS | _SIM | {"scene": "toolbox", "transfers": True}, without=("arm_scene",)
    ),
    "assembly": GraphSpec(
        tuple(name for name in _WHOLE if name != "object_transfer"),
        _TASKS | _SIM | {"arm": "panda", "scenario": "assembly"},
        without=("arm_scene",),
    ),
    "pouring": GraphSpec(
        ("lwr_sim", "cup_warper", "second_warper", "warped_primitive", "primitive_activation")
        + ("robot_state_publisher", "rviz2"),
        {"use_sim_time": True, "publish_clock": True, "arm_scene": "pouring"},
        without=("model", "pretrigger_threshold", "hand_link", "arm"),
    ),
    "sim": GraphSpec((*ARMS, "coworker_sim", "robot_state_publisher", "rviz2"), {"coworker": True}),
    "intent": GraphSpec((*RECOGNITION, *PAGE, "rviz2"), _TASKS),
    "real": GraphSpec(
        (*RECOGNITION, "bag_recorder", *PAGE, "rviz2"),
        _TASKS
        | {"command_topic": "joint_trajectory_controller/joint_trajectory", "activate": False},
        params="config/real_arm.yaml",
    ),
    "replay": GraphSpec(
        ("bag_player", "mocap_ingest", "intent_estimator", *PAGE)
        + ("robot_state_publisher", "rviz2"),
        _TASKS | {"use_sim_time": True},
    ),
}


@dataclass(frozen=True)
class NodeCall:
    """A node of a graph with all values that it starts with; see `NodeSpec`."""

    name: str
    package: str
    module: str  # module whose `main` runs it; empty for a node of another package
    namespace: str
    parameters: dict[str, object]
    remappings: tuple[tuple[str, str], ...]  # pairs of names, from and to
    executable: str
    respawns: bool = False

    @property
    def enclave(self) -> str:
        """The node's enclave of SROS 2, such as `/cell1/mocap_ingest`."""
        return "/".join(["", *filter(None, (self.namespace, self.name))])


def resolve(
    graph: str, given: Mapping[str, object], own: Mapping[str, Mapping[str, object]] | None = None
) -> list[NodeCall]:
    """Make the calls that start the nodes of a graph.

    Args:
        graph: one of `GRAPHS`.
        given: arguments by name, as values or as text; None and empty text mean unset.
        own: further parameters by node, which arguments override.

    Raises:
        ArgumentError: an argument is unknown, of the wrong kind, or needed and missing.
    """
    values = arguments_of(graph, given)
    _follow_the_clock(graph, values)
    if values.get("transfers"):
        values["arm_scene"] = "transfers"  # the scene with the objects
    started = [name for name in GRAPHS[graph].nodes if _starts(name, values)]
    return [_call(name, NODES[name], values, (own or {}).get(name, {})) for name in started]


def arguments_of(graph: str, given: Mapping[str, object]) -> dict[str, object]:
    """Values of the arguments that have one; see `resolve`."""
    spec = GRAPHS[graph]
    known = {argument.name: argument for argument in spec.arguments()}
    unknown = sorted(set(given) - set(known))
    if unknown:
        expected = f"one of {', '.join(known)}"
        raise ArgumentError.about(f"argument of {graph}", expected, unknown[0], "Name one.")
    read = {name: known[name].read(value) for name, value in given.items()}
    values = dict(spec.defaults) | {k: v for k, v in read.items() if v is not None}
    for name, argument in known.items():
        if argument.needed and name not in values:
            raise ArgumentError.about(name, "a value", "nothing", argument.description)
    return values


def _follow_the_clock(graph: str, values: dict[str, object]) -> None:
    for name in GRAPHS[graph].nodes:
        spec = NODES[name]
        published = spec.fixed.get(spec.clock) or values.get(spec.parameters.get(spec.clock, ""))
        if spec.clock and published and not values.setdefault("use_sim_time", True):
            cure = f"Leave it away, or let {name} publish no /clock."
            raise ArgumentError.about("use_sim_time", "true with a /clock", False, cure)


def _starts(name: str, values: Mapping[str, object]) -> bool:
    spec = NODES[name]
    return bool((not spec.when or values.get(spec.when)) and not values.get(spec.unless))


def _call(
    name: str, spec: NodeSpec, values: Mapping[str, object], own: Mapping[str, object]
) -> NodeCall:
    taken = {p: values[a] for p, a in spec.parameters.items() if a in values}
    parameters = (
        dict(spec.fixed)
        | dict(own)
        | {p: list(value) if isinstance(value, tuple) else value for p, value in taken.items()}
    )
    if "use_sim_time" in values and not (spec.clock and parameters.get(spec.clock)):
        parameters["use_sim_time"] = values["use_sim_time"]
    if waits := [name for name in spec.waits if _starts(name, values)]:
        parameters["wait_for_nodes"] = waits
    topics = [(topic, str(values[a])) for topic, a in spec.remappings.items() if a in values]
    frames = TRANSFORMS if spec.frames else ()
    executable = spec.executable or name
    return NodeCall(
        name,
        spec.package,
        registry.NODES[executable].module if spec.package == PACKAGE else "",
        str(values.get("namespace", "")).strip("/"),
        parameters,
        (*spec.topics.items(), *topics, *frames),
        executable,
        spec.respawns and values.get("respawn") is not False,
    )
