# SPDX-License-Identifier: Apache-2.0
"""`intent demo`: learn from the shipped bags, then help a simulated coworker through a session."""

import argparse
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console

from intent_recognition.cli.console import make_console
from intent_recognition.errors import IntentError, ResourceBusyError, describe
from intent_recognition.promp.training import TrainingSettings
from intent_recognition.storage.model import load_model, save_model

SCENARIOS = ("toolbox",)
DEFAULT_INTERACTIONS = 40
DEFAULT_RATE = 1.5
GRAPH_DEADLINE_S = 30.0
LAST_MOTION_S = 3.0
SLICE_S = 0.1
PACE_PERIOD_S = 0.2
DOMAINS = (1, 101)
NODES = {
    "lwr_sim": "sim_bridge.nodes.lwr_sim",
    "mocap_ingest": "intent_recognition.nodes.mocap_ingest",
    "intent_estimator": "intent_recognition.nodes.intent_estimator",
    "primitive_activation": "intent_recognition.nodes.primitive_activation",
    "coworker_sim": "sim_bridge.nodes.coworker_sim",
    "bag_recorder": "intent_recognition.nodes.bag_recorder",
}
RECORDED = (
    "mocap/wrist/pose",
    "joint_states",
    "intent/tasks",
    "intent/robot_trajectory",
    "intent/active_task",
    "joint_trajectory",
    "coworker/task",
)


def add_parser(subparsers) -> None:
    """Add the command to `intent`."""
    parser = subparsers.add_parser(
        "demo",
        help="the whole chain, with a simulated coworker and arm",
        description="Train on the shipped bags, start the nodes as separate processes, and let a"
        " simulated coworker assemble a toolbox with the arm's help. Needs ROS 2.",
    )
    parser.add_argument("--scenario", choices=SCENARIOS, default="toolbox")
    parser.add_argument(
        "--task-list",
        default="random",
        metavar="F",
        help="labels separated by commas, a file of them, or 'random' (default)",
    )
    parser.add_argument(
        "--interactions",
        type=_positive,
        default=0,
        metavar="N",
        help=f"how many (default: the list as it is; {DEFAULT_INTERACTIONS} when random)",
    )
    parser.add_argument("--seed", type=_natural, default=1, help="of the session (default: 1)")
    parser.add_argument("--headless", action="store_true", help="no window of the physics")
    parser.add_argument(
        "--rate",
        type=float,
        default=DEFAULT_RATE,
        metavar="X",
        help="simulated time per real time, through /clock (default: %(default)s)",
    )
    parser.add_argument("--model", type=Path, metavar="M.npz", help="use this model, do not train")
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("out/demo"),
        metavar="DIR",
        help="folder of model, report and logs (default: %(default)s)",
    )
    parser.add_argument("--json", type=Path, metavar="OUT", help="write all numbers as JSON")
    parser.add_argument("--record", type=Path, metavar="BAG", help="record the session to a bag")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the demo; 1 if a node died or more than one interaction in forty was missed."""
    console = make_console()
    try:
        import rclpy  # noqa: F401
    except ImportError as error:
        raise IntentError(
            describe("rclpy", "ROS 2 Jazzy", error, "Source it, or pip install .[ros].")
        ) from error
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)
    args.output.mkdir(parents=True, exist_ok=True)
    if args.model is not None:
        load_model(args.model)
    model = args.model or _train(args.output / "model.npz", console)
    started = time.monotonic()
    log, plan, first_ns = _session(args, model, console)
    return _report(args, log, plan, first_ns, time.monotonic() - started, console)


def _train(path: Path, console: Console) -> Path:
    from intent_recognition.cli.train import print_library, train
    from intent_recognition.share import share_path

    started = time.monotonic()
    bags = share_path("bags/toolbox/train")
    model, report = train([bags], None, TrainingSettings(), console)
    save_model(path, model)
    print_library(console, model.library, report)
    console.print(f"trained in {time.monotonic() - started:.1f} s", highlight=False)
    return path


def _session(args: argparse.Namespace, model: Path, console: Console):
    """Start the nodes, watch the session, stop the nodes; returns its log and ground truth."""
    import rclpy

    from intent_recognition.cli.processes import NodeProcesses
    from intent_recognition.experiments.toolbox import first_sample_ns
    from intent_recognition.share import node_environment
    from sim_bridge.coworker import parse_task_list, plan_session

    tasks = parse_task_list(args.task_list, args.seed, args.interactions)
    plan = plan_session(args.seed, tasks)
    environment = node_environment(os.environ, _domain())
    os.environ.update(environment)
    rclpy.init(args=[], signal_handler_options=rclpy.SignalHandlerOptions.NO)
    try:
        with NodeProcesses(environment, args.output / "logs") as processes:
            log = _watch(args, model, tasks, processes, console)
    finally:
        rclpy.try_shutdown()
    first_ns = first_sample_ns(log, plan)
    if first_ns is None:
        raise IntentError(
            describe("mocap/wrist/pose", "the coworker's poses", "none", "See the nodes' logs.")
        )
    return log, plan, first_ns


def _watch(args, model: Path, tasks: Sequence[str], processes, console: Console):
    """Start all nodes, wait until they know one another, then let the human begin."""
    from rclpy.parameter import Parameter

    from intent_recognition.nodes.pace_keeper import PaceKeeper
    from intent_recognition.nodes.runtime import make_executor
    from intent_recognition.nodes.session_observer import SessionObserver

    progress = _Progress(len(tasks), console)
    observer = SessionObserver(
        progress.on_task,
        progress.on_active,
        parameter_overrides=[Parameter("use_sim_time", value=True)],
    )
    executor = make_executor()
    executor.add_node(observer)

    pace = PaceKeeper(observer, args.rate)
    looked = time.monotonic()

    def keep_pace() -> None:
        nonlocal looked
        if time.monotonic() - looked > PACE_PERIOD_S:
            looked = time.monotonic()
            pace.update(observer.lag_s())

    def spin_until(condition: Callable[[], bool], deadline_s: float, what: str) -> None:
        end = time.monotonic() + deadline_s
        while not condition():
            processes.check(may_end=("coworker_sim",))
            if time.monotonic() > end:
                raise IntentError(
                    describe(what, f"within {deadline_s:.0f} s", "nothing", "See the nodes' logs.")
                )
            executor.spin_once(timeout_sec=SLICE_S)
            keep_pace()

    try:
        _refuse_busy_domain(observer, executor)
        _start_nodes(args, model, processes)
        spin_until(observer.graph_is_complete, GRAPH_DEADLINE_S, "the node graph")
        parameters = {
            "use_sim_time": True,
            "task_list": ",".join(tasks),
            "seed": args.seed,
            "exit_at_end": True,
            "wait_for_subscribers": 3 if args.record else 2,
        }
        processes.start("coworker_sim", NODES["coworker_sim"], parameters)
        console.print(
            f"the nodes found one another; {len(tasks)} interactions begin", highlight=False
        )
        longest = 120.0 + 150.0 * len(tasks)
        with progress:
            spin_until(lambda: not processes.running("coworker_sim"), longest, "the session's end")
            end = time.monotonic() + LAST_MOTION_S / args.rate
            while time.monotonic() < end:
                executor.spin_once(timeout_sec=SLICE_S)
        processes.check(may_end=("coworker_sim",))
        if pace.slowest < args.rate:
            console.print(
                f"the machine was busy: simulated time ran down to {pace.slowest:.2f} x real time",
                style="yellow",
                highlight=False,
            )
        return observer.log()
    finally:
        executor.shutdown()
        observer.destroy_node()


def _start_nodes(args: argparse.Namespace, model: Path, processes) -> None:
    from sim_bridge.scene import HOME

    sim = {"use_sim_time": True}
    parameters = {
        "lwr_sim": {
            "publish_clock": True,
            "real_time_factor": float(args.rate),
            "headless": args.headless or not os.environ.get("DISPLAY"),
            "sensor_noise": True,
            "seed": args.seed,
        },
        "mocap_ingest": sim,
        "intent_estimator": sim | {"model": model.resolve()},
        "primitive_activation": sim | {"model": model.resolve(), "home": HOME.tolist()},
    }
    if args.record:
        if args.record.exists():
            raise ResourceBusyError(
                describe("--record", "a folder that does not exist", args.record, "Name another.")
            )
        parameters["bag_recorder"] = sim | {
            "output": args.record.resolve(),
            "topics": list(RECORDED),
        }
    for name, values in parameters.items():
        processes.start(name, NODES[name], values)


def _refuse_busy_domain(observer, executor) -> None:
    """Make sure that no other graph with such nodes is in this domain."""
    end = time.monotonic() + 0.5
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=SLICE_S)
    taken = sorted(set(observer.get_node_names()) & set(NODES))
    if taken:
        raise ResourceBusyError(
            describe(
                f"ROS_DOMAIN_ID {os.environ['ROS_DOMAIN_ID']}",
                "no other graph in it",
                ", ".join(taken),
                "Stop those nodes, or choose another ROS_DOMAIN_ID.",
            )
        )


def _report(args, log, plan, first_ns: int, wall_s: float, console: Console) -> int:
    """Score, print the table, write the report; returns the exit code."""
    from intent_recognition.experiments.toolbox import score_session
    from intent_recognition.report.demo_report import write_demo_report
    from intent_recognition.report.interaction_table import table_lines
    from intent_recognition.report.summary import summarise, summary_line, to_json

    records, traces = score_session(log, plan, first_ns)
    summary = summarise(records)
    settings = {
        "seed": args.seed,
        "simulated time per real time": args.rate,
        "duration of the session [s, simulated]": round(float(plan.samples.times_s[-1]), 1),
        "duration of the session [s, real]": round(wall_s, 1),
    }
    for line in table_lines(records):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    report = args.output / "report.html"
    write_demo_report(report, records, summary, traces, settings)
    if args.json:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        content = to_json(records, summary, settings)
        args.json.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    console.print(f"session of {wall_s:.0f} s, report: {report}", highlight=False, soft_wrap=True)
    sys.stdout.write(summary_line(summary) + "\n")
    sys.stdout.flush()
    return 1 if summary.too_many_missed else 0


class _Progress:
    """One line that says where the session is."""

    def __init__(self, total: int, console: Console):
        self._total, self._console = total, console
        self._number, self._truth, self._active, self._right = 0, "", "", 0
        self._status = console.status("waiting for the coworker")

    def __enter__(self) -> "_Progress":
        self._status.__enter__()
        return self

    def __exit__(self, *details: object) -> None:
        self._status.__exit__(*details)

    def on_task(self, label: str) -> None:
        """Take note of the ground truth: a movement began, or ended."""
        if label:
            self._number, self._truth, self._active = self._number + 1, label, ""
        elif self._truth:
            self._right += self._active == self._truth
            self._truth = ""
        self._show()

    def on_active(self, label: str) -> None:
        """Take note of the active task."""
        self._active = self._active or label
        self._show()

    def _show(self) -> None:
        truth = self._truth or "-"
        self._status.update(
            f"interaction {self._number}/{self._total}, {self._right} right so far;"
            f" human: {truth}, robot: {self._active or '-'}"
        )


def _domain() -> int:
    """The user's ROS_DOMAIN_ID, or one of this process's own.

    Raises:
        IntentError: ROS_DOMAIN_ID is no domain.
    """
    chosen = os.environ.get("ROS_DOMAIN_ID")
    if chosen is None:
        return DOMAINS[0] + os.getpid() % (DOMAINS[1] - DOMAINS[0] + 1)
    if not chosen.isdigit() or int(chosen) > DOMAINS[1]:
        raise IntentError(
            describe("ROS_DOMAIN_ID", "a number from 0 to 101", chosen, "Set it, or unset it.")
        )
    return int(chosen)


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def _positive(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected 1 or more, got {value}")
    return value


def _natural(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"expected 0 or more, got {value}")
    return value
