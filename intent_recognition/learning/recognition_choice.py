# SPDX-License-Identifier: Apache-2.0
"""How surely demonstrations are recognised by a library that has not seen them.

The score that recognition's regularisation is chosen by: a model that is too sure of itself early
on pays for it, and so does one that takes too long.
"""

from collections.abc import Mapping

import numpy as np

from intent_recognition.learning.accumulation import Reference
from intent_recognition.learning.held_out import held_out, others_evidence, own_evidence
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import TaskLibrary

RECOGNITION_STRENGTHS = (1.0, 4.0)
RECOGNITION_NOISE_SCALES = (1.0, 4.0, 16.0)
MAX_RECOGNISED = 60
"""Demonstrations that are left out, at most."""


def recognition_losses(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    reference: Reference,
    strength: float,
) -> np.ndarray:
    """Log loss of left-out demonstrations, mean over all their samples, natural logarithm, (n,).

    The progress is unknown, and `none` does not compete. Empty where nothing is to be told apart.

    Args:
        library: the learned tasks, recognised with this strength.
        tasks: their statistics.
        reference: how their examples were made.
        strength: of the targets of the covariances that tasks are told apart by.
    """
    losses = []
    for one in held_out(library, tasks, reference, strength, MAX_RECOGNISED):
        others = np.delete(np.arange(library.n_tasks), one.task)
        if one.own is None or not len(others):
            continue
        own = own_evidence(library, one)
        everyone = np.logaddexp.reduce([own, *others_evidence(library, one, others)], axis=0)
        losses.append(np.mean(everyone - own))
    return np.array(losses)


def least_noise(losses: np.ndarray) -> int:
    """The first of several models whose loss is within one paired standard error of the least.

    With models in the order of their noise it is the one that recognises earliest.

    Args:
        losses: of each model and demonstration, (c, n).
    """
    if losses.shape[1] < 2:
        return 0
    excess = losses - losses[np.argmin(losses.mean(axis=1))]
    error = excess.std(axis=1, ddof=1) / np.sqrt(losses.shape[1])
    return int(np.argmax(excess.mean(axis=1) <= error + 1e-12))
