# SPDX-License-Identifier: Apache-2.0
"""Time maps by local optimisation and by dynamic time warping, and measures of their defects.

A map holds the recorded phases at even phases of the reference, (T,).
"""

from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from intent_recognition.alignment import align
from intent_recognition.array_types import Floats

FLAT_RATE = 0.05
"""Steps shorter than this share of the mean step count as standing still."""


class Steps(NamedTuple):
    """Step lengths of maps, in mean steps (1: as fast as the reference).

    Attributes:
        largest: longest step of all.
        flat: share of the steps that stand still.
        longest_flat: longest time standing still, in phase of the reference.
        change: root mean square change of the step from one to the next.
    """

    largest: float
    flat: float
    longest_flat: float
    change: float


def dtw_available() -> bool:
    """Whether the library for dynamic time warping is installed."""
    return find_spec("dtaidistance") is not None


def smooth_maps(trajectories: Floats, reference: int) -> Floats:
    """Recorded phases by `alignment.align`, (n, T); trajectories (n, T, D)."""
    phase = np.linspace(0.0, 1.0, trajectories.shape[1])
    return np.array([warp.apply(phase) for warp in align(list(trajectories), reference).warps])


def dtw_maps(
    trajectories: Floats,
    reference: int,
    *,
    window: int | None = None,
    penalty: float | None = None,
    free_ends: int = 0,
) -> Floats:
    """Recorded phases by dynamic time warping (Sakoe and Chiba 1978), (n, T).

    A sample of the reference that is matched with several gets their mean.

    Args:
        trajectories: (n, T, D), two DOFs or more, of one scale.
        reference: index of the trajectory onto which the others are warped.
        window: largest distance between matched samples; None for no limit.
        penalty: cost of each step that is not diagonal.
        free_ends: samples at each end of either trajectory that need no match.
    """
    from dtaidistance import dtw_ndim

    n_samples = trajectories.shape[1]
    onto = np.ascontiguousarray(trajectories[reference])
    maps = []
    for values in trajectories:
        path = dtw_ndim.warping_path(
            onto,
            np.ascontiguousarray(values),
            window=window,
            penalty=penalty,
            psi=free_ends or None,
            use_c=True,
        )
        maps.append(_mean_match(np.array(path), n_samples) / (n_samples - 1))
    return np.array(maps)


def steps(maps: Floats) -> Steps:
    """Step lengths of maps (n, T), the reference's own left out."""
    rate = np.diff(maps, axis=1) * (maps.shape[1] - 1)
    flat = rate < FLAT_RATE
    return Steps(
        float(rate.max()),
        float(flat.mean()),
        max(_longest_run(row) for row in flat) / flat.shape[1],
        float(np.sqrt(np.mean(np.diff(rate, axis=1) ** 2))),
    )


def warped(trajectories: Floats, maps: Floats) -> Floats:
    """Trajectories (n, T, D) read at recorded phases (n, T), the ends held."""
    phase = np.linspace(0.0, 1.0, trajectories.shape[1])
    return np.array(
        [
            np.stack([np.interp(at, phase, column) for column in values.T], axis=1)
            for values, at in zip(trajectories, maps, strict=True)
        ]
    )


def speed_ratio(trajectories: Floats, maps: Floats) -> float:
    """Largest speed of any warped trajectory relative to the largest recorded one."""
    return _top_speed(warped(trajectories, maps)) / _top_speed(trajectories)


def variance_removed(trajectories: Floats, maps: Floats) -> float:
    """Share of the variance about the mean that warping takes away."""
    return 1.0 - _variance(warped(trajectories, maps)) / _variance(trajectories)


def _mean_match(path: Floats, n_samples: int) -> Floats:
    """Mean index matched with each reference sample; unmatched ends go on sample by sample."""
    count = np.bincount(path[:, 0], minlength=n_samples)
    total = np.bincount(path[:, 0], weights=path[:, 1], minlength=n_samples)
    there = np.flatnonzero(count)
    numbers = np.arange(n_samples)
    before = np.minimum(numbers - there[0], 0)
    after = np.maximum(numbers - there[-1], 0)
    return np.interp(numbers, there, total[there] / count[there]) + before + after


def left_out(maps: Floats) -> float:
    """Mean share of a recording that lies before the reference begins or after it ends."""
    return float(np.mean(np.maximum(maps[:, 0], 0.0) + np.maximum(1.0 - maps[:, -1], 0.0)))


def _variance(trajectories: Floats) -> float:
    return float(np.sum((trajectories - trajectories.mean(axis=0)) ** 2))


def _top_speed(trajectories: Floats) -> float:
    step = np.linalg.norm(np.diff(trajectories, axis=1), axis=2)
    return float(step.max())


def _longest_run(flags: Floats) -> int:
    """Length of the longest run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))
