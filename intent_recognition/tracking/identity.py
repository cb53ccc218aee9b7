# SPDX-License-Identifier: Apache-2.0
"""Which person each tracked body belongs to, whatever label the tracker gives it.

Each person's position is followed by a Kalman filter of constant velocity; the bodies of a frame
are assigned to the persons by global nearest neighbours: the assignment of the largest likelihood
(Blackman and Popoli 1999, *Design and Analysis of Modern Tracking Systems*, 6.4). The tracker's
labels are no evidence in that, for a tracker that exchanges two people keeps both labels. Labels
name the persons who are new, and those found again after `LOST_S`.
"""

import math
from collections.abc import Mapping
from itertools import chain, combinations, count
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from intent_recognition.array_types import Floats

LOST_S = 0.5
"""A person who was not seen for longer [s] is a new one when seen again. Convention: the default
`timeout` of `primitive_activation`, after which nothing goes on as before."""
UNKNOWN_S = 0.6
"""Time for which two who cannot be told apart are nobody [s]. Convention: longer than `LOST_S`, so
that what was believed of them is forgotten everywhere."""
NOBODY = ""
"""The person of a body whose person is not known."""

NEW = -math.log(1e-3)
"""Negative log-likelihood of somebody new in a frame. Convention: some ten people a minute."""
ACCELERATION_STD_M_S2 = 2.0
"""Of a tracked point between two frames, and while it is not seen [m/s^2]. Moving hands of the
shipped toolbox demonstrations imply 0.65 over gaps of 0.1 s and 0.3 over 0.3 s; with 1.5 exchanges
of people who reach in 1 s went unnoticed, with 5 more people cannot be told apart
(docs/several_people.md)."""
POSITION_STD_M = 0.004
"""Of the tracker [m]. Convention: twice that of `IngestSettings`; with it the squared innovations
of the shipped toolbox demonstrations have a mean of 0.2, of 3."""


class Track(NamedTuple):
    """A person who is followed: the tracker's label and the stamp of the last sight.

    Mean position [m] and velocity [m/s] then are (2, 3), the covariance along each axis (2, 2).
    """

    person: str
    label: str
    stamp_ns: int
    mean: Floats
    covariance: Floats


class Identities(NamedTuple):
    """What is remembered between frames, at first nothing; never modified.

    Labels of persons who cannot be told apart are unknown until a time. So far `n_undone` exchanges
    of the tracker were undone, and `n_unknown` times two could not be told apart.
    """

    tracks: tuple[Track, ...] = ()
    unknown_until_ns: Mapping[str, int] = {}
    n_undone: int = 0
    n_unknown: int = 0


def identify(
    people: Identities, stamp_ns: int, positions: Mapping[str, Floats]
) -> tuple[Identities, dict[str, str]]:
    """Assign the bodies of a frame to people.

    Args:
        people: what the last call returned, or `Identities()`.
        stamp_ns: of the frame; later than the last one's.
        positions: of a point of each body that was seen (3,) [m], by the tracker's label.

    Returns:
        What to remember, and the person of each label: `NOBODY` where two cannot be told apart.
    """
    held = {k: until for k, until in people.unknown_until_ns.items() if until > stamp_ns}
    known = [t for t in people.tracks if stamp_ns - t.stamp_ns <= LOST_S * 1e9]
    seen = {label: at for label, at in positions.items() if label not in held}
    ahead = [_predicted(track, stamp_ns) for track in known]
    labels = list(seen)
    costs, columns = _assignment(ahead, [seen[label] for label in labels])
    unsure = _alike(costs, columns, math.log(1000.0))
    tracks, found = [], dict.fromkeys(positions, NOBODY)
    for k, (track, at) in enumerate(zip(known, ahead, strict=True)):
        label = labels[columns[k]] if columns[k] < len(labels) else ""
        if k in unsure:
            until = stamp_ns + round(UNKNOWN_S * 1e9)
            held |= dict.fromkeys({track.label, label} - {""}, until)
        elif label:
            tracks.append(_corrected(at, label, seen[label]))
            found[label] = track.person
        else:
            tracks.append(track)
    before = {track.person: track.label for track in known}
    exchanged = any(
        track.label != before[track.person] and track.label in before.values() for track in tracks
    )
    for label in labels:
        # a label that leaps farther than anybody moves is nobody's, until its person is lost
        if found[label] or label in held or any(track.label == label for track in tracks):
            continue
        found[label] = _name(label, tracks, positions)
        mean, covariance = np.stack([seen[label], np.zeros(3)]), np.diag([POSITION_STD_M**2, 1.0])
        tracks.append(Track(found[label], label, stamp_ns, mean, covariance))
    found |= dict.fromkeys(held.keys() & found.keys(), NOBODY)
    undone, unknown = people.n_undone + exchanged, people.n_unknown + bool(unsure)
    return Identities(tuple(tracks), held, undone, unknown), found


def _name(label: str, tracks: list[Track], labels: Mapping[str, object]) -> str:
    """What a new person is called: as its label, or as one whose label another person has now."""
    taken = {track.person for track in tracks}
    numbered = (f"{label}_{k}" for k in count(2))
    return next(name for name in chain([label], sorted(labels), numbered) if name not in taken)


def _predicted(track: Track, stamp_ns: int) -> Track:
    """Where a person is by now; the acceleration is one draw, also while it was not seen."""
    dt_s = (stamp_ns - track.stamp_ns) * 1e-9
    move = np.array([[1.0, dt_s], [0.0, 1.0]])
    pushed = ACCELERATION_STD_M_S2 * np.array([0.5 * dt_s**2, dt_s])
    covariance = move @ track.covariance @ move.T + np.outer(pushed, pushed)
    return track._replace(stamp_ns=stamp_ns, mean=move @ track.mean, covariance=covariance)


def _corrected(track: Track, label: str, position: Floats) -> Track:
    variance = track.covariance[0, 0] + POSITION_STD_M**2
    gain = track.covariance[:, 0] / variance
    mean = track.mean + np.outer(gain, position - track.mean[0])
    covariance = track.covariance - np.outer(gain, gain) * variance
    return track._replace(label=label, mean=mean, covariance=covariance)


def _assignment(tracks: list[Track], positions: list[Floats]) -> tuple[Floats, list[int]]:
    """Negative log-likelihoods (n, m + n), and the best column of each of n tracks.

    Columns are the m positions, then "not seen" for each track. A position left over is of a new
    person.
    """
    n, m = len(tracks), len(positions)
    costs = np.full((n + m, m + n), np.inf)
    costs[n:, m:] = 0.0
    np.fill_diagonal(costs[:n, m:], -math.log(0.05))  # the tracker does not see a person
    np.fill_diagonal(costs[n:, :m], NEW)
    for i, track in enumerate(tracks):
        variance = track.covariance[0, 0] + POSITION_STD_M**2
        density = 1.5 * math.log(2.0 * math.pi * variance)
        for j, position in enumerate(positions):
            off = position - track.mean[0]
            costs[i, j] = 0.5 * float(off @ off) / variance + density
    columns = linear_sum_assignment(costs)[1] if n + m else np.empty(0, dtype=int)
    return costs[:n], columns[:n].tolist()


def _alike(costs: Floats, columns: list[int], least: float) -> set[int]:
    """Tracks that could as well be exchanged with another one, or with somebody new."""
    n = len(columns)
    m = costs.shape[1] - n
    alike = {
        i for i, j in enumerate(columns) if j < m and NEW + costs[i, m + i] - costs[i, j] < least
    }
    for i, k in combinations(range(n), 2):
        now = costs[i, columns[i]] + costs[k, columns[k]]
        # Not seen is a column of each track's own.
        of_i = columns[k] if columns[k] < m else m + i
        of_k = columns[i] if columns[i] < m else m + k
        if min(columns[i], columns[k]) < m and costs[i, of_i] + costs[k, of_k] - now < least:
            alike |= {i, k}
    return alike
