# SPDX-License-Identifier: Apache-2.0
"""The graphs of nodes as data: what the launch files start, and `intent demo` with them.

A graph names its nodes; a node names the arguments that its parameters and remappings are taken
from. `resolve` makes of both, and of values for the arguments, what is to be started. An argument
without a value sets nothing: the parameter file or the node's own default holds.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from intent_recognition.errors import ArgumentError, describe
from intent_recognition.share import PACKAGE

RECORDED = (
    "mocap/wrist/pose",
    "joint_states",
    "intent/tasks",
    "intent/robot_trajectory",
    "intent/active_task",
    "intent/next_task",
    "joint_trajectory",
    "coworker/task",
)
OWN_TOPICS = ("intent/", "human/", "joint_trajectory", "clock", "diagnostics", "rosout")
"""What the nodes make themselves: not to be played from a recording beside them."""

TRANSFORMS = (("/tf", "tf"), ("/tf_static", "tf_static"))
"""Relative, so that two robots in two namespaces keep their frames apart."""

_NOTHING: Mapping = MappingProxyType({})


@dataclass(frozen=True)
class Argument:
    """What can be said about a graph when it is started.

    Attributes:
        name: of the launch argument.
        kind: str, bool, int, float, or tuple for a list of texts separated by commas.
        description: one sentence.
        needed: whether there is no graph without it.
    """

    name: str
    kind: type
    description: str
    needed: bool = False

    def read(self, value: object) -> object:
        """The value of this kind, from text or as it is; None for an empty text or list.

        Raises:
            ArgumentError: it is no such value.
        """
        if not isinstance(value, str) or self.kind is str:
            return None if value == "" else value
        text = value.strip()
        try:
            read = _READ[self.kind](text) if text else None
        except (ValueError, KeyError) as error:
            kind = "a list" if self.kind is tuple else self.kind.__name__
            raise ArgumentError(describe(self.name, kind, text, self.description)) from error
        return None if read == () else read


_READ = {
    bool: lambda text: {"true": True, "false": False}[text.lower()],
    int: int,
    float: float,
    tuple: lambda text: tuple(word.strip() for word in text.split(",") if word.strip()),
}

ARGUMENTS = {
    argument.name: argument
    for argument in (
        Argument("model", str, "Model file written by `intent train`.", needed=True),
        Argument("bag", str, "Recording to replay.", needed=True),
        Argument("dofs", str, "DOF file to check the model against; empty: the model's own."),
        Argument("params_file", str, "Parameters of all nodes; the other arguments win."),
        Argument("namespace", str, "Namespace of the nodes."),
        Argument("use_sim_time", bool, "Take the time from /clock."),
        Argument("bodies", tuple, "Tracked bodies, separated by commas."),
        Argument("command_topic", str, "Where the arm takes a JointTrajectory."),
        Argument("joint_states_topic", str, "Where the arm publishes its joint states."),
        Argument("activate", bool, "Let the arm be moved at once; false: after `ros2 lifecycle`."),
        Argument("transition_prior", bool, "Expect the task that usually follows the last one."),
        Argument("pretrigger_threshold", float, "Go ahead for a next task so probable; 0: never."),
        Argument("publish_clock", bool, "The arm publishes /clock."),
        Argument("rate", float, "Simulated, or recorded, seconds in a real one."),
        Argument("headless", bool, "No PyBullet window."),
        Argument("sensor_noise", bool, "Noise on the simulated arm's joint states."),
        Argument("coworker", bool, "Start the simulated coworker."),
        Argument("task_list", str, "What the coworker does: labels, a file, random or habit."),
        Argument("seed", int, "Seed of the coworker's movements and of the noise."),
        Argument("loop", bool, "Play the recording again and again."),
        Argument("start_paused", bool, "Wait for bag_player/resume."),
        Argument("record", str, "Folder of a new bag with the session; empty: none."),
        Argument("dashboard", bool, "Serve the web page, and teach tasks from it."),
        Argument("port", int, "Port of the web page."),
        Argument("library", str, "Folder of the tasks taught from the page."),
        Argument("models", str, "Folder of the models the page compares."),
        Argument("rviz", bool, "Open RViz with config/intent.rviz."),
    )
}
COMMON = ("params_file", "namespace", "use_sim_time")


@dataclass(frozen=True)
class NodeSpec:
    """A node of a graph.

    Attributes:
        module: whose `main` runs it; empty for a node of another package.
        parameters: name of a parameter to the argument it is taken from.
        fixed: parameters that are always the same.
        remappings: name of a topic to the argument that says where it is.
        frames: whether it hears or tells of frames.
        clock: parameter by which it publishes /clock, which it does not follow then.
        when: argument without which it is not started; empty: always.
        package: it is installed from.
    """

    module: str
    parameters: Mapping[str, str] = field(default_factory=lambda: _NOTHING)
    fixed: Mapping[str, object] = field(default_factory=lambda: _NOTHING)
    remappings: Mapping[str, str] = field(default_factory=lambda: _NOTHING)
    frames: bool = False
    clock: str = ""
    when: str = ""
    package: str = PACKAGE

    def arguments(self) -> set[str]:
        """Names of the arguments it depends on."""
        named = {*self.parameters.values(), *self.remappings.values()}
        return named | ({self.when} if self.when else set())


_ARM = {"joint_states": "joint_states_topic"}
NODES = {
    "lwr_sim": NodeSpec(
        "sim_bridge.nodes.lwr_sim",
        {
            "publish_clock": "publish_clock",
            "real_time_factor": "rate",
            "headless": "headless",
            "sensor_noise": "sensor_noise",
            "seed": "seed",
        },
        clock="publish_clock",
    ),
    "mocap_ingest": NodeSpec("intent_recognition.nodes.mocap_ingest", {"bodies": "bodies"}),
    "intent_estimator": NodeSpec(
        "intent_recognition.nodes.intent_estimator",
        {"model": "model", "dofs": "dofs", "transition_prior": "transition_prior"},
        remappings=_ARM,
    ),
    "primitive_activation": NodeSpec(
        "intent_recognition.nodes.primitive_activation",
        {
            "model": "model",
            "autostart": "activate",
            "pretrigger_threshold": "pretrigger_threshold",
        },
        remappings=_ARM | {"joint_trajectory": "command_topic"},
    ),
    "coworker_sim": NodeSpec(
        "sim_bridge.nodes.coworker_sim",
        {"seed": "seed", "task_list": "task_list"},
        when="coworker",
    ),
    "bag_player": NodeSpec(
        "intent_recognition.nodes.bag_player",
        {"bag": "bag", "rate": "rate", "loop": "loop", "start_paused": "start_paused"},
        fixed={"clock": True, "without": list(OWN_TOPICS)},
        clock="clock",
    ),
    "bag_recorder": NodeSpec(
        "intent_recognition.nodes.bag_recorder",
        {"output": "record"},
        fixed={"topics": list(RECORDED)},
        when="record",
    ),
    "task_teacher": NodeSpec(
        "intent_recognition.nodes.task_teacher",
        {"model": "model", "library": "library", "dofs": "dofs"},
        when="dashboard",
    ),
    "dashboard": NodeSpec(
        "intent_recognition.dashboard.start",
        {"port": "port", "models": "models"},
        remappings=_ARM,
        when="dashboard",
    ),
    "robot_state_publisher": NodeSpec(
        "", remappings=_ARM, frames=True, when="rviz", package="robot_state_publisher"
    ),
    "rviz2": NodeSpec("", frames=True, when="rviz", package="rviz2"),
}
RECOGNITION = ("mocap_ingest", "intent_estimator", "primitive_activation")
PAGE = ("task_teacher", "dashboard")


@dataclass(frozen=True)
class GraphSpec:
    """Nodes that are started together, in this order.

    Attributes:
        nodes: their names.
        defaults: values of arguments that are not given.
    """

    nodes: tuple[str, ...]
    defaults: Mapping[str, object]

    def arguments(self) -> list[Argument]:
        """What can be said about it, in the order of `ARGUMENTS`."""
        used = set(COMMON).union(*(NODES[name].arguments() for name in self.nodes))
        return [argument for name, argument in ARGUMENTS.items() if name in used]


_PARAMS = {"params_file": "config/params.yaml"}
_TASKS = {"library": "tasks"}
_SIM = {"use_sim_time": True, "publish_clock": True, "coworker": True}
GRAPHS = {
    "demo": GraphSpec(
        ("lwr_sim", *RECOGNITION, "coworker_sim", "bag_recorder", *PAGE)
        + ("robot_state_publisher", "rviz2"),
        _PARAMS | _TASKS | _SIM,
    ),
    "sim": GraphSpec(
        ("lwr_sim", "coworker_sim", "robot_state_publisher", "rviz2"),
        _PARAMS | {"coworker": True},
    ),
    "intent": GraphSpec((*RECOGNITION, *PAGE, "rviz2"), _PARAMS | _TASKS),
    "real": GraphSpec(
        (*RECOGNITION, "bag_recorder", *PAGE, "rviz2"),
        _TASKS
        | {
            "params_file": "config/real_arm.yaml",
            "command_topic": "joint_trajectory_controller/joint_trajectory",
            "activate": False,
        },
    ),
    "replay": GraphSpec(
        ("bag_player", "mocap_ingest", "intent_estimator", *PAGE)
        + ("robot_state_publisher", "rviz2"),
        _PARAMS | _TASKS | {"use_sim_time": True},
    ),
}


@dataclass(frozen=True)
class NodeCall:
    """A node as it is to be started.

    Attributes:
        name: of the node; that of its executable too.
        package: it is installed from.
        module: whose `main` runs it; empty for a node of another package.
        namespace: of its topics; empty: none.
        parameters: those that are set.
        remappings: from and to.
    """

    name: str
    package: str
    module: str
    namespace: str
    parameters: dict[str, object]
    remappings: tuple[tuple[str, str], ...]


def resolve(graph: str, given: Mapping[str, object]) -> list[NodeCall]:
    """What to start.

    Args:
        graph: one of `GRAPHS`.
        given: values of its arguments, as they are or as text; None and empty text mean unset.

    Raises:
        ArgumentError: no such argument, a value of another kind, or a needed one is missing.
    """
    values = arguments_of(graph, given)
    calls = []
    for name in GRAPHS[graph].nodes:
        spec = NODES[name]
        if not spec.when or values.get(spec.when):
            calls.append(_call(name, spec, values))
    return calls


def arguments_of(graph: str, given: Mapping[str, object]) -> dict[str, object]:
    """Values of the arguments that have one; see `resolve`."""
    spec = GRAPHS[graph]
    known = {argument.name: argument for argument in spec.arguments()}
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise ArgumentError(
            describe(f"argument of {graph}", f"one of {', '.join(known)}", unknown[0], "Name one.")
        )
    read = {name: known[name].read(value) for name, value in given.items()}
    values = dict(spec.defaults) | {k: v for k, v in read.items() if v is not None}
    for name, argument in known.items():
        if argument.needed and name not in values:
            raise ArgumentError(describe(name, "a value", "nothing", argument.description))
    return values


def _call(name: str, spec: NodeSpec, values: Mapping[str, object]) -> NodeCall:
    taken = {p: values[a] for p, a in spec.parameters.items() if a in values}
    parameters = dict(spec.fixed) | {
        p: list(value) if isinstance(value, tuple) else value for p, value in taken.items()
    }
    if "use_sim_time" in values and not (spec.clock and parameters.get(spec.clock)):
        parameters["use_sim_time"] = values["use_sim_time"]
    topics = [(topic, values[a]) for topic, a in spec.remappings.items() if a in values]
    frames = TRANSFORMS if spec.frames else ()
    return NodeCall(
        name,
        spec.package,
        spec.module,
        str(values.get("namespace", "")).strip("/"),
        parameters,
        (*topics, *frames),
    )
