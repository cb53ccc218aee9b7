# SPDX-License-Identifier: Apache-2.0
"""One pour of the demo: its nodes as processes, watched on their topics until the arm is back."""

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from intent_recognition.cli.demo_session import PACE_PERIOD_S, ros_context
from intent_recognition.cli.session_watch import Heartbeats, NodeWatch
from intent_recognition.errors import IntentError
from intent_recognition.nodes.graph import resolve

if TYPE_CHECKING:
    from intent_recognition.nodes.pouring_observer import PouringObserver

READY_DEADLINE_S = 180.0
"""Longest wait until balls and containers are made, seen and warped [s]. Convention."""
ACTIVATION_DEADLINE_S = 60.0
"""Longest wait until the arm begins after it was asked [s]. Convention."""
POUR_DEADLINE_S = 600.0
"""Longest pour at the slowest pace [s]. Convention."""
LAST_WAIT_S = 1.0
"""Simulated time in which the last balls come to rest [s]. Convention."""


class ObservedPour(NamedTuple):
    """A pour as the topics told it: warped parameters by container, and counts of balls."""

    parameters: dict[str, dict[str, float]]
    balls: dict[str, int]


def observe_pour(
    args: argparse.Namespace, skill: Path, cup: str, second: str, stands_above_m: float
) -> ObservedPour:
    """Start the nodes of the graph "pouring", ask for a pour, wait until it is over.

    Args:
        args: the options of `intent demo`.
        skill: file of the learned skill.
        cup: name of the container in the hand.
        second: name of the other one.
        stands_above_m: how far above a lip the balls stand.

    Raises:
        IntentError: a node died, the pour was refused, or did not end.
        KeyboardInterrupt: interrupted; all nodes are stopped by then.
    """
    calls = resolve(
        "pouring",
        {
            "skill": str(skill.resolve()),
            "cup": cup,
            "second": second,
            "stands_above": stands_above_m,
            "rate": float(args.rate),
            "headless": args.headless or not os.environ.get("DISPLAY"),
            "sensor_noise": True,
            "seed": args.seed,
        },
    )
    with ros_context(args) as (processes, interrupts):
        from rclpy.parameter import Parameter

        from intent_recognition.nodes.pouring_observer import PouringObserver
        from intent_recognition.nodes.runtime import end, make_executor

        heartbeats = Heartbeats()
        simulated_time = [Parameter("use_sim_time", value=True)]
        observer = PouringObserver(heartbeats.hear, parameter_overrides=simulated_time)
        executor = make_executor()
        executor.add_node(observer)
        watch = NodeWatch(processes, executor, heartbeats, interrupts)
        try:
            for call in calls:
                processes.start(call.name, call.module, call.parameters, call.remappings)
            return _follow(args, observer, watch)
        finally:
            end(observer, executor)


def _follow(
    args: argparse.Namespace, observer: "PouringObserver", watch: NodeWatch
) -> ObservedPour:
    from rclpy.clock import Clock, ClockType

    from intent_recognition.nodes.pace_keeper import PaceKeeper

    pace = PaceKeeper(observer, args.rate)
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    timer = observer.create_timer(
        PACE_PERIOD_S, lambda: pace.update(observer.lag_s()), clock=steady
    )
    watch.until(observer.is_ready, READY_DEADLINE_S, "the containers, seen and warped")
    observer.ask(args.pour)
    watch.until(
        lambda: bool(observer.active or observer.refused), ACTIVATION_DEADLINE_S, "the pour"
    )
    if not observer.active:
        cure = "See the log of warped_primitive."
        raise IntentError.about("pour", "one that can be done", observer.refused, cure)
    watch.until(lambda: not observer.active, POUR_DEADLINE_S, "the pour's end")
    watch.for_seconds(LAST_WAIT_S / args.rate)
    timer.cancel()
    counts = {name: int(value) for name, value in observer.balls.items()}
    return ObservedPour(observer.parameters, counts)
