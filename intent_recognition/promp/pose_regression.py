# SPDX-License-Identifier: Apache-2.0
"""Gaussian process regression of the controlled agent's pose on the present state.

A primitive follows the course of a movement; where the agents are coupled by place, or a wave may
begin at any phase, the present state tells more of the pose near now. For each task and lead, the
regression gives a pose of its own, and the primitive's prediction moves towards it by a share that
predicts left-out demonstrations best (stacked regressions: Breiman 1996, Machine Learning 24):

    mean + share (pose - mean),    pose = sum_m k(s, s_m) a_m
    k(s, s') = 100 + s's'/F + exp(-|s - s'|^2 / (2 F l^2))

(Rasmussen and Williams 2006, Eq. 2.25). The state s is the observed agent's position, its
displacement over `STEP`, and the controlled agent's usual position at this phase: F = 2 P + Q
numbers, standardised by the task's moments s_m.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from intent_recognition.array_types import Floats

LEADS = np.array([0.0, 0.02, 0.05, 0.1])
"""Leads for which the pose is regressed on the present state, in durations."""
FADED = -0.02, 0.2
"""Leads before and after those at which the regression has no share, in durations."""
STEP = 2.0 / 60.0
"""Interval of the displacement, in durations: two samples of the filter."""
DIVISORS = "decay_s", "scale", "length"
"""Fields of what tasks have learned by which is divided."""


class PoseRegression(NamedTuple):
    """Regression of the controlled agent's pose on the present state, for each of K tasks.

    Attributes:
        centre: mean state, (K, F).
        scale: standard deviation of the state, (K, F).
        states: standardised states at M moments of training, (K, M, F).
        length: length scale of the kernel, in standard deviations, (K,).
        coefficients: coefficients a, (K, M, L, Q); zero beyond a task's moments.
        share: share of the regression in the prediction, (K, L), in [0, 1]; zero where left-out
            demonstrations do not support one.
    """

    centre: Floats
    scale: Floats
    states: Floats
    length: Floats
    coefficients: Floats
    share: Floats

    def at(self, task: int, state: Floats, leads: Floats) -> tuple[Floats, Floats]:
        """Poses (T, Q) at times after now in durations, given the state (F,); and shares (T, 1)."""
        standardised = (state - self.centre[task]) / self.scale[task]
        kernel = pose_kernel(standardised[None], self.states[task], float(self.length[task]))[0]
        poses = np.tensordot(kernel, self.coefficients[task], axes=1)
        at, share = np.r_[FADED[0], LEADS, FADED[1]], np.pad(self.share[task], 1)
        along = np.stack([np.interp(leads, LEADS, column) for column in poses.T], axis=1)
        return along, np.interp(leads, at, share)[:, None]


def pose_kernel(one: Floats, other: Floats, length: float) -> Floats:
    """Covariance of poses at n and m standardised states (n, F) and (m, F), (n, m)."""
    n_numbers = one.shape[1]
    near = np.exp(cdist(one, other, "sqeuclidean") / (-2.0 * n_numbers * length**2))
    return np.asarray(100.0 + one @ other.T / n_numbers + near)


def stack_tasks(
    names: Sequence[str], learned: Mapping[int, Sequence[Floats]], n_tasks: int
) -> list[Floats]:
    """Stack the arrays, by field, that some of K tasks have learned; the other tasks have nothing.

    Arrays smaller than another task's are filled up in the same way: with ones if they are divisors
    and zeros otherwise.
    """
    stacked = []
    for name, parts in zip(names, zip(*learned.values(), strict=True), strict=True):
        sizes = np.array([np.shape(part) for part in parts], dtype=int)
        whole = np.full((n_tasks, *sizes.max(axis=0)), float(name in DIVISORS))
        for task, part in zip(learned, parts, strict=True):
            place: list[int | slice] = [task, *map(slice, np.shape(part))]
            whole[tuple(place)] = part
        stacked.append(whole)
    return stacked
