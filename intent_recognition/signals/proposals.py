# SPDX-License-Identifier: Apache-2.0
"""Propose where to cut an unlabelled session into interactions, from motion alone.

Two agents that work together rest together between movements; onset and rest are detected by the
same rules as in training and online. The pose in which they rest first is called home. All they do
between two rests at home is one interaction, of any number of movements; the last one, if it only
returns home, is left out. If they never return home, each movement is an interaction.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Flags, Floats
from intent_recognition.signals.onset import (
    OnsetSettings,
    earliest_onset,
    latest_motion,
    peak_speed,
    windowed_velocity,
)
from intent_recognition.signals.segmentation import least_reference, onset_settings
from intent_recognition.signals.signal import Signal

STEP_S = 0.01
"""Step of the time grid on which both agents' speeds are compared [s]."""


class Span(NamedTuple):
    """A proposed part of a session."""

    start_ns: int  # onset of the observed agent's movement
    end_ns: int  # time at which both agents have come to rest


def propose_spans(observed: Sequence[Signal], controlled: Sequence[Signal]) -> list[Span]:
    """Propose where the interactions of a session begin and end.

    The signals cover the whole session, on one clock; the controlled agent may have none.
    """
    signals = (*observed, *controlled)
    # Offline, detection may be late, so that everything above the rest threshold is movement.
    settings = tuple(replace(one, start_share=one.rest_share) for one in onset_settings([signals]))
    spans: list[Span] = []
    # The reference speed is the median peak over the movements, which the first pass finds.
    for _ in range(2):
        spans = list(_movements(observed, controlled, settings))
        if not spans:
            return []
        settings = _typical(signals, spans, settings)
    return _interactions(signals, spans)


def _movements(
    observed: Sequence[Signal], controlled: Sequence[Signal], settings: Sequence[OnsetSettings]
) -> Iterator[Span]:
    signals, n_observed = (*observed, *controlled), len(observed)
    start_ns = min(int(s.stamps_ns[0]) for s in signals)
    end_ns = max(int(s.stamps_ns[-1]) for s in signals)
    grid = np.arange(0.0, (end_ns - start_ns) * 1e-9 + STEP_S, STEP_S)
    activity = np.max(
        [_activity(s, one, start_ns, grid) for s, one in zip(signals, settings, strict=True)],
        axis=0,
    )
    rest_s = max(one.rest_s for one in settings)
    for first, last in _between_rests(activity, settings[0], round(rest_s / STEP_S)):
        cut = start_ns + round(grid[first] * 1e9), start_ns + round(grid[last] * 1e9)
        span = _movement([s.between(*cut) for s in signals], n_observed, settings, cut[0])
        if span is not None:
            yield span


def _movement(
    signals: Sequence[Signal], n_observed: int, settings: Sequence[OnsetSettings], from_ns: int
) -> Span | None:
    """Span from the observed agent's onset, or else the controlled one's, until all are at rest."""
    onset_s = earliest_onset(settings[:n_observed], signals[:n_observed], from_ns)
    if onset_s is None:
        onset_s = earliest_onset(settings[n_observed:], signals[n_observed:], from_ns)
    last_s = latest_motion(settings, signals, from_ns)
    if onset_s is None or last_s is None:
        return None
    return Span(*(from_ns + round(at_s * 1e9) for at_s in (onset_s, last_s)))


def _activity(signal: Signal, settings: OnsetSettings, start_ns: int, grid: Floats) -> Floats:
    """Speed of one signal relative to its reference, interpolated on the grid."""
    times = signal.seconds(start_ns)
    speed = np.linalg.norm(windowed_velocity(times, signal.values, settings.window_s), axis=1)
    known = np.isfinite(speed)
    if not np.any(known):
        return np.zeros_like(grid)
    # The slope belongs to the middle of its window.
    middle = times[known] - 0.5 * settings.window_s
    return np.interp(grid, middle, speed[known]) / settings.reference_speed


def _between_rests(
    activity: Floats, settings: OnsetSettings, n_rest: int
) -> Iterator[tuple[int, int]]:
    """Indices of the middles of the rests before and after each movement."""
    edges = np.flatnonzero(np.diff(np.r_[0, activity < settings.rest_share, 0]))
    rests = [(a, b) for a, b in edges.reshape(-1, 2) if b - a >= n_rest]
    bounds = [0, *((a + b) // 2 for a, b in rests), len(activity) - 1]
    for first, last in pairwise(bounds):
        if last > first and np.any(activity[first:last] > settings.start_share):
            yield int(first), int(last)


def _typical(
    signals: Sequence[Signal], spans: Sequence[Span], settings: Sequence[OnsetSettings]
) -> tuple[OnsetSettings, ...]:
    """The settings with the median of the movements' peak speeds as reference."""
    found = []
    for signal, one in zip(signals, settings, strict=True):
        own = [signal.between(span.start_ns, span.end_ns) for span in spans]
        peaks = np.array(
            [peak_speed(p.seconds(spans[0].start_ns), p.values, one.window_s) for p in own]
        )
        moved = peaks[peaks > one.start_share * one.reference_speed]  # else the partner moved
        if moved.size:
            least = least_reference([signal], one.window_s)
            one = replace(one, reference_speed=max(float(np.median(moved)), least))
        found.append(one)
    return tuple(found)


def _interactions(signals: Sequence[Signal], movements: Sequence[Span]) -> list[Span]:
    """Join the movements between rests at home, leaving out the movement back."""
    stays, ends = _at_home(signals, movements)
    if not np.any(ends & ~stays):
        return list(movements)
    found: list[Span] = []
    begun: list[Span] = []
    for movement, stays_at_home, ends_at_home in zip(movements, stays, ends, strict=True):
        if stays_at_home:
            continue
        if not ends_at_home or not begun:
            begun.append(movement)
        if ends_at_home:
            found.append(Span(begun[0].start_ns, begun[-1].end_ns))
            begun = []
    return [*found, *([Span(begun[0].start_ns, begun[-1].end_ns)] if begun else [])]


def _at_home(signals: Sequence[Signal], movements: Sequence[Span]) -> tuple[Flags, Flags]:
    """Whether both agents are at home throughout each movement, and at its end, (n,) each.

    Home is the region around the first rest; its radius is Otsu's (1979) threshold of distances.
    """
    paths = [_path(signals, movement) for movement in movements]
    rests = np.array([path[[0, -1]] for path in paths])
    centre = rests[0, 0]
    stays = near = np.zeros(rests.shape[:2], dtype=bool)
    for _ in range(3):  # it usually converges in two passes
        distance = np.linalg.norm(rests - centre, axis=2)
        farthest = np.array([np.linalg.norm(path - centre, axis=1).max() for path in paths])
        limit = _two_groups(np.r_[distance.ravel(), farthest])
        stays, near = farthest <= limit, distance <= limit
        centre = np.median(rests[near], axis=0)
    return stays, near[:, 1]


def _two_groups(values: Floats) -> float:
    """Largest value of the lower group when values (n,) are split by least variance in groups."""
    ordered = np.sort(values)
    scores = [
        k * np.var(ordered[:k]) + (len(ordered) - k) * np.var(ordered[k:])
        for k in range(1, len(ordered))
    ]
    return float(ordered[int(np.argmin(scores))])


def _path(signals: Sequence[Signal], span: Span) -> Floats:
    """Path (S, P + Q) of both agents in a span, each signal relative to its own range."""
    grid = np.arange(span.start_ns, span.end_ns + 1, round(STEP_S * 1e9))
    columns = []
    for signal in signals:
        extent = float(np.linalg.norm(np.ptp(signal.values, axis=0))) or 1.0
        columns += [np.interp(grid, signal.stamps_ns, c) / extent for c in signal.values.T]
    return np.column_stack(columns)
