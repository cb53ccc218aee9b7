# SPDX-License-Identifier: Apache-2.0
"""A session of the demo: its nodes as processes, watched from the terminal until the end."""

import argparse
import os
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Console

from intent_recognition.errors import IntentError, ResourceBusyError, describe
from intent_recognition.nodes.graph import GRAPHS, NodeCall, resolve

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from intent_recognition.evaluation import SessionLog
    from intent_recognition.nodes.processes import NodeProcesses
    from intent_recognition.nodes.session_observer import SessionObserver
    from sim_bridge.coworker import SessionPlan

COWORKER = "coworker_sim"
DISCOVERY_S = 0.5
"""Time to find other graphs in the domain [s]. Convention."""
GRAPH_DEADLINE_S = 30.0
"""Longest wait until the nodes have found one another [s]. Convention."""
START_S, LONGEST_INTERACTION_S = 120.0, 150.0
"""Longest session [s]: its start, and each interaction at the slowest pace. Convention."""
LAST_MOTION_S = 3.0
"""Simulated time after the session in which the arm ends its last motion [s]. Convention."""
PRETRIGGER_THRESHOLD = 0.7
"""Probability of the next task from which on the arm goes ahead (docs/recognition.md)."""
SLICE_S = 0.1
"""Longest wait for a callback between two looks at nodes and signals [s]. Convention."""
PACE_PERIOD_S = 0.2
"""Time between two looks at the lag [s]. Convention."""
DOMAINS = (1, 101)
"""ROS domains whose ports lie below the ephemeral ports of Linux (ROS 2 documentation, "The
ROS_DOMAIN_ID")."""
END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Session(NamedTuple):
    """A session that is over: what was observed, the truth, the stamp of the first sample."""

    log: "SessionLog"
    plan: "SessionPlan"
    first_ns: int


def run_session(args: argparse.Namespace, model: Path, console: Console) -> Session:
    """Start the nodes, follow the session, stop the nodes.

    Args:
        args: the options of `intent demo`.
        model: model file of the estimator.
        console: where the progress is shown.

    Raises:
        IntentError: a node died, or nothing was received from one.
        KeyboardInterrupt: interrupted; all nodes are stopped by then.
    """
    import rclpy

    from intent_recognition.experiments.toolbox.session_scoring import first_sample_ns
    from intent_recognition.nodes.processes import NodeProcesses, node_environment
    from sim_bridge.coworker import parse_task_list, plan_session

    tasks = parse_task_list(args.task_list, args.seed, args.interactions)
    plan = plan_session(args.seed, tasks)
    environment = node_environment(os.environ, _domain())
    os.environ.update(environment)
    rclpy.init(args=[], signal_handler_options=rclpy.SignalHandlerOptions.NO)
    try:
        with NodeProcesses(environment, args.output / "logs") as processes:
            log = _run_graph(args, _calls(args, model, tasks), len(tasks), processes, console)
    finally:
        for number in END_SIGNALS:
            signal.signal(number, interrupt)
        rclpy.try_shutdown()
    first_ns = first_sample_ns(log, plan)
    if first_ns is None:
        raise IntentError(
            describe("mocap/wrist/pose", "the coworker's poses", "none", "See the nodes' logs.")
        )
    return Session(log, plan, first_ns)


def _run_graph(
    args: argparse.Namespace,
    calls: dict[str, NodeCall],
    n_tasks: int,
    processes: "NodeProcesses",
    console: Console,
) -> "SessionLog":
    """Run the nodes through one session; returns what was observed."""
    from rclpy.parameter import Parameter

    from intent_recognition.nodes.runtime import make_executor
    from intent_recognition.nodes.session_observer import SessionObserver

    progress = _ProgressLine(n_tasks, console)
    simulated_time = [Parameter("use_sim_time", value=True)]
    observer = SessionObserver(
        progress.on_task, progress.on_active, parameter_overrides=simulated_time
    )
    executor = make_executor()
    executor.add_node(observer)
    watch = _NodeWatch(processes, executor)
    try:
        _refuse_busy_domain(observer, watch)
        _start_nodes(args, calls, observer, watch)
        console.print(f"the nodes found one another; {n_tasks} interactions begin", highlight=False)
        if args.dashboard:
            console.print(f"the page is at {_page(args)}", highlight=False)
        slowest = _follow(args, observer, progress, watch)
        log = observer.log()
        if args.dashboard:
            observer.close()
            console.print(
                f"the session is over; the page stays open at {_page(args)}:"
                " teach a task there, or end with Ctrl-C",
                highlight=False,
            )
            watch.until_interrupted()
        if slowest < args.rate:
            console.print(
                f"the machine was busy: simulated time ran down to {slowest:.2f} x real time",
                style="yellow",
                highlight=False,
            )
        return log
    finally:
        executor.shutdown()
        observer.destroy_node()


def _start_nodes(
    args: argparse.Namespace,
    calls: dict[str, NodeCall],
    observer: "SessionObserver",
    watch: "_NodeWatch",
) -> None:
    """Start all nodes; the coworker last, when the others have found one another."""
    coworker = calls.pop(COWORKER)
    for call in calls.values():
        watch.processes.start(call.name, call.module, call.parameters)
    watch.until(observer.graph_is_complete, GRAPH_DEADLINE_S, "the node graph")
    listeners = {"exit_at_end": True, "wait_for_subscribers": 3 if args.record else 2}
    watch.processes.start(coworker.name, coworker.module, coworker.parameters | listeners)


def _follow(
    args: argparse.Namespace,
    observer: "SessionObserver",
    progress: "_ProgressLine",
    watch: "_NodeWatch",
) -> float:
    """Show the session until the last motion is over; returns the slowest pace of its time."""
    from rclpy.clock import Clock, ClockType

    from intent_recognition.nodes.pace_keeper import PaceKeeper

    pace = PaceKeeper(observer, args.rate)

    def keep_pace() -> None:
        if not progress.over:
            pace.update(observer.lag_s())

    timer = observer.create_timer(
        PACE_PERIOD_S, keep_pace, clock=Clock(clock_type=ClockType.STEADY_TIME)
    )
    longest_s = START_S + LONGEST_INTERACTION_S * progress.total
    with progress:
        watch.until(lambda: not watch.processes.running(COWORKER), longest_s, "the session's end")
        watch.for_seconds(LAST_MOTION_S / args.rate)
    timer.cancel()
    return pace.slowest


class _NodeWatch:
    """Runs the callbacks of this process while the nodes run.

    A callback must not be interrupted halfway: from here on a signal is noted, and ends what is
    waited for after the callback under way.
    """

    def __init__(self, processes: "NodeProcesses", executor: "Executor") -> None:
        self.processes = processes
        self._executor = executor
        self._interrupted = False
        for number in END_SIGNALS:
            signal.signal(number, self._note)

    def until(self, condition: Callable[[], bool], deadline_s: float, what: str) -> None:
        """Wait until a condition holds.

        Raises:
            IntentError: a node died, or the deadline is over.
            KeyboardInterrupt: a signal came.
        """
        end_s = time.monotonic() + deadline_s
        while not condition():
            if time.monotonic() > end_s:
                raise IntentError(
                    describe(what, f"within {deadline_s:.0f} s", "nothing", "See the nodes' logs.")
                )
            self._step()

    def for_seconds(self, seconds: float) -> None:
        """Wait for a time; raises as `until`."""
        end_s = time.monotonic() + seconds
        while time.monotonic() <= end_s:
            self._step()

    def until_interrupted(self) -> None:
        """Wait for a signal.

        Raises:
            IntentError: a node died.
        """
        with suppress(KeyboardInterrupt):
            while True:
                self._step()

    def _step(self) -> None:
        if self._interrupted:
            self._interrupted = False
            raise KeyboardInterrupt
        self.processes.check(may_end=(COWORKER,))
        self._executor.spin_once(timeout_sec=SLICE_S)

    def _note(self, number: int, frame: object) -> None:
        self._interrupted = True


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


def _page(args: argparse.Namespace) -> str:
    return f"http://127.0.0.1:{args.port}"


def _refuse_busy_domain(observer: "SessionObserver", watch: _NodeWatch) -> None:
    """Make sure that no other graph with such nodes is in this domain."""
    watch.for_seconds(DISCOVERY_S)
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


class _ProgressLine:
    """One line with the progress of the session."""

    def __init__(self, total: int, console: Console):
        self.total = total
        self._number, self._truth, self._active, self._right = 0, "", "", 0
        self._status = console.status("waiting for the coworker")

    def __enter__(self) -> "_ProgressLine":
        self._status.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._status.stop()

    @property
    def over(self) -> bool:
        """Whether the last movement of the session has ended."""
        return self._number == self.total and not self._truth

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
            f"interaction {self._number}/{self.total}, {self._right} right so far;"
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
