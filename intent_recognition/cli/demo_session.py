# SPDX-License-Identifier: Apache-2.0
"""A session of the demo: starts its nodes as processes and watches them until the end."""

import argparse
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from intent_recognition.cli.console import say
from intent_recognition.cli.demo_scene import Scene
from intent_recognition.cli.session_watch import (
    COWORKER,
    START_S,
    Heartbeats,
    NodeWatch,
    ProgressLine,
)
from intent_recognition.dashboard.admission import TOKEN_VARIABLE, answers, random_token
from intent_recognition.errors import ArgumentError, IntentError, ResourceBusyError
from intent_recognition.interrupts import noted_interrupts
from intent_recognition.model import LIBRARY_MODEL
from intent_recognition.nodes.graph import ARMS, GRAPHS, NodeCall, resolve

if TYPE_CHECKING:
    from rclpy.node import Node

    from intent_recognition.evaluation import SessionLog
    from intent_recognition.nodes.session_observer import SessionObserver

LIBRARY = "tasks"
"""Folder of the tasks taught on the page, within the demo's output."""
DOMAINS = (1, 101)
"""Lowest and highest ROS domain whose ports lie below Linux's ephemeral ports (ROS 2
documentation, "The ROS_DOMAIN_ID")."""


def run_session(
    args: argparse.Namespace, model: Path, console: Console, scene: Scene
) -> tuple[dict[str, "SessionLog"], int, dict[str, object]]:
    """Start the nodes, follow the session, stop the nodes.

    Returns:
        Each worker's log by name, the stamp of the first sample, and the pace of time in words.

    Raises:
        IntentError: a node died, or sent nothing.
        KeyboardInterrupt: the user interrupted; all nodes have been stopped.
    """
    from sim_bridge.scenarios.toolbox import first_sample_ns

    calls = _calls(args, model, scene)
    logs, time_went = _run_graph(args, calls, model, scene, console)
    person, plan = next(iter(scene.plans.items()))
    log = logs[person]
    first_ns = first_sample_ns(log, plan)
    if first_ns is None:
        got = f"{len(log.wrist_ns)} poses, none of them at a place of the session"
        cure = "See the nodes' logs, and let nothing else publish in this ROS_DOMAIN_ID."
        raise IntentError.about(
            "mocap/wrist/pose", "the coworker's poses", got if len(log.wrist_ns) else "none", cure
        )
    return logs, first_ns, time_went


def refuse_options(
    args: argparse.Namespace, usual: Mapping[str, object], beside: str, cure: str
) -> None:
    """Refuse options, given with their default values, that mean nothing beside another option."""
    for name, value in usual.items():
        if (got := getattr(args, name)) != value:
            option = f"--{name.replace('_', '-')}"
            raise ArgumentError.about(option, f"no such option with {beside}", got, cure)


def begin_library(library: Path, model: Path, console: Console) -> None:
    """Let the teacher start from the estimator's model, and keep tasks that were taught before.

    Args:
        library: folder of the page's tasks; an existing one is renamed to the next free number,
            unless the estimator's model is its own.
        model: model file of the estimator.
        console: console that reports the new name.
    """
    if not library.exists() or model.resolve() == (library / LIBRARY_MODEL).resolve():
        return
    if library.resolve() in model.resolve().parents:
        cure = f"Copy that file, or give {library / LIBRARY_MODEL}."
        raise ResourceBusyError.about("--model", f"a model outside of {library}", model, cure)
    named = (library.with_name(f"{library.name}_{n}") for n in count(1))
    kept = next(path for path in named if not path.exists())
    library.rename(kept)
    say(
        console,
        f"tasks taught on the page before are in {kept}; use --model {kept / LIBRARY_MODEL}",
    )


@contextmanager
def watched_graph(
    args: argparse.Namespace,
    console: Console,
    make_observer: Callable[..., Any],
    *,
    simulated_time: bool = True,
) -> Iterator[tuple[Any, NodeWatch]]:
    """Context with an observer node in the session's ROS domain; ends the nodes started in it.

    Meanwhile signals are only noted, and errors that nodes report are printed.
    """
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.parameter import Parameter

    from intent_recognition.nodes.diagnostics import UNANSWERED, Level, values_of
    from intent_recognition.nodes.processes import NodeProcesses, node_environment
    from intent_recognition.nodes.runtime import spinning

    environment = node_environment(os.environ, _domain())
    environment.setdefault(TOKEN_VARIABLE, random_token())
    os.environ.update(environment)
    heartbeats = Heartbeats()

    def make_node() -> Any:
        node = make_observer(parameter_overrides=[Parameter("use_sim_time", value=simulated_time)])
        node.create_subscription(DiagnosticArray, "/diagnostics", hear, 10)
        return node

    def hear(message: DiagnosticArray) -> None:
        for status in message.status:
            heartbeats.hear(status.name, values_of(status).get(UNANSWERED, ""))
            if heartbeats.begins_to_fail(status.name, status.level == bytes([Level.ERROR])):
                say(console, f"{status.name}: {status.message}")

    with (
        noted_interrupts() as interrupts,
        NodeProcesses(environment, args.output / "logs") as processes,
        spinning(make_node) as (observer, executor),
    ):
        yield observer, NodeWatch(processes, executor, heartbeats, interrupts)


def _run_graph(
    args: argparse.Namespace,
    calls: dict[str, NodeCall],
    model: Path,
    scene: Scene,
    console: Console,
) -> tuple[dict[str, "SessionLog"], dict[str, object]]:
    """Run the nodes through one session; return each worker's log and the pace of time in words."""
    from intent_recognition.nodes.session_observer import SessionObserver

    people = [person for person in scene.plans if person]
    progress = ProgressLine(sum(len(p.interactions) for p in scene.plans.values()), console)
    make_observer = partial(SessionObserver, progress.on_task, progress.on_active, people=people)
    with watched_graph(args, console, make_observer) as (observer, watch):
        refuse_busy_domain(observer, watch)
        if args.dashboard:
            begin_library(args.output / LIBRARY, model, console)
        _start_nodes(args, calls, observer, watch)
        console.print("the nodes have found each other; the session begins")
        if args.dashboard:
            watch.until(lambda: answers(page_address(args)), START_S, "the page")
            say(console, f"the page is at {page_address(args)}")
        pace = _follow(args, observer, progress, watch)
        logs = {person: observer.log(person) for person in scene.plans}
        if args.dashboard:
            observer.close()
            say(console, f"the session is over; the page stays open at {page_address(args)}")
            say(console, "teach a task there, or end it with Ctrl-C: the table of results follows")
            watch.until_interrupted()
        console.print(f"simulated time ran at {pace:.2f} x real time")
        if unanswered := watch.heartbeats.unanswered:
            say(console, f"{unanswered} did not answer for 10 s; simulated time went on")
        return logs, {
            "simulated time per real time": round(pace, 2),
            "nodes that did not answer for 10 s": unanswered or "none",
        }


def _start_nodes(
    args: argparse.Namespace,
    calls: dict[str, NodeCall],
    observer: "SessionObserver",
    watch: NodeWatch,
) -> None:
    """Start all nodes; start the coworker last, when the others have discovered one another."""
    coworker = calls.pop(COWORKER)
    for call in calls.values():
        watch.processes.start(call.name, call.module, call.parameters, params_file=args.params)
    watch.until(observer.graph_is_complete, START_S, "the node graph")
    n_listeners = 2 + bool(args.record) + ("object_transfer" in calls)  # the arm listens, too
    listeners = {"exit_at_end": True, "wait_for_subscribers": n_listeners}
    watch.processes.start(coworker.name, coworker.module, coworker.parameters | listeners)


def _follow(
    args: argparse.Namespace, observer: "SessionObserver", progress: ProgressLine, watch: NodeWatch
) -> float:
    """Show the session until the last motion ends; return simulated seconds per real second."""
    start_s = 120.0
    longest_s = start_s + 300.0 * progress.total  # at the slowest pace
    began_s, began_ns = time.monotonic(), observer.get_clock().now().nanoseconds
    with progress.shown():
        watch.until(lambda: not watch.processes.running(COWORKER), longest_s, "the session's end")
        over_ns = observer.get_clock().now().nanoseconds + 3_000_000_000
        watch.until(
            lambda: observer.get_clock().now().nanoseconds >= over_ns,
            start_s,
            "the end of the last motion",
        )
    simulated_s = (observer.get_clock().now().nanoseconds - began_ns) * 1e-9
    return simulated_s / (time.monotonic() - began_s)


def _calls(args: argparse.Namespace, model: Path, scene: Scene) -> dict[str, NodeCall]:
    """The nodes to start, by name."""
    if args.record and args.record.exists():
        cure = "Name another."
        raise ResourceBusyError.about("--record", "a folder that does not exist", args.record, cure)
    given = {
        **shared_arguments(args, model),
        **scene.arguments,
        "rate": float(args.rate),
        "sensor_noise": True,
        "transition_prior": not args.no_anticipation,
        "pretrigger_threshold": 0.0 if args.no_anticipation else 0.7,  # docs/recognition.md
        "record": str(args.record.resolve()) if args.record else "",
    }
    waits = {arm: {**waits_for_answers(), **scene.own.get(arm, {})} for arm in ARMS}
    return {call.name: call for call in resolve(scene.graph, given, {**scene.own, **waits})}


def waits_for_answers(person: bool = True) -> dict[str, object]:
    """Parameter that makes the arm's clock wait for all that answer; it begins with a `person`."""
    from sim_bridge.arm import ANSWERING

    return {"wait_for_answers": [name for name in ANSWERING if person or name != COWORKER]}


def shared_arguments(args: argparse.Namespace, model: Path) -> dict[str, object]:
    """Arguments of every graph with an estimator that the demo starts."""
    return {
        "model": str(model.resolve()),
        "headless": args.headless or not os.environ.get("DISPLAY"),
        "seed": args.seed,
        "sequences": str(args.sequences.resolve()) if args.sequences else "",
        "dashboard": args.dashboard,
        "port": args.port,
        "library": str((args.output / LIBRARY).resolve()),
        "models": str(args.output.resolve()),
    }


def page_address(args: argparse.Namespace) -> str:
    """Address of the page, with its token."""
    return f"http://127.0.0.1:{args.port}/?token={os.environ[TOKEN_VARIABLE]}"


def refuse_busy_domain(observer: "Node", watch: NodeWatch) -> None:
    """Require that the domain holds no node of the demo and no publisher of its topics."""
    watch.for_seconds(0.5)
    taken = sorted(set(observer.get_node_names()) & set(GRAPHS["demo"].nodes))
    own = ("mocap/wrist/pose", "joint_states", "/clock")  # topics that nobody else may publish
    published = [topic for topic in own if observer.count_publishers(topic)]
    taken += [f"publishers of {topic}" for topic in published]
    if taken:
        raise ResourceBusyError.about(
            f"ROS_DOMAIN_ID {os.environ['ROS_DOMAIN_ID']}",
            "no other graph in it",
            ", ".join(taken),
            "Stop them, or choose another ROS_DOMAIN_ID.",
        )


def _domain() -> int:
    """The user's ROS_DOMAIN_ID, or else one that depends on this process."""
    chosen = os.environ.get("ROS_DOMAIN_ID")
    if not chosen:
        return DOMAINS[0] + os.getpid() % (DOMAINS[1] - DOMAINS[0] + 1)
    if not chosen.isdigit() or int(chosen) > DOMAINS[1]:
        cure = "Set it, or unset it."
        raise IntentError.about("ROS_DOMAIN_ID", "a number from 0 to 101", chosen, cure)
    return int(chosen)
