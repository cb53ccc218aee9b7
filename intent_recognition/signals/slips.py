# SPDX-License-Identifier: Apache-2.0
"""Find a recording that lies elsewhere than the others of its task, and the slip that explains it.

Signals are compared by landmarks: each DOF's first, last, smallest and largest value. A slip is
named if the recording lies among the others once it is undone: exchanged or negated axes or joints,
another frame, time that runs backwards, the label of another task.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, permutations, product
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.signals.turns import TURNS, whole_turns
from intent_recognition.signals.units import in_words

ODD = 3.5
"""Distance from where recordings usually are, relative to that of most, from which a slip is looked
for. Measured: docs/bags.md."""
EXPLAINED = 2.0
"""Distance from which a recording is not among the others, once its slip is undone."""
FAR = 10.0
"""Distance from which a recording is named without a slip."""
LEAST_SPREAD = 0.05
"""Least standard deviation of a landmark, relative to the extent of the movement."""
LEAST_ALIKE = 5
"""Fewest recordings of a task that tell where it lies."""


class SignalPlace(NamedTuple):
    """Where a signal of a recording lies."""

    names: tuple[str, ...]  # of the d DOFs
    unit: str
    landmarks: Floats  # first, last, smallest and largest values, (4, d)


def place_of(names: tuple[str, ...], unit: str, values: Floats) -> SignalPlace:
    """Where a signal with values (T, d) lies."""
    landmarks = np.stack([values[0], values[-1], values.min(axis=0), values.max(axis=0)])
    return SignalPlace(names, unit, landmarks)


def likely_slips(recordings: Mapping[str, Sequence[Sequence[SignalPlace]]]) -> dict[str, list[str]]:
    """Say what in each recording lies unlike the others of its task, and why.

    Args:
        recordings: of each task; a recording is the places of its signals.

    Returns:
        For each recording of each task a sentence, empty if it lies among the others.
    """
    usual = {task: _usual_places(of_task) for task, of_task in recordings.items()}
    return {
        task: [_slip(places, task, usual) for places in of_task]
        for task, of_task in recordings.items()
    }


class _Usual:
    """Where a signal lies in several recordings; angles are brought to one turn."""

    def __init__(self, recordings: Sequence[SignalPlace]):
        first = recordings[0]
        self.names, self._turn = first.names, TURNS.get(first.unit, np.nan)
        found = np.stack([one.landmarks for one in recordings])
        found -= whole_turns(found[:, :1] - first.landmarks[0], self._turn)
        self._middle = np.median(found, axis=0)
        extent = np.median(np.linalg.norm(found[:, 3] - found[:, 2], axis=1))
        std = 1.4826 * np.median(np.abs(found - self._middle), axis=0)  # of a normal distribution
        self._scale = std + max(LEAST_SPREAD * float(extent), 1e-12)
        self._usual = 1.0
        self._usual = float(np.median([self.distance(one) for one in found])) or 1.0

    def off(self, landmarks: Floats) -> Floats:
        """Differences of landmarks (4, d) from the usual ones, angles within half a turn."""
        off = landmarks - self._middle
        return off - whole_turns(off[0], self._turn)

    def distance(self, landmarks: Floats) -> float:
        """Distance of landmarks (4, d) from the usual ones, relative to that of most recordings."""
        return float(np.sqrt(np.mean(np.square(self.off(landmarks) / self._scale)))) / self._usual


def _usual_places(recordings: Sequence[Sequence[SignalPlace]]) -> list[_Usual]:
    """Where each signal usually lies in recordings of the same signals; none if these are few."""
    names = [[place.names for place in places] for places in recordings]
    same = [one for one, own in zip(recordings, names) if own == names[0]]
    return [_Usual(found) for found in zip(*same)] if len(same) >= LEAST_ALIKE else []


def _distances(places: Sequence[SignalPlace], usual: Sequence[_Usual]) -> list[float]:
    """Distance of each signal from where it usually is; none if the signals are others."""
    if [place.names for place in places] != [one.names for one in usual]:
        return []
    return [one.distance(place.landmarks) for one, place in zip(usual, places)]


def _slip(places: Sequence[SignalPlace], task: str, usual: Mapping[str, Sequence[_Usual]]) -> str:
    """The slip of a recording of a task."""
    away = _distances(places, usual[task])
    if not away or max(away) < ODD:
        return ""
    for other, theirs in usual.items():
        left = _distances(places, theirs)
        nearer = bool(left) and all(there <= here for there, here in zip(left, away))
        if nearer and max(left) < EXPLAINED:
            return f"it moves as recordings of {other} do. Likely the label of another task."
    for far, place, one in sorted(zip(away, places, usual[task]), key=lambda found: -found[0]):
        if found := _slip_of_signal(place, one, far):
            return found
    return ""


def _slip_of_signal(place: SignalPlace, usual: _Usual, away: float) -> str:
    """The slip of a signal at this distance from where it usually is."""
    if away < ODD:
        return ""
    where = f"{in_words(place.names)} lies"
    off = usual.off(place.landmarks)
    slips = *_slips(place), *_shifts(place, np.median(off, axis=0))
    undone = [(usual.distance(mended), slip) for slip, mended in slips]
    left, slip = min(undone)
    if left < EXPLAINED:
        return f"{where} elsewhere than in the task's other recordings. Likely {slip}."
    if away < FAR:
        return ""
    return (
        f"{where} up to {np.abs(off).max():.2g} {place.unit} from where it is in the task's other"
        " recordings. Likely another frame or calibration, or another way of doing the task."
    )


def _slips(place: SignalPlace) -> Iterator[tuple[str, Floats]]:
    """Slips with the landmarks as they are once the slip is undone."""
    names, landmarks = place.names, place.landmarks
    n_dofs = len(names)
    yield "time that runs backwards", landmarks[[1, 0, 2, 3]]
    if n_dofs == 3 and place.unit not in TURNS:
        for order in permutations(range(3)):
            for signs in product((1.0, -1.0), repeat=3):
                axes = [("-" if sign < 0 else "") + "xyz"[k] for sign, k in zip(signs, order)]
                slip = f"other axes: its ({', '.join(axes)}) are the others' (x, y, z)"
                yield slip, _signed(landmarks[:, order], signs)
        return
    for k in range(n_dofs):
        negated = _signed(landmarks, np.where(np.arange(n_dofs) == k, -1.0, 1.0))
        yield f"the other sign of {names[k]}", negated
    for i, j in combinations(range(n_dofs), 2):
        exchanged = landmarks.copy()
        exchanged[:, [i, j]] = landmarks[:, [j, i]]
        yield f"{names[i]} exchanged with {names[j]}", exchanged


def _shifts(place: SignalPlace, shift: Floats) -> Iterator[tuple[str, Floats]]:
    """The same for shifts (d,): of positions as a whole, of others one by one."""
    if place.unit == "m":
        yield f"another frame, {np.linalg.norm(shift):.2g} m away", place.landmarks - shift
        return
    for name, one, column in zip(place.names, shift, np.eye(len(shift))):
        slip = f"another zero of {name}, {abs(one):.2g} {place.unit} off"
        yield slip, place.landmarks - one * column


def _signed(landmarks: Floats, signs: Sequence[float] | Floats) -> Floats:
    """Landmarks (4, d) of DOFs with these signs (d,): the smallest of -x is minus the largest."""
    first, last, least, most = landmarks * signs
    return np.stack([first, last, np.minimum(least, most), np.maximum(least, most)])
