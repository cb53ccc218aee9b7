# SPDX-License-Identifier: Apache-2.0
"""`intent demo --recordings`: an arm reacts to recorded people with a learned model."""

import argparse
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import cycle
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rich.console import Console

from intent_recognition.array_types import Floats
from intent_recognition.bags import cure_of
from intent_recognition.cli.console import boxed_table, say
from intent_recognition.cli.demo_scene import arm_file
from intent_recognition.cli.demo_session import (
    LIBRARY,
    begin_library,
    page_address,
    refuse_busy_domain,
    refuse_options,
    shared_arguments,
    watched_graph,
)
from intent_recognition.cli.output import table_console, write_json
from intent_recognition.cli.session_watch import PLAYER, START_S, NodeWatch
from intent_recognition.dashboard.admission import answers
from intent_recognition.demonstrations import find_bags, is_raw_pose, read_demonstrations
from intent_recognition.errors import ArgumentError, BagError, DofError
from intent_recognition.model import Model, frames_of, load_model
from intent_recognition.motion import is_hand
from intent_recognition.nodes.graph import ARMS, RECOGNITION, NodeCall, resolve
from intent_recognition.recognition import start_mean
from intent_recognition.signals import Demonstration

if TYPE_CHECKING:
    from intent_recognition.nodes.demo_observers import RecordingObserver
    from sim_bridge.scenarios.toolbox import ToolboxArm

AFTER_S = 6.0
"""Longest motion of the arm after a recording [s]: a recording ends with the person's movement, and
the arm completes its own."""


class Shown(NamedTuple):
    """Reaction of the arm to one recording."""

    name: str  # name of the recording
    label: str  # label of the recording; empty if it has none
    task: str  # task that the arm acted on; empty for none
    after_s: float  # time of the action since the start of the recording [s]
    # distance between the hand's final positions, executed and demonstrated; NaN without an action
    off_cm: float


def run_recordings(args: argparse.Namespace, console: Console) -> int:
    """Play recordings to the nodes; 1 if fewer than half were recognised."""
    from intent_recognition.nodes.demo_observers import RecordingObserver

    _check(args)
    model = load_model(args.model)
    bags = find_bags(args.recordings)
    if not bags:
        cure = cure_of(args.recordings, "Check the path.")
        raise BagError.about("--recordings", "a bag", f"none in {args.recordings}", cure)
    arm, home = _arm(args, model)
    shown: list[Shown] = []
    make_observer = partial(RecordingObserver, model.dofs.observed[0], arm.robot.joint_names)
    with watched_graph(args, console, make_observer, simulated_time=False) as (observer, watch):
        refuse_busy_domain(observer, watch)
        if args.dashboard:
            begin_library(args.output / LIBRARY, args.model, console)
        for call in _calls(args, model, arm, home).values():
            watch.processes.start(call.name, call.module, call.parameters, params_file=args.params)
        started = {name for name in watch.processes.names if name not in ARMS}
        watch.until(lambda: started <= watch.heartbeats.names, START_S, "the nodes' reports")
        watch.until(
            lambda: bool(np.all(np.isfinite(observer.posture))), START_S, "the arm's joint states"
        )
        if args.dashboard:
            watch.until(lambda: answers(page_address(args)), START_S, "the page")
            say(console, f"the page is at {page_address(args)}")
            say(console, "the recordings repeat until Ctrl-C")
        with suppress(KeyboardInterrupt):
            for bag in cycle(bags) if args.dashboard else bags:
                say(console, f"playing {bag}")
                shown.append(_play(bag, model, arm, home, observer, watch))
    return _report(args, shown[-len(bags) :], console)


def _check(args: argparse.Namespace) -> None:
    """Refuse options that have no meaning here, before anything is started."""
    if args.model is None:
        cure = "intent train RECORDINGS --output M.npz makes one."
        raise ArgumentError.about("--model", "a model with --recordings", "none", cure)
    usual = {"scenario": "toolbox", "task_list": "habit", "interactions": 0, "changes": 0}
    usual |= {"rate": None, "record": None, "transfers": None}
    refuse_options(args, usual, "--recordings", "Leave it out.")


def _arm(args: argparse.Namespace, model: Model) -> "tuple[ToolboxArm, Floats]":
    """The arm, and the posture (n,) from which the tasks start [rad]."""
    from sim_bridge.arm import find_robot
    from sim_bridge.scenarios.toolbox import ToolboxArm

    robot = find_robot(args.arm, base=args.base, tip=args.tip)
    names = model.dofs.controlled_message_names
    library = model.library
    start = np.mean([start_mean(library, task) for task in range(library.n_tasks)], axis=0)
    if is_hand(names):
        arm = ToolboxArm(robot, start[:3])
        return arm, arm.home
    if set(names) != set(robot.joint_names):
        cure = "Name the --arm that was recorded, or learn its hand (docs: your own robot)."
        joints = ", ".join(robot.joint_names)
        raise DofError.about("--model", f"joints of {args.arm}: {joints}", ", ".join(names), cure)
    return ToolboxArm(robot), start[[names.index(name) for name in robot.joint_names]]


def _calls(
    args: argparse.Namespace, model: Model, arm: "ToolboxArm", home: Floats
) -> dict[str, NodeCall]:
    """The nodes to start, by name: those of the demo except its coworker."""
    robot, dofs = arm.robot, model.dofs
    hand = is_hand(dofs.controlled_message_names)
    tracked = [e.topic for e in (*dofs.observed, *dofs.velocities) if is_raw_pose(e.topic, e.type)]
    frames = {f for topic in tracked for f in frames_of(model.library).get(topic, ())}
    names = robot.joint_names if hand else dofs.controlled_message_names
    order = [robot.joint_names.index(name) for name in names]
    limits = {
        name: getattr(robot.limits, name)[order].tolist() for name in ("lower", "upper", "velocity")
    }
    own: dict[str, Mapping[str, object]] = {
        "primitive_activation": {"home": home[order].tolist(), "timeout": AFTER_S}
        | ({} if hand else limits),
        "mocap_ingest": {"world_frame": min(frames)} if len(frames) == 1 else {},
    }
    if dofs.extrinsics is not None:
        own["mocap_ingest"] = {"extrinsics": list(dofs.extrinsics)}
    arms = {"initial_position": home.tolist(), "tip": robot.tip}
    arms |= {"base_position": list(robot.base_position_m)} if args.arm != "lwr" else {}
    own |= dict.fromkeys(ARMS, arms)
    own["lwr_sim"] = {"initial_position": home.tolist()}
    given = shared_arguments(args, args.model) | {
        "arm": "" if args.arm == "lwr" else arm_file(args, robot),
        "hand_link": robot.tip if hand else "",
        "bodies": list(dict.fromkeys(topic.split("/")[-2] for topic in tracked)),
        "use_sim_time": False,
        "publish_clock": False,
        "coworker": False,
        "transfers": False,
    }
    calls = {call.name: call for call in resolve("demo", given, own)}
    if args.dashboard:
        del calls["dashboard"].parameters["scene"]  # it shows the toolbox
    return calls


def _play(
    bag: Path,
    model: Model,
    arm: "ToolboxArm",
    home: Floats,
    observer: "RecordingObserver",
    watch: NodeWatch,
) -> Shown:
    """Play the person's topics of a recording, and wait until the arm is back home."""
    dofs = model.dofs
    recorded, _ = read_demonstrations(bag, dofs)
    lasts_s = sum((one.end_ns - one.start_ns) * 1e-9 for one in recorded)
    observer.begin()
    values = {
        "bag": str(bag.resolve()),
        "topics": [e.topic for e in (*dofs.observed, *dofs.velocities, *dofs.context)],
        "restamp": True,
        "wait_for_nodes": list(RECOGNITION),
    }
    watch.processes.start(PLAYER, "intent_recognition.nodes.bag_player", values)
    watch.until(lambda: not watch.processes.running(PLAYER), START_S + lasts_s, "the recording")
    watch.until_or(lambda: not observer.active, AFTER_S)
    task, after_s, posture = observer.task, observer.acted_s, observer.held
    watch.until_or(lambda: bool(np.all(np.abs(observer.posture - home) < 0.05)), 20.0)
    label, off_cm = ", ".join(dict.fromkeys(one.task or "-" for one in recorded)), np.nan
    if posture is not None and len(recorded) == 1:
        off_cm = 100.0 * float(np.linalg.norm(arm.hand(posture) - _end(recorded[0], model, arm)))
    return Shown(bag.name, label, task, after_s, off_cm)


def _end(recorded: Demonstration, model: Model, arm: "ToolboxArm") -> Floats:
    """Final position of the demonstrated hand in a recording (3,) [m]."""
    names = model.dofs.controlled_message_names
    values = []
    for signal in recorded.controlled:
        last = signal.stamps_ns > signal.stamps_ns[-1] - 0.2 * 1e9
        values += signal.values[last].mean(axis=0).tolist()
    if is_hand(names):
        return np.array(values[:3])
    return arm.hand(np.array([values[names.index(name)] for name in arm.robot.joint_names]))


def _report(args: argparse.Namespace, shown: Sequence[Shown], console: Console) -> int:
    """Print the results; 1 if more than half were not recognised, or nothing was played."""
    if not shown:
        write_json(args.json, [])
        return int(not args.dashboard)
    table = boxed_table(
        "what the arm did", "recording", "labelled", "acted on", ">after [s]", ">hand off by [cm]"
    )
    for one in shown:
        numbers = [
            f"{x:.{n}f}" if np.isfinite(x) else "-" for x, n in ((one.after_s, 2), (one.off_cm, 1))
        ]
        table.add_row(one.name, one.label, one.task or "-", *numbers)
    table_console(args).print(table)
    write_json(args.json, [one._asdict() for one in shown])
    right = sum(bool(one.task) and one.task == one.label for one in shown)
    off = [one.off_cm for one in shown if np.isfinite(one.off_cm)]
    if right < len(shown):
        say(console, "a busy machine may be too slow for real time; to evaluate without it:")
        say(console, f"  intent rehearse {quote(str(args.model))} {quote(str(args.recordings))}")
    by_hand = f", hand off by {np.mean(off):.1f} cm on average" if off else ""
    say(console, f"acted on as labelled {right}/{len(shown)}{by_hand}")
    return 1 if 2 * right < len(shown) else 0
