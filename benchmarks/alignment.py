# SPDX-License-Identifier: Apache-2.0
"""Smooth warps beside the dynamic time warping of dtaidistance, on timing that is known."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from dtaidistance import dtw_ndim

from benchmarks.measure import Result, at_most, seconds_of_both
from experiments.alignment.time_warping import dtw_maps
from experiments.alignment.timed import TimedRecording, demonstrations
from intent_recognition.alignment import AlignmentSettings, Warp, align

N_DEMONSTRATIONS = 40
N_SAMPLES = 200
N_DOFS = 6
PHASE = np.linspace(0.0, 1.0, N_SAMPLES)
KINDS = {
    "noise": {"noise": 0.02},
    "noise and shifts": {"noise": 0.02, "shift_std": 0.03},
    "some variety": {"noise": 0.02, "shift_std": 0.03, "variety": 0.03},
    "much variety": {"noise": 0.02, "shift_std": 0.03, "variety": 0.1},
}


def alignment() -> Iterator[Result]:
    """Accuracy, order and time of aligning 40 demonstrations of 200 samples and 6 DOFs."""
    rng = np.random.default_rng(20)
    accuracy, warps = _accuracy(rng)
    yield accuracy
    noise = rng.normal(size=(N_DEMONSTRATIONS, N_SAMPLES, N_DOFS))
    warps += align(noise, 0, AlignmentSettings(rate_std=3.0)).warps
    backward = sum(bool(np.any(np.diff(warp.recorded) <= 0)) for warp in warps)
    yield at_most(
        "aligning, warps that run backward",
        backward,
        0,
        f"of {len(warps)}",
        "white noise under a 15 times weaker prior among them",
    )
    trajectories = _demonstrations(rng, **KINDS["some variety"]).trajectories
    ours_s, theirs_s = seconds_of_both(
        partial(_smooth, trajectories), partial(_dtw_paths, trajectories), 15
    )
    yield at_most(
        "aligning 40 demonstrations, time / dtaidistance",
        ours_s / theirs_s,
        3.0,
        "x",
        f"{1e3 * ours_s:.0f} and {1e3 * theirs_s:.0f} ms, plain numpy beside C",
    )


def _accuracy(rng: np.random.Generator) -> tuple[Result, list[Warp]]:
    """The worst ratio of median phase errors over all kinds of data, and the warps."""
    ratios, remarks, warps = [], [], []
    for kind, made in KINDS.items():
        timed = _demonstrations(rng, **made)
        found = _smooth(timed.trajectories)
        ours = _median_error(timed, [warp.apply(PHASE) for warp in found])
        theirs = _median_error(timed, list(dtw_maps(timed.trajectories, 0)))
        warps += found
        ratios.append(ours / theirs)
        remarks.append(f"{kind} {1e3 * ours:.2g} and {1e3 * theirs:.2g}")
    remark = f"the worst of, in thousandths: {'; '.join(remarks)}"
    name = "aligning, median phase error / dtaidistance's"
    return at_most(name, max(ratios), 1.3, "x", remark), warps


def _demonstrations(rng: np.random.Generator, **made: float) -> TimedRecording:
    return demonstrations(rng, N_DEMONSTRATIONS, N_SAMPLES, N_DOFS, **made)


def _smooth(trajectories: np.ndarray) -> list[Warp]:
    """Warps of all onto the first, the scales of the DOFs estimated on the way."""
    return list(align(trajectories, 0).warps)


def _dtw_paths(trajectories: np.ndarray) -> list[list[tuple[int, int]]]:
    """Paths of all to the first, by the library's fastest way to get them, in C."""
    reference = trajectories[0]
    return [dtw_ndim.warping_path(reference, values, use_c=True) for values in trajectories]


def _median_error(timed: TimedRecording, recorded: list[np.ndarray]) -> float:
    """Median over samples and demonstrations but the reference, where both were recorded."""
    truth = np.array([timed.between(0, i, PHASE) for i in range(1, N_DEMONSTRATIONS)])
    there = (truth >= 0.0) & (truth <= 1.0)
    return float(np.median(np.abs(np.array(recorded[1:]) - truth)[there]))
