# SPDX-License-Identifier: Apache-2.0
"""Long simulated work, with nodes killed and started again: does the graph stay as it was?

`python -m benchmarks.soak MODEL MINUTES [SECONDS_BETWEEN_KILLS [RATE]]` runs any length.
"""

import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import cycle
from pathlib import Path
from statistics import median
from typing import NamedTuple

import rclpy
from rclpy.executors import Executor
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from benchmarks.measure import Result, at_least, at_most
from benchmarks.offline import model_file
from benchmarks.pace_keeper import PaceKeeper
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns
from intent_recognition.nodes.diagnostics import Readiness
from intent_recognition.nodes.graph import RECOGNITION, NodeCall, resolve
from intent_recognition.nodes.processes import NodeProcesses, node_environment
from intent_recognition.nodes.runtime import make_executor, spin_until
from intent_recognition.nodes.session_observer import SessionObserver
from intent_recognition.promp import TaskLibrary

RESPAWN_DELAY_S = 2.0
"""Time from a death to the next start [s], as in launch files (`launching.RESPAWN_DELAY_S`)."""
RATE = 3.0
"""Simulated seconds per real one that are asked for; less where the estimates fall behind."""
PACE_PERIOD_S, SAMPLE_PERIOD_S = 0.2, 5.0
WINDOW_S = 60.0
"""Time over which the usage of a process is summarised by its median [s]."""
READY_S = 120.0
"""Longest wait until the nodes are ready [s]."""
SHORTEST_INTERACTION_S = 5.0


class Usage(NamedTuple):
    """What a process uses at a time."""

    at_s: float
    memory_mb: float
    descriptors: int
    threads: int


@dataclass
class Soak:
    """What happened.

    Attributes:
        recognised: whether, of each interaction that began with all nodes ready and ended
            without a kill.
        disturbed: number of the others.
        recoveries_s: from each kill until all nodes were ready again [s].
        usage: samples of each process, by name and number of its start.
        simulated_s: length of the session in simulated time [s].
        died: nodes that ended by themselves.
    """

    recognised: list[bool] = field(default_factory=list)
    disturbed: int = 0
    recoveries_s: list[float] = field(default_factory=list)
    usage: dict[tuple[str, int], list[Usage]] = field(default_factory=dict)
    simulated_s: float = 0.0
    died: list[str] = field(default_factory=list)

    def growth(self, of: int) -> tuple[float, str]:
        """Largest growth of a process in the second half of its life, by medians; and whose.

        In the first half it grows to what it needs: the estimator's memory by 30 MB within its
        first 60 interactions, as the hypotheses of every kind are first used.
        """
        found = [(0.0, "")]
        for (name, start), samples in self.usage.items():
            begin_s, end_s = samples[0].at_s, samples[-1].at_s
            if end_s - begin_s >= 4.0 * WINDOW_S:
                middle_s = (begin_s + end_s) / 2.0
                first = [s[of] for s in samples if 0.0 <= s.at_s - middle_s <= WINDOW_S]
                last = [s[of] for s in samples if s.at_s >= end_s - WINDOW_S]
                whose = f"{name}, start {start}, over {end_s - middle_s:.0f} s"
                found.append((median(last) - median(first), whose))
        return max(found)


def soak(library: TaskLibrary, minutes: float, between_s: float = 100.0) -> Iterator[Result]:
    """Results of a run, with a node killed every so often [s]."""
    with model_file(library) as model:
        yield from results(run(model, minutes, between_s, model.parent / "logs"), minutes)


def results(found: Soak, minutes: float) -> Iterator[Result]:
    """What is required of it."""
    n = len(found.recognised)
    remark = (
        f"{sum(found.recognised)} of {n}, {found.disturbed} others were disturbed;"
        f" {found.simulated_s / 60:.0f} simulated minutes in {minutes:.0f}"
    )
    share = sum(found.recognised) / max(n, 1)
    yield at_least("soak: undisturbed interactions recognised", share, 1.0, "", remark)
    remark = f"{len(found.recoveries_s)} nodes killed, each active again by itself"
    slowest_s = max(found.recoveries_s, default=0.0)
    yield at_most("soak: from a kill to a ready graph", slowest_s, 30.0, "s", remark)
    for of, what, most, unit in (
        (1, "memory of a process", 5.0, "MB"),
        (2, "file descriptors", 0.0, ""),
        (3, "threads", 0.0, ""),
    ):
        grown, whose = found.growth(of)
        yield at_most(f"soak: {what} grew by", grown, most, unit, whose)
    remark = ", ".join(found.died)
    yield at_most("soak: nodes that died by themselves", len(found.died), 0.0, "", remark)


def run(model: Path, minutes: float, between_s: float, logs: Path, rate: float = RATE) -> Soak:
    """Let the simulated coworker work for so long, killing a node every `between_s` [s]."""
    environment = node_environment(os.environ)
    os.environ.update(environment)
    rclpy.init(args=[])
    interactions = int(minutes * 60.0 * rate / SHORTEST_INTERACTION_S) + 10
    given = {"model": str(model), "rate": rate, "transfers": False}
    calls = {call.name: call for call in resolve("demo", given)}
    calls["coworker_sim"].parameters.update(task_list="habit", interactions=interactions)
    executor = make_executor()
    watched = _Watched(Soak())
    override = [Parameter("use_sim_time", value=True)]
    observer = SessionObserver(watched.on_task, watched.on_active, parameter_overrides=override)
    executor.add_node(observer)
    try:
        with NodeProcesses(environment, logs) as nodes:
            for call in calls.values():
                nodes.start(call.name, call.module, call.parameters)
            ready = Readiness(observer, [name for name in calls if name != "coworker_sim"])
            if not spin_until(executor, lambda: watched.truth, READY_S):
                raise TimeoutError(f"nothing moves; not ready: {ready.missing()}")
            _Killer(nodes, calls, ready, watched, observer, rate).work(executor, minutes, between_s)
            return watched.soak
    finally:
        executor.shutdown()
        observer.destroy_node()
        rclpy.try_shutdown()


class _Watched:
    """The interactions, and whether something was wrong in them."""

    def __init__(self, soak: Soak):
        self.soak = soak
        self.truth, self.active, self.disturbed, self.is_ready = "", set[str](), False, True

    def on_task(self, label: str, _: str) -> None:
        if label:
            self.truth, self.active, self.disturbed = label, set(), not self.is_ready
        elif self.truth:
            if self.disturbed:
                self.soak.disturbed += 1
            else:
                self.soak.recognised.append(self.truth in self.active)
            self.truth = ""

    def on_active(self, label: str) -> None:
        self.active.add(label)


class _Killer:
    """Kills a node at a time and starts it again, as a launch file does; samples all processes."""

    def __init__(
        self,
        nodes: NodeProcesses,
        calls: Mapping[str, NodeCall],
        ready: Readiness,
        watched: _Watched,
        observer: SessionObserver,
        rate: float,
    ):
        self._nodes, self._calls, self._ready = nodes, calls, ready
        self._watched, self._soak, self._observer = watched, watched.soak, observer
        self._pace = PaceKeeper(observer, rate)
        self._newest_ns: int | None = None
        observer.create_subscription(JointState, "intent/tasks", self._on_tasks, qos.STATE)
        self._starts = dict.fromkeys(calls, 0)
        self._next_sample_s = self._next_pace_s = 0.0

    def work(self, executor: Executor, minutes: float, between_s: float) -> None:
        victims = cycle(RECOGNITION)
        start_s, start_ns = time.monotonic(), self._observer.get_clock().now().nanoseconds
        end_s, next_kill_s = start_s + 60.0 * minutes, start_s + between_s
        while (now_s := time.monotonic()) < end_s:
            executor.spin_once(timeout_sec=0.05)
            self._look(now_s)
            if now_s >= next_kill_s and now_s + between_s / 2 < end_s:
                next_kill_s += between_s
                self._kill(executor, next(victims))
        now_ns = self._observer.get_clock().now().nanoseconds
        self._soak.simulated_s = (now_ns - start_ns) * 1e-9

    def _kill(self, executor: Executor, name: str) -> None:
        killed_s = time.monotonic()
        self._watched.is_ready, self._watched.disturbed = False, True
        os.kill(self._nodes.pid(name), signal.SIGKILL)
        spin_until(executor, lambda: not self._nodes.running(name), READY_S)
        self._ready.forget(name)
        spin_until(executor, lambda: time.monotonic() > killed_s + RESPAWN_DELAY_S, READY_S)
        self._start(name)
        spin_until(executor, lambda: not self._ready.missing(), READY_S)
        self._soak.recoveries_s.append(time.monotonic() - killed_s)
        self._watched.is_ready = not self._ready.missing()

    def _start(self, name: str) -> None:
        call = self._calls[name]
        self._nodes.start(name, call.module, call.parameters)
        self._starts[name] += 1

    def _on_tasks(self, message: JointState) -> None:
        self._newest_ns = stamp_ns(message)

    def _lag_s(self) -> float:
        """Simulated time by which the newest estimate is behind the clock; 0 before one came."""
        now_ns = self._observer.get_clock().now().nanoseconds
        return 0.0 if self._newest_ns is None else max(0.0, (now_ns - self._newest_ns) * 1e-9)

    def _look(self, now_s: float) -> None:
        if now_s >= self._next_pace_s:
            self._next_pace_s = now_s + PACE_PERIOD_S
            self._pace.update(self._lag_s())
        if now_s >= self._next_sample_s:
            self._next_sample_s = now_s + SAMPLE_PERIOD_S
            for name, start in self._starts.items():
                if not self._nodes.running(name):
                    self._soak.died.append(name)
                    self._start(name)
                else:
                    samples = self._soak.usage.setdefault((name, start), [])
                    samples.append(_usage(self._nodes.pid(name), now_s))


def _usage(pid: int, at_s: float) -> Usage:
    status = dict(
        line.split(":", 1)
        for line in Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    )
    memory_mb = int(status["VmRSS"].split()[0]) / 1024.0
    descriptors = sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())
    return Usage(at_s, memory_mb, descriptors, int(status["Threads"]))


if __name__ == "__main__":
    path, length, *between = sys.argv[1:]
    between_s, rate = [*map(float, between), *(100.0, RATE)[len(between) :]]
    run_of = run(Path(path), float(length), between_s, Path("out/soak"), rate)
    for result in results(run_of, float(length)):
        sys.stdout.write(result.line().rstrip() + "\n")
