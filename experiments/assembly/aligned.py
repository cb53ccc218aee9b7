# SPDX-License-Identifier: Apache-2.0
"""Recognition on aligned demonstrations, step by step as in the paper (Maeda et al. 2014).

All demonstrations are first aligned to their task's timing, including the one to be recognised
(parts III-E and IV-C). Its observations then have known phases, and Eq. 6 and 9-10 are applied to
them one by one. Alignment needs the whole movement and its label: this serves comparison only.
"""

import numpy as np

from intent_recognition.alignment import Warp
from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian, condition
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration


def aligned_evidence(library: TaskLibrary, warp: Warp, recorded: Demonstration, n: int) -> Floats:
    """Log evidence of the tasks before any and after each of n observations, (n + 1, K).

    Args:
        library: primitives over reference phase.
        warp: from reference phase to the recorded phase of the demonstration.
        recorded: cut to its movement.
        n: number of observations: the samples nearest to even reference phases.
    """
    (signal,) = recorded.observed
    phases = warp.inverse(
        (signal.stamps_ns - recorded.start_ns) / (recorded.end_ns - recorded.start_ns)
    )
    rows = spread_rows(phases, n)
    designs = [
        np.kron(np.eye(library.n_observed), row)
        for row in library.basis.design_matrix(phases[rows])[:, None]
    ]
    noise = np.diag(library.noise_variance[: library.n_observed] * library.noise_scale)
    steps = np.zeros((n + 1, len(library.weight_mean)))
    for task in range(steps.shape[1]):
        weights = _observed(library, task)
        for k, (design, row) in enumerate(zip(designs, rows, strict=True)):
            weights, steps[k + 1, task] = condition(weights, design, signal.values[row], noise)
    return np.cumsum(steps, axis=0)


def spread_rows(phases: Floats, n: int) -> Floats:
    """Indices (n,) of the samples at phases (T,) nearest to n even phases, each sample once."""
    wanted = (np.arange(n) + 0.5) / n
    rows = np.argmin(np.abs(phases[:, None] - wanted), axis=0)
    return np.maximum.accumulate(rows - np.arange(n)) + np.arange(n)


def _observed(library: TaskLibrary, task: int) -> Gaussian:
    """Prior of the observed weights."""
    size = library.n_observed_weights
    return Gaussian(library.weight_mean[task, :size], library.weight_covariance[task, :size, :size])
