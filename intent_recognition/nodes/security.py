# SPDX-License-Identifier: Apache-2.0
"""Policies of SROS 2 for a graph: what each node may publish, subscribe to, call and answer.

`python -m intent_recognition.nodes.security GRAPH NAME:=VALUE ...` prints the policy of a graph
started with these arguments, in the format 0.2.0 that `ros2 security create_permission` reads.
Each node has an enclave of its own, `/NAMESPACE/NODE`, which the launch files name.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import cast
from xml.etree import ElementTree

from intent_recognition import registry
from intent_recognition.demonstrations import load_dofs
from intent_recognition.errors import ArgumentError, IntentError, one_line
from intent_recognition.model import load_model
from intent_recognition.nodes.graph import GRAPHS, NODES, NodeCall, arguments_of, resolve
from intent_recognition.nodes.params_files import parameters_in, params_files
from intent_recognition.nodes.people import ANYBODY
from intent_recognition.registry import BODY, HEARD, SAMPLED
from intent_recognition.share import PACKAGE

PARAMETER_SERVICES = (
    *("~/describe_parameters", "~/get_parameter_types", "~/get_parameters", "~/list_parameters"),
    *("~/set_parameters", "~/set_parameters_atomically", "~/get_type_description"),
)
LIFECYCLE_SERVICES = (
    *("~/change_state", "~/get_state", "~/get_available_states"),
    *("~/get_available_transitions", "~/get_transition_graph"),
)
OF_EACH_PERSON = tuple(
    f"intent/{name}"
    for name in ("answer", "human_path", "human_trajectory", "markers", "next_task")
    + ("robot_trajectory", "tasks")
)
"""Topics that each named person has under the name."""


def policy(graph: str, given: Mapping[str, object]) -> str:
    """The policy of a graph as XML; for the arguments see `graph.resolve`.

    The topics of the DOFs come from `dofs`, else from the model, else from the shipped file; bodies
    and people come from `params_file`, too.

    Raises:
        IntentError: there is no such graph or argument, a file cannot be read, bodies or people
            are no list, or people have no names.
    """
    values = arguments_of(graph, given)
    files = params_files(graph, values)
    calls = [call for call in resolve(graph, given) if call.package == PACKAGE]
    calls = [replace(call, parameters=_parameters(call, files)) for call in calls]
    path = str(values.get("dofs", "")) or None
    trained = values.get("model") if path is None else None
    dofs = load_model(str(trained)).dofs if trained else load_dofs(path)
    bodies = _texts(calls, "bodies") or {"wrist"}
    people = _texts(calls, "persons")
    if ANYBODY in people:
        cure = "Name everybody: permissions are by topic."
        raise ArgumentError.about("parameter persons", "names", ANYBODY, cure)
    sampled = {entry.topic.lstrip("/") for entry in (*dofs.recorded, *dofs.velocities)}
    tracked = {topic.split("/")[1] for topic in sampled if _is_tracked(topic)}
    heard = {f"human/{topic.split('/')[1]}" if _is_tracked(topic) else topic for topic in sampled}
    stand_for = {HEARD: sorted(heard), SAMPLED: sorted(sampled)}
    root = ElementTree.Element("policy", version="0.2.0")
    enclaves = ElementTree.SubElement(root, "enclaves")
    for call in calls:
        _add(enclaves, call, sorted(tracked | bodies), stand_for, sorted(people))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _parameters(call: NodeCall, files: Sequence[str]) -> dict[str, object]:
    """Parameters of a node as launched: those of a later file, then of the launch, override."""
    of_executable = parameters_in(files, replace(call, name=call.executable))
    return of_executable | parameters_in(files, call) | call.parameters


def _texts(calls: Sequence[NodeCall], name: str) -> set[str]:
    """What a parameter, a list of texts, holds in all nodes together."""
    values = [call.parameters.get(name, []) for call in calls]
    for value in values:
        if isinstance(value, str):
            cure = "Write it in brackets in the params_file."
            raise ArgumentError.about(f"parameter {name}", "a list of texts", value, cure)
    return {text for value in values for text in cast(list[str], value)}


def _of_person(topic: str, person: str, sampled: Sequence[str]) -> list[str]:
    """A topic's name for a named person; empty if people share it."""
    room, _, rest = topic.partition("/")
    if topic in OF_EACH_PERSON or room in ("human", "mocap"):
        return [f"{room}/{person}/{rest}"]
    return [f"{person}/{topic}"] if topic in sampled else []


def _is_tracked(topic: str) -> bool:
    return topic.startswith("mocap/") and topic.endswith("/pose") and topic.count("/") == 2


def _add(
    enclaves: ElementTree.Element,
    call: NodeCall,
    bodies: Sequence[str],
    stand_for: Mapping[str, Sequence[str]],
    people: Sequence[str],
) -> None:
    own, renamed = registry.NODES[call.executable], dict(call.remappings)

    def names(some: Sequence[str]) -> list[str]:
        found: list[str] = []
        for name in some:
            several = stand_for.get(name) or [name.replace(BODY, body) for body in bodies]
            found += [renamed.get(one, one) for one in several]
            for person in people:
                for one in several:
                    found += _of_person(one, person, stand_for[SAMPLED])
        return sorted(set(found))

    clock = ("/clock",) if NODES[call.name].clock else ()
    event = ("~/transition_event",) if own.managed else ()
    services = (*own.offers, *PARAMETER_SERVICES, *(LIFECYCLE_SERVICES if own.managed else ()))
    every = ("/diagnostics", "/parameter_events", "/rosout")
    place = ElementTree.SubElement(enclaves, "enclave", path=call.enclave)
    profiles = ElementTree.SubElement(place, "profiles")
    profile = ElementTree.SubElement(profiles, "profile", ns=f"/{call.namespace}", node=call.name)
    for kind, rule, allowed in (
        ("topic", "subscribe", names((*own.subscribes, "/clock", "/diagnostics", every[1]))),
        ("topic", "publish", names((*own.publishes, *clock, *event, registry.ANSWERS, *every))),
        ("service", "reply", names(services)),
        ("service", "request", names(own.calls)),
    ):
        if allowed:
            group = ElementTree.SubElement(profile, f"{kind}s", {rule: "ALLOW"})
            for name in allowed:
                ElementTree.SubElement(group, kind).text = name
    if action := call.parameters.get("command_action"):
        group = ElementTree.SubElement(profile, "actions", {"call": "ALLOW"})
        ElementTree.SubElement(group, "action").text = str(action)


def main(args: Sequence[str] | None = None) -> int:
    """Print the policy of a graph; returns 1 or 2, with one line on stderr, if that fails."""
    words = list(sys.argv[1:] if args is None else args)
    if not words or words[0] not in GRAPHS or not all(":=" in word for word in words[1:]):
        sys.stderr.write(f"expected one of {', '.join(GRAPHS)}, then NAME:=VALUE ...\n")
        return 2
    try:
        text = policy(words[0], dict(word.split(":=", 1) for word in words[1:]))
    except IntentError as error:
        sys.stderr.write(f"security: {one_line(error)}\n")
        return 1
    sys.stdout.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
