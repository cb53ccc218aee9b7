# SPDX-License-Identifier: Apache-2.0
"""Resampled demonstrations, the scales that compare their DOFs, and the choice of a reference."""

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.signals import MIN_SAMPLES, Signal, as_numbers


class Template(NamedTuple):
    """Reference onto which demonstrations are aligned, and scales of the deviations from it."""

    values: Floats  # positions at even reference phases, in the DOFs' own units, (G, D)
    # typical absolute deviation of an aligned demonstration per DOF, (D,), in its unit; infinite
    # for a DOF that never moves, so that it has no influence
    scale: Floats


def even_trajectory(
    signals: Sequence[Signal], start_ns: int, end_ns: int, n_samples: int = 200
) -> Floats:
    """All DOFs of a recording at even phases from its start to its end, (n_samples, D).

    Gaps are interpolated and ends held constant, but for alignment only: weights are learned from
    the measured samples, at the phases that their warp gives.

    Raises:
        ArgumentError: the recording has no duration, or a signal no samples in it.
    """
    phase = np.linspace(0.0, 1.0, n_samples)
    columns = []
    for signal in signals:
        part = signal.between(start_ns, end_ns)
        if end_ns <= start_ns or not part.stamps_ns.size:
            expected = f"samples between {start_ns} and {end_ns} ns"
            cure = "Leave the demonstration out."
            raise ArgumentError.about(", ".join(signal.names), expected, "none", cure)
        recorded = (part.stamps_ns - np.int64(start_ns)) / float(end_ns - start_ns)
        columns += [np.interp(phase, recorded, column) for column in part.values.T]
    return np.stack(columns, axis=1)


def resample(trajectories: Sequence[Floats] | Floats, n_grid: int, smoothing: float) -> Floats:
    """Check n arrays (T_i, D) at even phases from 0 to 1, and resample them: (n, n_grid, D).

    They are smoothed by a kernel whose width in phase is `smoothing`.
    """
    cure = "Resample each demonstration over its phase."
    if not isinstance(trajectories, Iterable):
        got = f"one {type(trajectories).__name__}"
        raise ShapeError.about("trajectories", "a list of arrays (T, D)", got, cure)
    arrays = [as_numbers(f"trajectories[{k}]", of, cure) for k, of in enumerate(trajectories)]
    shapes = [values.shape for values in arrays]
    good = shapes and all(len(s) == 2 and s[0] >= MIN_SAMPLES and s[1] >= 1 for s in shapes)
    if not good or len({s[1] for s in shapes}) > 1:
        expected = f"arrays (T, D) of at least {MIN_SAMPLES} samples and the same DOFs"
        got = ", ".join(map(str, dict.fromkeys(shapes))) or "none"
        raise ShapeError.about("trajectories", expected, got, cure)
    for number, values in enumerate(arrays):
        if not np.all(np.isfinite(values)):
            expected = "finite numbers"
            cure = "Bridge its gaps, or leave the demonstration out."
            raise ArgumentError.about(f"trajectories[{number}]", expected, "NaN or infinity", cure)
    return np.stack([_smoother(len(values), n_grid, smoothing) @ values for values in arrays])


@lru_cache(maxsize=64)
def _smoother(n_samples: int, n_grid: int, width: float) -> Floats:
    """Matrix of a local linear regression with a Gaussian kernel, (n_grid, n_samples)."""
    at = np.linspace(0.0, 1.0, n_grid)[:, None]
    offset = np.linspace(0.0, 1.0, n_samples) - at
    kernel = np.exp(-0.5 * (offset / max(width, 0.6 / (n_samples - 1))) ** 2)
    s0, s1, s2 = (np.sum(kernel * offset**k, axis=1, keepdims=True) for k in range(3))
    return kernel * (s2 - s1 * offset) / (s0 * s2 - s1**2)


def typical_deviation(samples: Floats, deviations: Floats) -> Floats:
    """Scale of each DOF, (D,): median over demonstrations of their mean absolute deviations.

    The mean of the deviations from the reference (n, G, D) is subtracted in each demonstration, as
    in the cost of a warp. The scale is at least 1 % of the DOF's range in the samples (n, G, D),
    and infinite if the DOF never moves, or by less than the smallest normal number.
    """
    extent = np.ptp(samples.reshape(-1, samples.shape[-1]), axis=0)
    moving = np.any(np.ptp(samples, axis=1) > 1e-9 * np.abs(samples).max(axis=(0, 1)), axis=0)
    centred = deviations - deviations.mean(axis=1, keepdims=True)
    typical = np.median(np.mean(np.abs(centred), axis=1), axis=0)
    scale = np.maximum(typical, 0.01 * extent)
    return np.where(moving & (scale >= np.finfo(np.float64).tiny), scale, np.inf)


def medoid(samples: Floats) -> int:
    """Index of the demonstration, of (n, G, D), with the least scaled L1 distance to the others."""
    extent = np.ptp(samples, axis=(0, 1))
    scaled = samples / np.where(extent > 0, extent, 1.0)
    centred = (scaled - scaled.mean(axis=1, keepdims=True)).reshape(len(samples), -1)
    return int(np.argmin([np.sum(np.abs(centred - row)) for row in centred]))


def choose_reference(
    samples: Floats, reference: str | int | Floats, smoothing: float
) -> tuple[Floats, int | None]:
    """Values (G, D) of the requested reference, and the index of its demonstration or None.

    Args:
        samples: demonstrations, (n, G, D).
        reference: "mean" or "medoid" (both give the medoid: the mean starts from it), the index of
            a demonstration, or a trajectory (T, D).
        smoothing: width of the smoothing kernel for a trajectory, in phase.
    """
    if isinstance(reference, str):
        if reference not in ("mean", "medoid"):
            cure = "Use 'mean'."
            raise ArgumentError.about("reference", "'mean' or 'medoid'", repr(reference), cure)
        reference = medoid(samples)
    if isinstance(reference, (int, np.integer)):
        if not 0 <= reference < len(samples):
            cure = "Pick one of them."
            raise ArgumentError.about("reference", f"0 to {len(samples) - 1}", reference, cure)
        return samples[reference], int(reference)
    values = resample([reference], samples.shape[1], smoothing)[0]
    if values.shape != samples.shape[1:]:
        expected = f"shape (T, {samples.shape[2]})"
        cure = "Give it the DOFs of the trajectories."
        raise ShapeError.about("reference", expected, np.shape(reference), cure)
    return values, None
