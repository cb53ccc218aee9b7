# SPDX-License-Identifier: Apache-2.0
"""Learn how the residuals of both agents are coupled, from left-out demonstrations.

Residuals are what the filtered weights leave unexplained. Those of the controlled agent are
regressed on those of the observed agent (`promp.coupling`). The chosen decay and shrinkage predict
the residuals of another demonstration of the task best; having no coupling is also a candidate.
"""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.promp import ResidualCoupling, residual_weights


class HeldOutResiduals(NamedTuple):
    """Residuals of n left-out demonstrations after each of f shares of the movement."""

    task: Integers  # index of each demonstration's task, (n,)
    phases: Floats  # phases of the residuals, (s,)
    seen: Floats  # shares of the movement that were seen, (f,)
    observed: Floats  # residuals of the observed agent, (f, n, s, P); used up to the seen share
    controlled: Floats  # residuals of the controlled agent, (f, n, s, Q)


class _Moments(NamedTuple):
    """Sums over phases for each of n demonstrations after each of f shares, at one decay."""

    observed: Floats  # outer products of the expected observed residuals, (f, n, P, P)
    cross: Floats  # outer products of expected observed and controlled residuals, (f, n, P, Q)
    controlled: Floats  # squares of the controlled residuals, (f, n, Q)

    def gain(self, shrinkage: float) -> Floats:
        """Ridge regression of the controlled on the observed residuals, (P, Q)."""
        total = self.observed.sum(axis=(0, 1))
        prior = shrinkage * np.diag(np.diag(total) / self.observed.shape[1] + 1e-300)
        return np.linalg.solve(total + prior, self.cross.sum(axis=(0, 1)))

    def left(self, gains: Floats) -> Floats:
        """Residual squares of each demonstration under its own gain (n, P, Q), (f, n, Q)."""
        explained = 2.0 * self.cross - self.observed @ gains
        return np.maximum(self.controlled - np.sum(gains * explained, axis=2), 0.0)

    def gains_without(self, shrinkage: float) -> Floats:
        """`gain` without each of the demonstrations in turn, (n, P, Q)."""
        n = self.observed.shape[1]
        others = (np.arange(n) != k for k in range(n))
        parts = [_Moments(*(part[:, some] for part in self)) for some in others]
        return np.array([part.gain(shrinkage) for part in parts])


def learn_coupling(
    residuals: HeldOutResiduals, variance: Floats, durations_s: Floats
) -> tuple[ResidualCoupling, Floats]:
    """Learn the coupling of each task; also return its left-out mean squared errors, (f, n, Q).

    Args:
        residuals: residuals of left-out demonstrations.
        variance: divides the squared errors of the controlled DOFs before they are added, (Q,).
        durations_s: usual duration of each task, (K,).
    """
    n_tasks, n_phases = len(durations_s), residuals.controlled.shape[2]
    found = ResidualCoupling.none(
        n_tasks, residuals.controlled.shape[-1], residuals.observed.shape[-1]
    )
    left = np.sum(residuals.controlled**2, axis=2)
    for task in np.unique(residuals.task):
        own = residuals.task == task
        if np.count_nonzero(own) < 4:
            continue
        best = np.sum(left[:, own] / variance)
        for decay in (0.02, 0.05, 0.15, 0.5):  # in durations of the movement
            moments = _moments(residuals, own, decay)
            for shrinkage in (0.3, 3.0, 30.0):  # in demonstrations
                gains = moments.gains_without(shrinkage)
                remaining = moments.left(gains)
                gained = np.sum((moments.controlled - remaining) / variance, axis=(0, 2))
                error = np.sum(remaining / variance)
                if error >= best or gained.mean() < gained.std(ddof=1) / np.sqrt(len(gained)):
                    continue
                best, left[:, own] = error, remaining
                at = _moments(residuals, own, decay, seen_only=True)
                share = 1.0 - at.left(gains).sum(axis=(0, 1)) / np.maximum(
                    at.controlled.sum(axis=(0, 1)), 1e-300
                )
                found.gain[task] = moments.gain(shrinkage).T
                found.explained[task] = np.clip(share, 0.0, 1.0 - 1e-9)
                found.decay_s[task] = decay * durations_s[task]
    return found, left / n_phases


def _moments(
    residuals: HeldOutResiduals, own: Flags, decay: float, *, seen_only: bool = False
) -> _Moments:
    parts = []
    for k, share in enumerate(residuals.seen):
        seen = residuals.phases <= share + 1e-9
        weights, _ = residual_weights(residuals.phases[seen], residuals.phases, decay)
        observed = weights @ residuals.observed[k, own][:, seen]
        controlled = residuals.controlled[k, own]
        if seen_only:
            observed, controlled = observed[:, seen], controlled[:, seen]
        turned = np.swapaxes(observed, 1, 2)
        parts.append(_Moments(turned @ observed, turned @ controlled, np.sum(controlled**2, 1)))
    return _Moments(*(np.array(part) for part in zip(*parts, strict=True)))
