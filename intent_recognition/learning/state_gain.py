# SPDX-License-Identifier: Apache-2.0
"""Learn how the controlled agent follows the present state, from left-out demonstrations.

The residuals of a controlled agent whose start is known are regressed on the state at the moment of
the prediction (`promp.coupling`). The chosen shrinkage predicts the residuals of another
demonstration of the task best. A task has no regression unless it is better by two standard errors.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.learning.evidence_exponents import (
    N_DURATIONS,
    duration_weights,
    follow_durations,
)
from intent_recognition.learning.examples import interpolated, pose_phases, sample_phases
from intent_recognition.learning.held_out import batches_of, expected_rows, predict_agents
from intent_recognition.learning.held_out_examples import LeftOutExample
from intent_recognition.promp import LEADS, ResidualCoupling, TaskLibrary

EVERY = 3
"""Samples from one moment of prediction to the next; a displacement in the state spans two."""


class _States(NamedTuple):
    """States (n, m, F) of n demonstrations at m moments, and residuals ahead of them.

    The residuals, (n, L, m, Q), are NaN after the end.
    """

    state: Floats
    residual: Floats

    def gain(self, shrinkage: float) -> Floats:
        """Coefficients of the ridge regression, (L, Q, F); the last one is constant."""
        state = self.state[..., :-1].reshape(-1, self.state.shape[-1] - 1)
        centre, scale = state.mean(axis=0), state.std(axis=0) + 1e-300
        state, gains = (state - centre) / scale, []
        for residual in np.swapaxes(self.residual, 0, 1):
            left = residual.reshape(len(state), -1)
            within = ~np.isnan(left[:, 0])
            some, of_some = state[within], left[within]
            prior = shrinkage / len(self.state) * len(some) * np.eye(len(centre))
            slopes = np.linalg.solve(some.T @ some + prior, some.T @ of_some).T / scale
            gains.append(np.column_stack([slopes, -slopes @ centre]))
        return np.array(gains)

    def errors(self, gains: Floats) -> Floats:
        """Mean squares that a gain (L, Q, F) leaves of each demonstration, (n, L, Q)."""
        shift = np.einsum("nlqf,nmf->nlmq", gains, self.state)
        return np.asarray(np.nanmean((self.residual - shift) ** 2, axis=2))

    def gains_without(self, shrinkage: float) -> Floats:
        """`gain` without each of the demonstrations in turn, (n, L, Q, F)."""
        n = len(self.state)
        rest = (np.arange(n) != k for k in range(n))
        return np.array([_States(*(part[some] for part in self)).gain(shrinkage) for some in rest])


def learn_state_gain(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    exponent: float,
    coupling: ResidualCoupling,
    variance: Floats,
) -> Floats | None:
    """Learn the regression of each task on the present state, (K, L, Q, F); None if all have none.

    Args:
        library: provides basis, noise and timing.
        left_out: the demonstrations.
        exponent: exponent of the evidence on the duration.
        coupling: coupling of the residuals, which comes first.
        variance: divides the squared errors of the controlled DOFs, (Q,).
    """
    batches = batches_of(library, left_out, N_DURATIONS)
    parts = [_states(library, some, exponent, coupling) for some in batches]
    state, residual = (np.concatenate(part) for part in zip(*parts, strict=True))
    found = np.zeros((library.n_tasks, len(LEADS), library.n_controlled, state.shape[-1]))
    tasks = np.array([one.task for one in left_out])
    for task in np.unique(tasks):
        own = _States(state[tasks == task], residual[tasks == task])
        n, best = len(own.state), np.inf
        before = np.nanmean(own.residual**2, axis=2) / variance
        for shrinkage in (0.3, 3.0, 30.0) if n >= 4 else ():  # in demonstrations
            after = own.errors(own.gains_without(shrinkage)) / variance
            gained = np.sum(before - after, axis=(1, 2))
            clear = gained.mean() > 2.0 * gained.std(ddof=1) / np.sqrt(n)
            if clear and after.sum() < best:
                best, found[task] = after.sum(), own.gain(shrinkage)
    return found if found.any() else None


def _states(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    exponent: float,
    coupling: ResidualCoupling,
) -> _States:
    """States and residuals of demonstrations under their own tasks."""
    values, task = np.array([one.observed for one in left_out]), [one.task for one in left_out]
    decay = coupling.decay_s[task] / library.durations_s[task]
    usual = library.weight_mean[task, library.n_observed_weights :]
    usual = usual.reshape(len(task), library.n_controlled, -1)
    lasting = np.exp(-LEADS / decay[:, None])[..., None]
    states, residuals = [], []
    for followed in follow_durations(library, left_out):
        k = followed.progress.n_samples - 1
        if k % EVERY != EVERY - 1:
            continue
        ahead, at = sample_phases()[k] + LEADS, values[:, k]
        both = predict_agents(library, left_out, followed, ahead, start_known=True)
        weight = duration_weights(followed.progress.log_evidence[followed.own], exponent)
        human, robot = (np.einsum("nh,nhsd->nsd", weight, path) for path in both)
        local = np.einsum("nqp,np->nq", coupling.gain[task], at - human[:, 0])
        robot = robot + lasting * local[:, None]
        truth = np.array([interpolated(ahead, pose_phases(), one.poses) for one in left_out])
        residuals.append(np.where((ahead <= 1.0)[:, None], truth - robot, np.nan))
        _, rows = expected_rows(library, left_out, followed, ahead[:1])
        row = np.einsum("nh,nhk->nk", weight, rows.reshape(*weight.shape, -1))
        path = np.einsum("nqk,nk->nq", usual, row)
        states.append(np.hstack([at, at - values[:, k - 2], path, np.ones((len(at), 1))]))
    return _States(np.stack(states, axis=1), np.stack(residuals, axis=2))
