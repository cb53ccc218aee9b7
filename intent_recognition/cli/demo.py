# SPDX-License-Identifier: Apache-2.0
"""`intent demo`: learn from the shipped bags, then help a simulated coworker through a session."""

import argparse
import signal
import socket
import time
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from intent_recognition.cli.console import busy
from intent_recognition.cli.demo_session import Session, run_session, session_tasks
from intent_recognition.cli.help import examples
from intent_recognition.cli.options import Subparsers, number
from intent_recognition.cli.output import (
    PRINTED,
    add_json_option,
    check_json,
    console_beside,
    write_json,
)
from intent_recognition.cli.session_watch import END_SIGNALS, interrupt
from intent_recognition.errors import (
    ArgumentError,
    IntentError,
    KinematicsError,
    ResourceBusyError,
    describe,
)
from intent_recognition.learning import TrainingSettings
from intent_recognition.model import load_model, load_trained, save_model

if TYPE_CHECKING:
    from sim_bridge.scenarios.toolbox import ToolboxArm

SCENARIOS = ("toolbox", "pouring")
DEFAULT_INTERACTIONS = 40
"""Interactions where the task list has no end. Convention."""
DEFAULT_RATE, DASHBOARD_RATE = 1.5, 1.0
"""Simulated seconds per real second, without and with a page to watch. Convention."""
DEFAULT_PORT = 8080
LAST_PORT = 65535
RATES = (0.01, 50.0)
"""Limits of `real_time_factor` of the simulated arm."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command to `intent`."""
    parser = subparsers.add_parser(
        "demo",
        help="the whole chain, with a simulated coworker and arm",
        description="Train on the shipped bags, start the nodes as separate processes, and let a"
        " simulated coworker assemble a toolbox with the arm's help. Needs ROS 2.",
        **examples(
            ("with a page to watch it, and to teach it tasks", "intent demo --dashboard"),
            ("a short one without a window", "intent demo --headless --interactions 5 --seed 2"),
            (
                "keep the session and its numbers",
                "intent demo --headless --record out/session --json out/numbers.json",
            ),
            (
                "the coworker changes his mind in ten of forty interactions",
                "intent demo --headless --changes 10",
            ),
            ("another arm does what the LWR was taught", "intent demo --arm panda"),
            ("the arm pours with other cups and bowls", "intent demo --scenario pouring"),
        ),
    )
    session = parser.add_argument_group("what happens")
    shown = parser.add_argument_group("what is shown")
    written = parser.add_argument_group("what is written")
    session.add_argument(
        "--scenario",
        choices=SCENARIOS,
        default="toolbox",
        help="what to do (default: toolbox); pouring: the arm pours with containers it was not"
        " taught with, --interactions times (default: 2), without ROS 2",
    )
    session.add_argument(
        "--task-list",
        default="habit",
        metavar="F",
        help="labels separated by commas, OLD>NEW@SHARE for a reach whose goal changes, a file of"
        " them, 'habit' (default: the order in which the coworker of the shipped sessions works,"
        " with variation) or 'random'",
    )
    session.add_argument(
        "--interactions",
        type=number(int, 1),
        default=0,
        metavar="N",
        help=f"how many (default: the list as it is; {DEFAULT_INTERACTIONS} when habit or random)",
    )
    session.add_argument(
        "--changes",
        type=number(int, 0),
        default=0,
        metavar="N",
        help="the coworker changes his mind on the way in N of the interactions (default: 0)",
    )
    session.add_argument(
        "--arm",
        default="lwr",
        metavar="ARM",
        help="lwr (default), panda, iiwa, xarm, or the path of a URDF; the others do with their"
        " hands what the LWR was taught",
    )
    session.add_argument(
        "--seed", type=number(int, 0), default=1, help="of the session (default: 1)"
    )
    session.add_argument(
        "--no-anticipation",
        action="store_true",
        help="expect every task alike: no transition prior, no pre-trigger",
    )
    shown.add_argument(
        "--dashboard",
        action="store_true",
        help="serve a page that shows the cell and teaches tasks; it stays until Ctrl-C",
    )
    shown.add_argument(
        "--port",
        type=number(int, 1, LAST_PORT),
        default=DEFAULT_PORT,
        help="of the page (default: %(default)s)",
    )
    shown.add_argument("--headless", action="store_true", help="no window of the physics")
    session.add_argument(
        "--rate",
        type=number(float, *RATES),
        metavar="X",
        help="simulated time per real time, through /clock (default: "
        f"{DEFAULT_RATE}, with --dashboard {DASHBOARD_RATE})",
    )
    session.add_argument("--model", type=Path, metavar="M.npz", help="use this model, do not train")
    written.add_argument(
        "--output",
        type=Path,
        default=Path("out/demo"),
        metavar="DIR",
        help="folder of model, report and logs (default: %(default)s)",
    )
    add_json_option(written, "all numbers")
    written.add_argument("--record", type=Path, metavar="BAG", help="record the session to a bag")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the demo; 1 if a node died or more than one interaction in forty was missed."""
    console = console_beside(args.json)
    check_json(args.json)
    if args.scenario == "pouring":
        from intent_recognition.cli.demo_pouring import run_pouring

        return run_pouring(args, console)
    try:
        import rclpy  # noqa: F401
    except ImportError as error:
        raise IntentError(
            describe("rclpy", "ROS 2 Jazzy", error, "Source it, or pip install .[ros].")
        ) from error
    for end_signal in END_SIGNALS:
        signal.signal(end_signal, interrupt)
    if args.rate is None:
        args.rate = DASHBOARD_RATE if args.dashboard else DEFAULT_RATE
    _check(args)
    arm = _toolbox_arm(args.arm)
    model = args.model or _train(args.output / "model.npz", console, of_hand=arm is not None)
    started = time.monotonic()
    session = run_session(args, model, console, arm)
    return _report(args, session, time.monotonic() - started, console, arm)


def _toolbox_arm(name: str) -> "ToolboxArm | None":
    """An arm other than the one that was taught; None for the LWR.

    Raises:
        IntentError: there is no such arm, or it cannot reach home.
    """
    if name == "lwr":
        return None
    from sim_bridge.arm import find_robot
    from sim_bridge.scenarios.toolbox import ToolboxArm

    arm = ToolboxArm(find_robot(name))
    try:
        _ = arm.home
    except KinematicsError as error:
        raise ArgumentError(f"--arm {name}: its hand does not reach home. {error}") from error
    return arm


def _check(args: argparse.Namespace) -> None:
    """Check before the training what would otherwise end the demo after it.

    Raises:
        IntentError: a task is unknown, the model cannot be used, or the page's port is taken.
    """
    session_tasks(args)
    try:
        args.output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResourceBusyError(
            describe("--output", "a folder that can be made", args.output, "Choose another.")
        ) from error
    if args.model is not None:
        (load_trained if args.dashboard else load_model)(args.model)
    if args.dashboard:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", args.port))
            except OSError as error:
                cure = "Choose another --port, or end the program that has it."
                raise ResourceBusyError(
                    describe("--port", "a free one", args.port, cure)
                ) from error


def _train(path: Path, console: Console, *, of_hand: bool) -> Path:
    from intent_recognition.cli.train import print_library, train
    from intent_recognition.cli.train_sessions import with_sessions
    from intent_recognition.share import share_path

    started = time.monotonic()
    bags = share_path("bags/toolbox/train")
    dofs = share_path("config/dofs_hand.yaml") if of_hand else None
    model, report = train([bags], dofs, TrainingSettings(), console)
    print_library(console, model.library, report)
    model = with_sessions(model, [share_path("bags/sessions")], console)
    save_model(path, model, report.trained)
    console.print(f"trained in {time.monotonic() - started:.1f} s", highlight=False)
    return path


def _report(
    args: argparse.Namespace,
    session: Session,
    wall_s: float,
    console: Console,
    arm: "ToolboxArm | None",
) -> int:
    """Score, print the table, write the report; returns the exit code."""
    from intent_recognition.evaluation import summarise, summary_line, to_json
    from intent_recognition.experiments.toolbox.session_scoring import score_session
    from intent_recognition.kinematics import hand_position
    from intent_recognition.report import table_lines, write_demo_report

    hand_of = hand_position if arm is None else arm.hand
    records, traces = score_session(*session, hand_of)
    summary = summarise(records)
    settings = {
        "arm": args.arm,
        "seed": args.seed,
        "simulated time per real time": args.rate,
        "duration of the session [s, simulated]": round(float(session.plan.samples.times_s[-1]), 1),
        "duration of the session [s, real]": round(wall_s, 1),
    }
    for line in table_lines(records) if args.json != PRINTED else ():
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    report = args.output / "report.html"
    with busy(console, "writing the report"):
        write_demo_report(report, records, summary, traces, settings)
    write_json(args.json, to_json(records, summary, settings))
    console.print(f"session of {wall_s:.0f} s, report: {report}", highlight=False, soft_wrap=True)
    console.file.write(summary_line(summary) + "\n")
    console.file.flush()
    return 1 if summary.too_many_missed else 0
