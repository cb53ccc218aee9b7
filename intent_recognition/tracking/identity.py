# SPDX-License-Identifier: Apache-2.0
"""Assign tracked bodies to people, independently of the tracker's labels.

A constant-velocity Kalman filter tracks the position of each person. The bodies of a frame are
assigned to people by global nearest neighbours, the assignment of the largest likelihood (Blackman
and Popoli 1999, *Design and Analysis of Modern Tracking Systems*, 6.4). The tracker's labels are
not used as evidence, since a tracker that exchanges two people keeps both labels. They only name
people who are new or seen again after `LOST_S`.
"""

import math
from collections.abc import Mapping
from itertools import chain, combinations, count
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from intent_recognition.array_types import Floats

LOST_S = 0.5
"""Time without observations after which a person counts as new [s], equal to the default `timeout`
after which `primitive_activation` stops the arm."""
UNKNOWN_S = 0.6
"""Time for which two indistinguishable people are both `NOBODY` [s], longer than `LOST_S`, so that
all nodes forget the previous beliefs about them."""
NOBODY = ""
"""The person of a body whose person is not known."""

NEW = -math.log(1e-3)
"""Negative log-likelihood of a new person in a frame, for about ten new people per minute."""
RETURNING, RETURN_S = -math.log(0.02), 2.0
"""Negative log-likelihood of a new person if somebody was lost or became `NOBODY` in the last 2 s:
hidden people are seen again after about a second (docs/several_people.md)."""
UNSEEN_S, UNSEEN, MISSED = 0.1, -math.log(0.9), -math.log(0.05)
"""Negative log-likelihoods that a frame misses a person who was last seen more than 0.1 s ago
(`UNSEEN`) or since (`MISSED`): a hidden person stays hidden for a while."""
ACCELERATION_STD_M_S2 = 2.0
"""Standard deviation of a tracked point's acceleration between observations [m/s^2]. Moving hands
in the shipped toolbox demonstrations imply 0.65 over gaps of 0.1 s and 0.3 over 0.3 s. With 1.5,
exchanges of people who reach in 1 s went unnoticed; with 5, more people are indistinguishable
(docs/several_people.md)."""
POSITION_STD_M = 0.004
"""Standard deviation of the tracker's noise [m], twice that of `IngestSettings`. The normalised
squared innovations of the shipped toolbox demonstrations have a mean of 0.2 (3 if consistent)."""


class Track(NamedTuple):
    """A tracked person, with the tracker's label and stamp of the last observation.

    `mean` holds position [m] and velocity [m/s] at that time, (2, 3); `covariance` is that along
    each axis, (2, 2).
    """

    person: str
    label: str
    stamp_ns: int
    mean: Floats
    covariance: Floats


class Identities(NamedTuple):
    """Immutable state between frames, initially empty.

    Labels of indistinguishable people have no person until `unknown_until_ns`. So far, `n_undone`
    frames undid an exchange of the tracker, and in `n_unknown` people were indistinguishable.
    Until `returning_until_ns`, a new body may be a person who was lost or indistinguishable.
    """

    tracks: tuple[Track, ...] = ()
    unknown_until_ns: Mapping[str, int] = {}
    n_undone: int = 0
    n_unknown: int = 0
    returning_until_ns: int = 0


def identify(
    people: Identities, stamp_ns: int, positions: Mapping[str, Floats]
) -> tuple[Identities, dict[str, str]]:
    """Assign the bodies of a frame to people.

    Args:
        people: state returned by the last call, or `Identities()`.
        stamp_ns: stamp of the frame, later than that of the last one.
        positions: position (3,) [m] of a point of each observed body, by the tracker's label.

    Returns:
        The new state, and the person of each label: `NOBODY` for one that is indistinguishable
        from others, or that leaps.
    """
    held = {k: until for k, until in people.unknown_until_ns.items() if until > stamp_ns}
    known = [t for t in people.tracks if stamp_ns - t.stamp_ns <= LOST_S * 1e9]
    seen = {label: at for label, at in positions.items() if label not in held}
    ahead = [_predicted(track, stamp_ns) for track in known]
    labels = list(seen)
    later, returning = stamp_ns + round(RETURN_S * 1e9), people.returning_until_ns
    returning = later if len(known) < len(people.tracks) else returning
    new = RETURNING if stamp_ns < returning else NEW
    missed = [UNSEEN if stamp_ns - t.stamp_ns > UNSEEN_S * 1e9 else MISSED for t in known]
    costs, columns = _assignment(ahead, missed, [seen[label] for label in labels], new)
    unsure = _alike(costs, columns, new, math.log(1000.0))
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
        # a label that jumps farther than people move is nobody's until its person is lost
        if found[label] or label in held or any(track.label == label for track in tracks):
            continue
        found[label] = _name(label, {*held, *(track.person for track in tracks)}, positions)
        mean, covariance = np.stack([seen[label], np.zeros(3)]), np.diag([POSITION_STD_M**2, 1.0])
        tracks.append(Track(found[label], label, stamp_ns, mean, covariance))
    found |= dict.fromkeys(held.keys() & found.keys(), NOBODY)
    undone, unknown = people.n_undone + exchanged, people.n_unknown + bool(unsure)
    return Identities(tuple(tracks), held, undone, unknown, later if unsure else returning), found


def _name(label: str, taken: set[str], labels: Mapping[str, object]) -> str:
    """Name of a new person: the label, or else a label or numbered name that nobody has."""
    numbered = (f"{label}_{k}" for k in count(2))
    return next(name for name in chain([label], sorted(labels), numbered) if name not in taken)


def _predicted(track: Track, stamp_ns: int) -> Track:
    """Predict a track, with one random acceleration that is constant since the last observation."""
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


def _assignment(
    tracks: list[Track], missed: list[float], positions: list[Floats], new: float
) -> tuple[Floats, list[int]]:
    """Negative log-likelihoods (n, m + n), and the best column for each of n tracks.

    The columns are the m positions, then "not seen" for each track. A position that is not assigned
    belongs to a new person.
    """
    n, m = len(tracks), len(positions)
    costs = np.full((n + m, m + n), np.inf)
    costs[n:, m:] = 0.0
    np.fill_diagonal(costs[:n, m:], missed)
    np.fill_diagonal(costs[n:, :m], new)
    for i, track in enumerate(tracks):
        variance = track.covariance[0, 0] + POSITION_STD_M**2
        density = 1.5 * math.log(2.0 * math.pi * variance)
        for j, position in enumerate(positions):
            off = position - track.mean[0]
            costs[i, j] = 0.5 * float(off @ off) / variance + density
    columns = linear_sum_assignment(costs)[1] if n + m else np.empty(0, dtype=int)
    return costs[:n], columns[:n].tolist()


def _alike(costs: Floats, columns: list[int], new: float, least: float) -> set[int]:
    """Tracks whose exchange with another track or a new person costs less than `least` more."""
    n = len(columns)
    m = costs.shape[1] - n
    alike = {
        i for i, j in enumerate(columns) if j < m and new + costs[i, m + i] - costs[i, j] < least
    }
    for i, k in combinations(range(n), 2):
        now = costs[i, columns[i]] + costs[k, columns[k]]
        # Each track has its own column for "not seen".
        of_i = columns[k] if columns[k] < m else m + i
        of_k = columns[i] if columns[i] < m else m + k
        if min(columns[i], columns[k]) < m and costs[i, of_i] + costs[k, of_k] - now < least:
            alike |= {i, k}
    return alike
