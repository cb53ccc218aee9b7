# SPDX-License-Identifier: Apache-2.0
"""What it costs to keep plans clear of boxes and of the arm itself."""

import time
from collections.abc import Iterator

import numpy as np

from benchmarks.measure import Result, at_most
from intent_recognition.kinematics import Bodies, Box, hand_position
from intent_recognition.motion import (
    Clearance,
    JointReference,
    NominalTiming,
    Obstruction,
    Spread,
    make_path,
    plan_interaction,
    scaled_limits,
)
from intent_recognition.promp import TaskLibrary
from sim_bridge.arm import NAMES, find_robot

CLEARANCE_M = 0.02
N_MOTIONS = 100
LARGEST_MS = 10.0
TABLE = Box("table", (0.6, 0.0, -0.06), (1.2, 1.6, 0.1))
CRATE = Box("crate", (0.45, 0.3, 0.2), (0.2, 0.3, 0.4))


def clearance(library: TaskLibrary) -> Iterator[Result]:
    """Checks of plans across the workspace of four arms; bends of learned paths.

    Args:
        library: tasks of the LWR's joints.
    """
    for name in NAMES:
        robot = find_robot(name)
        bodies = Bodies(
            robot.description, robot.joint_names, [TABLE, CRATE], clearance_m=CLEARANCE_M
        )
        guard, limits = Clearance(bodies, {}), scaled_limits(robot.limits)
        rng = np.random.default_rng(0)
        low, high = np.maximum(limits.lower, -1.5), np.minimum(limits.upper, 1.5)
        times = []
        s = np.linspace(0.0, 1.0, 50)[:, None]
        for _ in range(N_MOTIONS):
            way = rng.uniform(low, high) - robot.ready
            path = make_path(3.0 * s[:, 0], robot.ready + s**2 * (3.0 - 2.0 * s) * way, limits)
            start = JointReference.at_rest(path.spline(0.0))
            plan = plan_interaction(path, NominalTiming(0.0, 3.0), start, limits)
            if plan is not None:
                begun_s = time.process_time()
                guard.obstruction(plan)
                times.append(time.process_time() - begun_s)
        yield _result(f"{name}: check of a plan, 99th percentile", times, "random, two boxes")
    yield _bends(library)


def _bends(library: TaskLibrary) -> Result:
    """Mean paths with a box beside them, bent or refused."""
    robot, rng = find_robot("lwr"), np.random.default_rng(0)
    times: list[float] = []
    spreads = {label: Spread.of(library.primitive(k)) for k, label in enumerate(library.labels)}
    n_bent = 0
    while len(times) < N_MOTIONS:
        k = len(times) % library.n_tasks
        mean = library.primitive(k).predict_controlled()
        path = make_path(mean.times_s, mean.positions, robot.limits)
        center = hand_position(path.spline(rng.uniform(0.2, 0.8))) + rng.normal(0.0, 0.1, 3)
        box = Box("box", tuple(center), tuple(rng.uniform(0.05, 0.2, 3)))
        bodies = Bodies(robot.description, robot.joint_names, [box], clearance_m=CLEARANCE_M)
        guard = Clearance(bodies, spreads)
        begun_s = time.process_time()
        found = guard.clear(path, library.labels[k], 0.0, robot.limits)
        taken_s = time.process_time() - begun_s
        how = "refused" if isinstance(found, Obstruction) else found.how
        if how:
            times.append(taken_s)
            n_bent += how == "bent"
    return _result("a bend or its refusal, 99th percentile", times, f"{n_bent} bent")


def _result(name: str, times_s: list[float], remark: str) -> Result:
    slowest, median = (1e3 * float(np.percentile(times_s, share)) for share in (99, 50))
    remark = f"of the processor; median {median:.1f} ms; {len(times_s)}, {remark}"
    return at_most(name, slowest, LARGEST_MS, "ms", remark)
