# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmarks.page --minutes 60`: what an open page costs, and whether it grows.

The graph of `intent demo --dashboard` goes on, with the simulated coworker at work; a headless
Chromium has the page open, which is updated 25 times a second. Once a minute the memory of the
server's process is read, and that of the page after its garbage was collected. A line is fitted
through what came after the first part, in which everything is met for the first time.
"""

import argparse
import json
import math
import os
import socket
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from benchmarks.browser import PageSize, chromium, first_sight_s, open_page, resident_mb
from benchmarks.measure import Result, at_least, at_most
from benchmarks.offline import bags_to_model, model_file
from intent_recognition.dashboard.admission import TOKEN_VARIABLE, answers, random_token
from intent_recognition.nodes.graph import resolve
from intent_recognition.nodes.processes import LOCALHOST, RANGE, NodeProcesses, node_environment
from intent_recognition.nodes.runtime import make_executor
from intent_recognition.promp import TaskLibrary
from intent_recognition.share import share_path
from sim_bridge.coworker import parse_task_list

WIDTH, HEIGHT = 800, 500
"""A small window: the processor draws its pixels."""
WINDOW = 1280, 800
"""That of an operator, for the first sight."""
MOST_SIGHT_S = 3.0
DOMAIN = 53
SHORT_S, SHORT_STEP_S = 30.0, 3.0
"""What `make bench` spends on it, beside the start of the graph."""
STEP_S = 60.0
WARM_SHARE = 1.0 / 6.0
START_S = 60.0
SETTLED_S = 8.0
INTERACTION_S = 6.0
LISTEN_S = 0.2
MOST_CPU, LEAST_HZ = 0.25, 24.0
MOST_MB, MOST_COUNT = 4.0, 20.0
MOST_ELEMENTS = 200.0
"""Nodes of the document: a plot draws up to a hundred more or fewer from one look to the next."""
SERVER, TEACHER = "dashboard", "task_teacher"


class Sample(NamedTuple):
    """What was measured at one time.

    Attributes:
        at_s: seconds since the beginning.
        server_mb: memory of the server's process.
        cpu: its share of one core since the sample before.
        rate_hz: updates of the page per second, as the server reports.
        page: the browser's side.
    """

    at_s: float
    server_mb: float
    cpu: float
    rate_hz: float
    page: PageSize

    def line(self) -> str:
        """The sample as printed."""
        page = self.page
        return (
            f"{self.at_s / 60:6.1f} min  server {self.server_mb:6.1f} MB"
            f" {100 * self.cpu:5.1f} % of a core {self.rate_hz:4.1f} Hz"
            f" | heap {page.heap_mb:6.2f} MB, process {page.renderer_mb:6.1f} MB,"
            f" {page.elements} elements, {page.listeners} listeners, {page.objects} objects,"
            f" {page.geometries} geometries, {page.textures} textures, {page.waiting} waiting"
        )


def page(library: TaskLibrary) -> Iterator[str | Result]:
    """The short form, for `make bench`: cost and counts; memory takes longer to tell."""
    if missing := _missing():
        yield f"The page: left out, there is no {missing}"
        return
    yield "The page, open in a browser"
    yield sight(library)
    samples = list(watch(library, SHORT_S, SHORT_STEP_S))
    yield from cost(samples)
    yield from counts(_after_warming(samples))


def watch(library: TaskLibrary, seconds: float, step_s: float) -> Iterator[Sample]:
    """Samples of a running graph with one page open, after `SETTLED_S`."""
    with _graph(library, seconds) as (processes, port, rate):
        server = processes.pid(SERVER)
        with open_page(_address(port), WIDTH, HEIGHT) as opened:
            opened.wait(SETTLED_S)
            start_s = at_s = time.monotonic()
            used_s = _processor_s(server)
            for k in range(1, max(int(seconds / step_s), 2) + 1):
                opened.wait(max(start_s + k * step_s - time.monotonic(), 0.0))
                processes.check()
                before_s, at_s = at_s, time.monotonic()
                used_before_s, used_s = used_s, _processor_s(server)
                yield Sample(
                    at_s - start_s,
                    resident_mb(server),
                    (used_s - used_before_s) / (at_s - before_s),
                    rate(),
                    opened.size(),
                )


def sight(library: TaskLibrary) -> Result:
    """How long an operator waits for the first whole frame, where a processor draws it."""
    with _graph(library, SHORT_S) as (_, port, _):
        waited_s = first_sight_s(_address(port), *WINDOW, "/person/upper_body/shape")
    return at_most("page, from the address to the whole scene", waited_s, MOST_SIGHT_S, "s", "")


def cost(samples: Sequence[Sample]) -> Iterator[Result]:
    """The share of a core that the server takes for one page, and whether it kept its rate."""
    rates = [sample.rate_hz for sample in samples]
    yield at_most(
        "page at 25 Hz with one browser, its process",
        100 * float(np.mean([sample.cpu for sample in samples])),
        100 * MOST_CPU,
        "% of a core",
        f"over {samples[-1].at_s:.0f} s beside the running demo",
    )
    remark = f"lowest {min(rates):.1f}; fewer on a busy machine, and the share means little then"
    yield at_least("... its updates", float(np.mean(rates)), LEAST_HZ, "Hz", remark)


def counts(samples: Sequence[Sample]) -> Iterator[Result]:
    """What must not grow at all, however short one looks."""
    for name, text, most in (
        ("objects", "things in its scene", MOST_COUNT),
        ("geometries", "geometries drawn", MOST_COUNT),
        ("elements", "nodes of its document", MOST_ELEMENTS),
    ):
        values = [getattr(sample.page, name) for sample in samples]
        yield _growth(f"... growth, {text}", samples, values, most, "")
    waiting = max(sample.page.waiting for sample in samples)
    yield at_most("... messages waiting in it, most", waiting, 500.0, "", "")


def growth(samples: Sequence[Sample]) -> Iterator[Result]:
    """What memory grows by on the fitted line, from the first of these samples to the last."""
    for text, values in (
        ("server's process", [sample.server_mb for sample in samples]),
        ("page's JavaScript", [sample.page.heap_mb for sample in samples]),
    ):
        yield _growth(f"open page, growth of the {text}", samples, values, MOST_MB, "MB")


def _growth(
    name: str, samples: Sequence[Sample], values: Sequence[float], most: float, unit: str
) -> Result:
    times = np.array([sample.at_s for sample in samples])
    slope = np.polyfit(times, np.array(values, dtype=float), 1)[0]
    span_s = times[-1] - times[0]
    remark = (
        f"{3600 * slope:+.2f} an hour, fitted over {span_s / 60:.1f} min;"
        f" {values[0]:.1f} first, {values[-1]:.1f} last"
    )
    return at_most(name, float(slope * span_s), most, unit, remark)


def _after_warming(samples: Sequence[Sample]) -> Sequence[Sample]:
    warm_s = WARM_SHARE * samples[-1].at_s
    return [sample for sample in samples if sample.at_s >= warm_s]


@contextmanager
def _graph(library: TaskLibrary, seconds: float) -> Iterator[tuple]:
    """The demo's nodes as processes: them, the page's port, and the rate it reports."""
    domain = int(os.environ.get("ROS_DOMAIN_ID", DOMAIN))
    within = {**os.environ, RANGE: LOCALHOST}  # other benchmarks want no network
    environment = node_environment(within, domain)
    environment.setdefault(TOKEN_VARIABLE, random_token())
    os.environ.update(environment)
    port = _free_port()
    enough = math.ceil((seconds + START_S) / INTERACTION_S)
    given = {
        "rate": 1.0,
        "headless": True,
        "sensor_noise": True,
        "seed": 1,
        "task_list": ",".join(parse_task_list("habit", 1, enough)),
        "transfers": False,
        "dashboard": True,
        "port": port,
    }
    rclpy.init(args=["--ros-args", "--log-level", "error"])
    try:
        with (
            model_file(library) as model,
            NodeProcesses(environment, model.parent / "logs") as processes,
        ):
            folders = {"library": str(model.parent / "tasks"), "models": str(model.parent)}
            for call in resolve("demo", {**given, **folders, "model": str(model)}):
                if call.name != TEACHER:  # it wants a model with its statistics
                    processes.start(call.name, call.module, call.parameters)
            _wait_until_served(port, processes)
            yield processes, port, _Reported().rate
    finally:
        rclpy.try_shutdown()


class _Reported:
    """The last rate that the server reported in its diagnostics."""

    def __init__(self) -> None:
        self._node = Node("page_benchmark")
        self._executor = make_executor()
        self._executor.add_node(self._node)
        self._rate_hz = math.nan
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._hear, 100)

    def rate(self) -> float:
        """Updates of the page per second."""
        end_s = time.monotonic() + LISTEN_S
        while time.monotonic() < end_s:
            self._executor.spin_once(timeout_sec=LISTEN_S / 10)
        return self._rate_hz

    def _hear(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == SERVER:
                reported = {pair.key: pair.value for pair in status.values}
                self._rate_hz = float(reported.get("rate page [Hz]", math.nan))


def _wait_until_served(port: int, processes: NodeProcesses) -> None:
    end_s = time.monotonic() + START_S
    while not answers(_address(port)):
        processes.check()
        if time.monotonic() > end_s:
            raise TimeoutError(f"no page within {START_S:.0f} s")
        time.sleep(0.2)


def _address(port: int) -> str:
    return f"http://127.0.0.1:{port}/?token={os.environ[TOKEN_VARIABLE]}"


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _processor_s(process: int) -> float:
    """Processor time a process has used, on Linux."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _missing() -> str:
    """What is not there to look at a page with; empty where nothing is missing."""
    if chromium() is None:
        return "Chromium"
    try:
        import playwright  # noqa: F401
        import viser  # noqa: F401
    except ImportError as error:
        return str(error.name)
    return ""


def main(arguments: list[str] | None = None) -> int:
    """Watch for as long as is asked for, print every sample, and judge; 1 if something grew."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.page", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0, help="(default: %(default)s)")
    parser.add_argument("--every", type=float, default=STEP_S, help="seconds between samples")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write samples and results")
    args = parser.parse_args(arguments)
    if missing := _missing():
        sys.stderr.write(f"benchmarks.page: there is no {missing}\n")
        return 1
    _, library, _ = bags_to_model(share_path("bags/toolbox/train"))
    samples = []
    for sample in watch(library, 60.0 * args.minutes, args.every):
        samples.append(sample)
        sys.stdout.write(sample.line() + "\n")
        sys.stdout.flush()
    later = _after_warming(samples)
    results = [*cost(samples), *growth(later), *counts(later)]
    sys.stdout.write("\n" + "\n".join(result.line().rstrip() for result in results) + "\n")
    if args.json:
        content = {
            "samples": [s._asdict() | {"page": s.page._asdict()} for s in samples],
            "results": [result.to_dict() for result in results],
        }
        args.json.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    return 0 if all(result.verdict == "ok" for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
