# SPDX-License-Identifier: Apache-2.0
"""What reaches that begin anew on the way take from tasks: how long they move, and their ends."""

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import TaskLibrary


def moving_parts(library: TaskLibrary, scale: Floats) -> Floats:
    """Part of each task's duration in which its mean course moves, as by least jerk, (K,).

    Args:
        library: the learned tasks.
        scale: what the observed DOFs are measured in, (P,).
    """
    phase = np.linspace(0.0, 1.0, 201)
    mean = library.observed_mean.reshape(len(library.observed_mean), len(scale), -1)[:-1]
    course = np.einsum("tn,kpn->ktp", library.basis.design_matrix(phase), mean) / scale
    way = np.linalg.norm(np.diff(course, axis=1), axis=2).cumsum(axis=1)
    done = np.argmax(way >= 0.99 * way[:, -1:], axis=1)
    return np.asarray(np.minimum(phase[1:][done] / 0.894, 1.0))  # least jerk has done so much there


def end_tells(library: TaskLibrary) -> Floats:
    """How far each task's end tells it from every other: 1 less the largest overlap, (K,).

    The overlap of two ends is the Bhattacharyya coefficient of their distributions. A hand that
    goes straight to an end that tasks share says nothing of which it is.
    """
    n_tasks, row = library.n_tasks, library.basis.design_matrix(np.ones(1))[0]
    to_end = np.kron(np.eye(library.n_observed), row)  # (P, P N)
    mean = library.observed_mean[:n_tasks] @ to_end.T
    covariance = to_end @ library.observed_covariance[:n_tasks] @ to_end.T
    apart = mean[:, None] - mean
    common = 0.5 * (covariance[:, None] + covariance)
    half = 0.5 * np.linalg.slogdet(covariance)[1]
    distance = np.einsum("ijp,ijp->ij", apart, np.linalg.solve(common, apart[..., None])[..., 0])
    log_overlap = 0.5 * (half[:, None] + half - np.linalg.slogdet(common)[1]) - 0.125 * distance
    np.fill_diagonal(log_overlap, -np.inf)
    return np.asarray(-np.expm1(np.minimum(log_overlap.max(axis=1), 0.0)))
