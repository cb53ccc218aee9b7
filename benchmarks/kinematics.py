# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics of random reachable poses, of four arms."""

import time
from collections.abc import Iterator

import numpy as np

from benchmarks.measure import Result, at_least, at_most
from intent_recognition.kinematics import Arm
from sim_bridge.arm import NAMES, find_robot

N_POSES = 1000
LARGEST_ERROR = 1e-6


def kinematics() -> Iterator[Result]:
    """Share solved and time, of whole poses from the arm's rest posture."""
    for name in NAMES:
        robot = find_robot(name)
        arm = Arm.from_urdf(robot.urdf, tip=robot.tip)
        rng = np.random.default_rng(1)
        limits = arm.limits
        q = rng.uniform(limits.lower, limits.upper, (N_POSES, arm.n_joints))
        poses = arm.forward_kinematics(q)
        arm.nearest(poses[0])  # makes the table of starts
        times, errors = [], []
        for pose in poses:
            start_s = time.process_time()
            found = arm.nearest(pose)
            times.append(time.process_time() - start_s)
            there = arm.forward_kinematics(found.q)
            errors.append(np.abs(there - pose).max())
        solved = 100.0 * float(np.mean(np.array(errors) < LARGEST_ERROR))
        remark = f"of {N_POSES} random reachable poses, error below {LARGEST_ERROR:g}"
        yield at_least(f"{name}: poses solved", solved, 99.5, "%", remark)
        slowest = 1e3 * float(np.percentile(times, 99))
        remark = f"of the processor; median {1e3 * float(np.median(times)):.2f} ms"
        yield at_most(f"{name}: one pose, 99th percentile", slowest, 5.0, "ms", remark)
