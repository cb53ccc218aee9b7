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
from itertools import chain, count
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from intent_recognition.array_types import Floats

LOST_S = 0.5
"""Time without observations after which a person counts as new [s], equal to the default `timeout`
after which `primitive_activation` stops the arm."""
UNKNOWN_S = 0.6
"""Time for which indistinguishable people are `NOBODY` [s], longer than `LOST_S`, so that all nodes
forget the previous beliefs about them."""
NOBODY = ""
"""The person of a body whose person is not known."""

NEW = -math.log(1e-3)
"""Negative log-likelihood of a new person in a frame, for about ten new people per minute. Lost
people are expected until they are no likelier than that anywhere, for about 2 s."""
DISTINCT = math.log(1000.0)
"""Difference of negative log-likelihoods from which an assignment is certain."""
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
    """A tracked body, with the tracker's label and stamp of the last observation.

    `mean` holds position [m] and velocity [m/s] at that time, (2, 3); `covariance` is that along
    each axis, (2, 2). An indistinguishable body is nobody's until `unknown_until_ns` (otherwise 0).
    After that, or unseen for `LOST_S`, it has no `person`, and is a new one's when seen.
    """

    person: str
    label: str
    stamp_ns: int
    mean: Floats
    covariance: Floats
    unknown_until_ns: int = 0


class Identities(NamedTuple):
    """Immutable state between frames, initially empty.

    So far, `n_undone` frames undid an exchange of the tracker, and in `n_unknown` people were
    indistinguishable.
    """

    tracks: tuple[Track, ...] = ()
    n_undone: int = 0
    n_unknown: int = 0


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
    before = [_forgotten(track, stamp_ns) for track in people.tracks]
    ahead = [_predicted(track, stamp_ns) for track in before]
    expected = [k for k, at in enumerate(ahead) if _density(at) < NEW]
    before, ahead = [before[k] for k in expected], [ahead[k] for k in expected]
    missed = [UNSEEN if stamp_ns - t.stamp_ns > UNSEEN_S * 1e9 else MISSED for t in before]
    labels = list(positions)
    costs = _costs(ahead, missed, [positions[label] for label in labels])
    columns = _assignment(costs)
    known = {k: t for k, t in enumerate(before) if t.person and not t.unknown_until_ns}
    unsure = _unsure(costs, columns, list(known)) & set(range(len(before)))
    until_ns = stamp_ns + round(UNKNOWN_S * 1e9)
    tracks = []
    for k, (track, at) in enumerate(zip(before, ahead, strict=True)):
        if columns[k] < len(labels):
            track = _corrected(at, labels[columns[k]], positions[labels[columns[k]]])
        tracks.append(track._replace(unknown_until_ns=until_ns) if k in unsure else track)
    moved = {tracks[k].label for k in known.keys() - unsure if tracks[k].label != before[k].label}
    exchanged = moved & {track.label for track in known.values()}
    # a label that jumps farther than people move is nobody's until its person is lost
    occupied = {t.label for t in tracks if t.person or t.stamp_ns == stamp_ns}
    tracks += [
        _born(label, stamp_ns, positions[label]) for label in labels if label not in occupied
    ]
    found = dict.fromkeys(positions, NOBODY)
    for k, track in enumerate(tracks):
        if track.stamp_ns == stamp_ns and not track.unknown_until_ns:
            person = track.person or _name(track.label, {t.person for t in tracks}, positions)
            tracks[k] = track._replace(person=person)
            found[track.label] = person
    undone, unknown = people.n_undone + bool(exchanged), people.n_unknown + bool(unsure)
    return Identities(tuple(tracks), undone, unknown), found


def _forgotten(track: Track, stamp_ns: int) -> Track:
    """Without its person once all nodes have forgotten them."""
    lost = stamp_ns - track.stamp_ns > LOST_S * 1e9
    if lost or 0 < track.unknown_until_ns <= stamp_ns:
        return track._replace(person="", unknown_until_ns=0)
    return track


def _born(label: str, stamp_ns: int, position: Floats) -> Track:
    mean = np.stack([position, np.zeros(3)])
    return Track("", label, stamp_ns, mean, np.diag([POSITION_STD_M**2, 1.0]))


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


def _density(track: Track) -> float:
    """Negative log-likelihood of an observation where the track is expected."""
    variance = track.covariance[0, 0] + POSITION_STD_M**2
    return 1.5 * math.log(2.0 * math.pi * variance)


def _costs(tracks: list[Track], missed: list[float], positions: list[Floats]) -> Floats:
    """Negative log-likelihoods (n + m, m + n) of assigning n tracks, then m new people.

    The columns are the m positions, then "not seen" for each track.
    """
    n, m = len(tracks), len(positions)
    costs = np.full((n + m, m + n), np.inf)
    costs[n:, m:] = 0.0
    np.fill_diagonal(costs[:n, m:], missed)
    np.fill_diagonal(costs[n:, :m], NEW)
    seen = np.reshape(positions, (m, 3))
    for i, track in enumerate(tracks):
        variance = track.covariance[0, 0] + POSITION_STD_M**2
        squares = np.sum((seen - track.mean[0]) ** 2, axis=1)
        costs[i, :m] = 0.5 * squares / variance + _density(track)
    return costs


def _assignment(costs: Floats) -> list[int]:
    """The column of each row in the likeliest assignment."""
    return linear_sum_assignment(costs)[1].tolist() if costs.size else []


def _unsure(costs: Floats, columns: list[int], known: list[int]) -> set[int]:
    """Rows that change in an assignment that is hardly less likely, and changes one of `known`."""
    rows, unsure = range(len(columns)), set()
    best = costs[rows, columns].sum()
    for k in known:
        others = costs.copy()
        others[k, columns[k]] = 1e9
        other = _assignment(others)
        if others[rows, other].sum() - best < DISTINCT:
            unsure |= {row for row in rows if other[row] != columns[row]}
    return unsure
