# SPDX-License-Identifier: Apache-2.0
"""Errors of alignment methods on movements of known timing and on the toolbox recordings."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from experiments.alignment.time_warping import (
    Steps,
    dtw_maps,
    left_out,
    smooth_maps,
    speed_ratio,
    steps,
    variance_removed,
    warped,
)
from experiments.alignment.timed import TimedRecording, demonstrations
from experiments.settings import Settings
from intent_recognition.alignment import even_trajectory, medoid
from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.learning import cut_to_movement

N_DEMONSTRATIONS = 40
"""Simulated demonstrations per data set; the first is the reference."""
N_SAMPLES = 200
"""Samples of each demonstration."""
PHASE = np.linspace(0.0, 1.0, N_SAMPLES)
NOISE, SHIFT_STD = 0.02, 0.03
FREE_ENDS = 20
"""Samples at each end that dynamic time warping need not match: over three `SHIFT_STD`."""
PENALTY = 0.05
"""Cost of a step that is not diagonal, in ranges of a DOF: about the best of 0.01 to 0.3."""

TRUE, LOCAL, DTW, DTW_WINDOW, DTW_TUNED = (
    "true timing",
    "local optimisation",
    "DTW",
    "DTW, window of 10 %",
    "DTW, free ends and penalty",
)
Method = Callable[[Floats, int], Floats]
METHODS: dict[str, Method] = {
    LOCAL: smooth_maps,
    DTW: dtw_maps,
    DTW_WINDOW: lambda values, onto: dtw_maps(values, onto, window=N_SAMPLES // 10),
    DTW_TUNED: lambda values, onto: dtw_maps(values, onto, penalty=PENALTY, free_ends=FREE_ENDS),
}


class MethodScore(NamedTuple):
    """A method's errors on movements of known timing.

    Attributes:
        steps: step lengths of its maps.
        median: median absolute error of the recorded phase.
        high: 95th percentile of that error.
        velocity: root mean square error of the warped movement's velocity, relative to the true.
    """

    steps: Steps
    median: float
    high: float
    velocity: float


class Recordings(NamedTuple):
    """A method's effect on the recordings of one task.

    Attributes:
        steps: step lengths of its maps.
        speed: largest speed of the warped wrist relative to the largest recorded one.
        observed: share of the wrist's variance about the mean that is removed.
        controlled: share of the joints' variance about the mean that is removed.
        left_out: mean share of a recording that its map leaves out at both ends.
    """

    steps: Steps
    speed: float
    observed: float
    controlled: float
    left_out: float


def known_timing(
    settings: Settings, number: int, methods: Mapping[str, Method]
) -> dict[str, MethodScore]:
    """Scores of each method on the same 40 movements, and of the true timing."""
    clean, noisy, truth = movements(settings, number)
    inside = ((truth >= 0.0) & (truth <= 1.0))[1:]
    velocity = velocities(clean, truth)[1:][inside]
    results = {TRUE: MethodScore(steps(truth[1:]), 0.0, 0.0, 0.0)}
    for name, method in methods.items():
        maps = method(noisy, 0)
        error = np.abs(maps - truth)[1:][inside]
        wrong = velocities(clean, maps)[1:][inside] - velocity
        results[name] = MethodScore(
            steps(maps[1:]),
            float(np.median(error)),
            float(np.percentile(error, 95)),
            float(np.sqrt(np.mean(wrong**2) / np.mean(velocity**2))),
        )
    return results


def movements(settings: Settings, number: int) -> tuple[Floats, Floats, Floats]:
    """Movements (n, T, D) without and with noise, and their true maps onto the first, (n, T)."""

    def draw(noise: float) -> TimedRecording:
        rng = settings.rng(number)
        return demonstrations(
            rng, n=N_DEMONSTRATIONS, n_samples=N_SAMPLES, shift_std=SHIFT_STD, noise=noise
        )

    clean, noisy = draw(0.0), draw(NOISE)
    truth = [noisy.between(0, i, PHASE) for i in range(N_DEMONSTRATIONS)]
    return clean.trajectories, noisy.trajectories, np.array(truth)


def toolbox(settings: Settings) -> dict[str, tuple[Floats, int]]:
    """Per task, recordings at even phases (n, T, 10) in m and rad, and which is the reference."""
    found, _ = read_demonstrations([settings.recordings("toolbox/train")], load_dofs())
    per_task: dict[str, list[Floats]] = {}
    for recorded in cut_to_movement(found):
        signals = (*recorded.observed, *recorded.controlled)
        values = even_trajectory(signals, recorded.start_ns, recorded.end_ns, N_SAMPLES)
        per_task.setdefault(str(recorded.task), []).append(values)
    most = 6 if settings.quick else None
    arrays = {task: np.array(values[:most]) for task, values in sorted(per_task.items())}
    return {task: (values, medoid(values)) for task, values in arrays.items()}


def on_recordings(
    values: Floats, reference: int, methods: Mapping[str, Method]
) -> dict[str, Recordings]:
    """Each method on one task's recordings (n, T, 10), all DOFs at once."""
    scaled = scaled_by_range(values)
    results = {}
    for name, method in methods.items():
        maps = method(scaled, reference)
        results[name] = Recordings(
            steps(np.delete(maps, reference, axis=0)),
            speed_ratio(values[..., :3], maps),
            variance_removed(values[..., :3], maps),
            variance_removed(values[..., 3:], maps),
            left_out(np.delete(maps, reference, axis=0)),
        )
    return results


def scaled_by_range(values: Floats) -> Floats:
    """Every DOF divided by its range, so that metres and radians can be compared."""
    return values / np.ptp(values, axis=(0, 1))


def velocities(trajectories: Floats, maps: Floats) -> Floats:
    """Velocities (n, T, D) of trajectories read along maps, by central differences."""
    return np.gradient(warped(trajectories, maps), PHASE, axis=1)
