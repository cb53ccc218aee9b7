# SPDX-License-Identifier: Apache-2.0
"""A session of the demo: its nodes as processes, watched from the terminal until the end."""

import argparse
import os
import signal
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from intent_recognition.errors import IntentError, ResourceBusyError, describe
from intent_recognition.nodes.graph import GRAPHS, NodeCall, resolve

GRAPH_DEADLINE_S = 30.0
LAST_MOTION_S = 3.0
PRETRIGGER_THRESHOLD = 0.7
SLICE_S = 0.1
PACE_PERIOD_S = 0.2
DOMAINS = (1, 101)
END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def run_session(args: argparse.Namespace, model: Path, console: Console):
    """Start the nodes, watch the session, stop the nodes.

    Args:
        args: the options of `intent demo`.
        model: model file of the estimator.
        console: where the progress is shown.

    Returns:
        The session's log, its ground truth and the stamp of its first sample.

    Raises:
        IntentError: a node died, or nothing was heard of one.
        KeyboardInterrupt: interrupted; all nodes are stopped by then.
    """
    import rclpy

    from intent_recognition.experiments.toolbox.session_scoring import first_sample_ns
    from intent_recognition.nodes.processes import NodeProcesses
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
        for number in END_SIGNALS:
            signal.signal(number, interrupt)
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
    # A callback must not be torn apart: from here on a signal ends the loop after the one in hand.
    interrupted: list[int] = []
    for number in END_SIGNALS:
        signal.signal(number, lambda number, frame: interrupted.append(number))
    observer = SessionObserver(
        progress.on_task,
        progress.on_active,
        parameter_overrides=[Parameter("use_sim_time", value=True)],
    )
    executor = make_executor()
    executor.add_node(observer)

    pace = PaceKeeper(observer, args.rate)
    looked = time.monotonic()

    def session_over() -> bool:
        nonlocal looked
        over = not processes.running("coworker_sim")
        if not progress.over and time.monotonic() - looked > PACE_PERIOD_S:
            looked = time.monotonic()
            pace.update(observer.lag_s())
        return over

    def spin_until(condition: Callable[[], bool], deadline_s: float, what: str) -> None:
        end = time.monotonic() + deadline_s
        while not condition():
            if interrupted:
                raise KeyboardInterrupt
            processes.check(may_end=("coworker_sim",))
            if time.monotonic() > end:
                raise IntentError(
                    describe(what, f"within {deadline_s:.0f} s", "nothing", "See the nodes' logs.")
                )
            executor.spin_once(timeout_sec=SLICE_S)

    try:
        _refuse_busy_domain(observer, executor)
        calls = _calls(args, model, tasks)
        coworker = calls.pop("coworker_sim")
        for call in calls.values():
            processes.start(call.name, call.module, call.parameters)
        spin_until(observer.graph_is_complete, GRAPH_DEADLINE_S, "the node graph")
        listeners = {"exit_at_end": True, "wait_for_subscribers": 3 if args.record else 2}
        processes.start(coworker.name, coworker.module, coworker.parameters | listeners)
        console.print(
            f"the nodes found one another; {len(tasks)} interactions begin", highlight=False
        )
        if args.dashboard:
            console.print(f"the page is at http://127.0.0.1:{args.port}", highlight=False)
        longest = 120.0 + 150.0 * len(tasks)
        with progress:
            spin_until(session_over, longest, "the session's end")
            end = time.monotonic() + LAST_MOTION_S / args.rate
            spin_until(lambda: time.monotonic() > end, 2 * LAST_MOTION_S / args.rate, "the end")
        processes.check(may_end=("coworker_sim",))
        log = observer.log()
        if args.dashboard:
            observer.close()
            _leave_open(args, console, executor, interrupted, processes)
        if pace.slowest < args.rate:
            console.print(
                f"the machine was busy: simulated time ran down to {pace.slowest:.2f} x real time",
                style="yellow",
                highlight=False,
            )
        return log
    finally:
        executor.shutdown()
        observer.destroy_node()


def _leave_open(args, console: Console, executor, interrupted: list[int], processes) -> None:
    """Let the page and the graph go on until a signal comes."""
    console.print(
        f"the session is over; the page stays open at http://127.0.0.1:{args.port}:"
        " teach a task there, or end with Ctrl-C",
        highlight=False,
    )
    while not interrupted:
        processes.check(may_end=("coworker_sim",))
        executor.spin_once(timeout_sec=SLICE_S)
    interrupted.clear()


def _calls(args: argparse.Namespace, model: Path, tasks: Sequence[str]) -> dict[str, NodeCall]:
    """The nodes to start, by name.

    Raises:
        ResourceBusyError: the folder to record to exists.
    """
    from sim_bridge.scenarios.toolbox import HOME

    if args.record and args.record.exists():
        raise ResourceBusyError(
            describe("--record", "a folder that does not exist", args.record, "Name another.")
        )
    calls = resolve(
        "demo",
        {
            "model": str(model.resolve()),
            "rate": float(args.rate),
            "headless": args.headless or not os.environ.get("DISPLAY"),
            "sensor_noise": True,
            "seed": args.seed,
            "task_list": ",".join(tasks),
            "transition_prior": not args.no_anticipation,
            "pretrigger_threshold": 0.0 if args.no_anticipation else PRETRIGGER_THRESHOLD,
            "record": str(args.record.resolve()) if args.record else "",
            "dashboard": args.dashboard,
            "port": args.port,
            "library": str((args.output / "tasks").resolve()),
            "models": str(args.output.resolve()),
        },
    )
    home = {"primitive_activation": {"home": HOME.tolist()}}
    return {
        call.name: replace(call, parameters=call.parameters | home.get(call.name, {}))
        for call in calls
    }


def _refuse_busy_domain(observer, executor) -> None:
    """Make sure that no other graph with such nodes is in this domain."""
    end = time.monotonic() + 0.5
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=SLICE_S)
    taken = sorted(set(observer.get_node_names()) & set(GRAPHS["demo"].nodes))
    if taken:
        raise ResourceBusyError(
            describe(
                f"ROS_DOMAIN_ID {os.environ['ROS_DOMAIN_ID']}",
                "no other graph in it",
                ", ".join(taken),
                "Stop those nodes, or choose another ROS_DOMAIN_ID.",
            )
        )


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

    @property
    def over(self) -> bool:
        """Whether the last movement of the session has ended."""
        return self._number == self._total and not self._truth

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


def interrupt(number: int, frame: object) -> None:
    """Turn a signal into a KeyboardInterrupt."""
    raise KeyboardInterrupt
