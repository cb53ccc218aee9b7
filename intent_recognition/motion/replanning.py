# SPDX-License-Identifier: Apache-2.0
"""Planning a path anew where no bend within the spread of its task is clear.

Trajectory optimisation in joint space: the path may move by the spread of its task and, at a
higher cost, by any smooth detour between its ends, a Gaussian process that is fixed there (as in
Mukadam et al. 2018, "Continuous-time Gaussian process motion planning via probabilistic
inference"). `bend` descends from the path itself, then from the random detours that come through
what is in the way with the least depth. Its steps are counted, so the same path and things give the
same plan.
"""

from collections.abc import Callable

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.motion.bending import TouchingPath, bend


def detours(phases: Floats, n_joints: int, first: float) -> Floats:
    """Joints by independent standard normal numbers (T, n, m): smooth, and zero at both ends.

    At the path's phases (T,); nothing moves up to the phase `first`.
    """
    share = np.clip((phases - first) / max(1.0 - first, 1e-9), 0.0, 1.0)
    waves = np.arange(1, 6)
    # 10 cm at the hand, more than demonstrations vary
    table = 0.15 * np.sin(np.pi * np.outer(share, waves)) / waves**1.5
    rows = np.einsum("jd,tk->tjdk", np.eye(n_joints), table)
    return rows.reshape(*rows.shape[:2], -1)


def replan(
    path: TouchingPath, tries: int | None, out_of_time: Callable[[], bool]
) -> tuple[Floats | None, bool]:
    """How to move a path so that it is clear of all contacts, z (m,), None if nothing was found,
    and whether detours were drawn for it.

    After so many tries others are drawn; None: none are. No descent begins once it is out of time.
    """
    if path.contacts[-1].sample == len(path.positions) - 1:
        return None, False  # its end touches
    found = bend(path)
    if found is not None or tries is None:
        return found, False
    # Always the same; to measure them takes as long as two descents.
    draws = np.random.default_rng([7, tries]).normal(size=(24, path.moves.shape[2]))
    depths = [_depth(path, z) for z in draws]
    for k in np.argsort(depths, kind="stable")[:4]:  # measured: docs/decisions/replanning.md
        if out_of_time():
            break
        found = bend(path, start=draws[k])
        if found is not None:
            return found, True
    return None, True


def _depth(path: TouchingPath, z: Floats) -> float:
    """By how much a moved path is too near where the path itself is nearest to each thing [m]."""
    depth = 0.0
    nearest = {c.pair: c for c in sorted(path.contacts, key=lambda c: -c.distance_m)}
    for one in nearest.values():
        moved = path.positions[one.sample] + path.moves[one.sample] @ z
        gap = path.bodies.distance_m(moved, one.pair)
        depth += max(0.0, path.bodies.clearance_m - gap)
    return depth
