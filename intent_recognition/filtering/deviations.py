# SPDX-License-Identifier: Apache-2.0
"""Smoothing: the phase deviation of hypotheses at any time, given all measurements."""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import PhaseDeviation, deviation_prior, deviation_transition


class Deviations(NamedTuple):
    """Filtered phase deviation of S hypotheses at each of n measurements."""

    # times of the measurements after onset, (n,), ascending; a late one has that of the last
    times_s: Floats
    filtered: Floats  # probability of each deviation given the measurements so far, (n, S, E)
    likelihood: Floats  # tempered likelihood of each deviation, up to scale, (n, S, E)


def deviations_at(
    model: PhaseDeviation, durations_s: Floats, deviations: Deviations, times_s: Floats
) -> Floats:
    """Probability of each deviation at times after onset (T,) given all observations, (S, T, E).

    `durations_s` are the hypotheses' durations of the whole movement, (S,).
    """
    seen_s, filtered, _ = deviations
    prior = deviation_prior(model)
    if not len(seen_s) or len(prior) == 1:
        return np.tile(prior, (len(durations_s), len(times_s), 1))
    if np.all(times_s >= seen_s[-1]):
        smoothed = filtered[-1][:, None]
        seen_s = seen_s[-1:]
    else:
        smoothed = _smoothed(model, durations_s, deviations)
    after = np.clip(np.searchsorted(seen_s, times_s), 0, len(seen_s) - 1)
    before = np.maximum(after - 1, 0)
    gap = np.maximum(seen_s[after] - seen_s[before], 1e-9)
    share = np.clip((times_s - seen_s[before]) / gap, 0.0, 1.0)[:, None]
    found = (1.0 - share) * smoothed[:, before] + share * smoothed[:, after]
    future = times_s > seen_s[-1]
    passed = (times_s[future] - seen_s[-1]) / durations_s[:, None]
    found[:, future] = np.einsum("se,stef->stf", filtered[-1], deviation_transition(model, passed))
    return found


def _smoothed(model: PhaseDeviation, durations_s: Floats, deviations: Deviations) -> Floats:
    """Deviations at the measurements given all of them, (S, n, E), by backward recursion."""
    times_s, filtered, likelihood = deviations
    later, smoothed = np.ones_like(filtered[0]), []
    moved = deviation_transition(model, np.diff(times_s)[:, None] / durations_s)
    for k in range(len(times_s) - 1, -1, -1):
        now = filtered[k] * later
        smoothed.append(now / now.sum(axis=1, keepdims=True))
        if k:
            later = np.matmul(moved[k - 1], (later * likelihood[k])[..., None])[..., 0]
            later /= later.max(axis=1, keepdims=True)
    return np.stack(smoothed[::-1], axis=1)
