# SPDX-License-Identifier: Apache-2.0
"""Transition probabilities between tasks, learned from recorded sequences."""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.special import gammaln

from intent_recognition.array_types import Floats
from intent_recognition.errors import ShapeError


def count_transitions(sequences: Iterable[Sequence[str]], labels: Sequence[str]) -> Floats:
    """Count transitions from task to task, (K + 1, K); the last row counts first tasks.

    Labels that are not among the tasks are skipped, as `none` is online.
    """
    index = {label: k for k, label in enumerate(labels)}
    counts = np.zeros((len(labels) + 1, len(labels)))
    for sequence in sequences:
        last = len(labels)
        for label in sequence:
            if label in index:
                counts[last, index[label]] += 1.0
                last = index[label]
    return counts


def smoothed_transitions(counts: Floats) -> Floats:
    """p(next | last) from counts, (K + 1, K), with a smoothing strength estimated from the counts.

    Row k is (n_kj + a) / (n_k + K a) under a symmetric Dirichlet prior with a pseudo-counts per
    task. The rows are averaged over a, weighted by the evidence of all counts (the
    Dirichlet-multinomial likelihood, flat in log a from 0.1 to 100), so that many counts move the
    probabilities more than few do. A row without counts is uniform.

    Raises:
        ShapeError: counts are not (K + 1, K).
    """
    n = np.asarray(counts, dtype=np.float64)
    if n.ndim != 2 or n.shape[0] != n.shape[1] + 1:
        cure = "Give one row per last task, one row for none, and one column per task."
        raise ShapeError.about("counts", "shape (K + 1, K)", n.shape, cure)
    a = np.geomspace(0.1, 100.0, 61)[:, None, None]
    total = n.shape[1] * a[:, :, 0]
    cells = np.sum(gammaln(n + a) - gammaln(a), axis=2)
    log_evidence = np.sum(cells + gammaln(total) - gammaln(total + n.sum(axis=1)), axis=1)
    weight = np.exp(log_evidence - log_evidence.max())
    rows = (n + a) / (n.sum(axis=1, keepdims=True) + n.shape[1] * a)
    prior = np.tensordot(weight / weight.sum(), rows, axes=1)
    return prior / prior.sum(axis=1, keepdims=True)
