# SPDX-License-Identifier: Apache-2.0
"""Find doubtful recordings by comparing several: lags, units, places, copies and labels.

The lag is the time by which the controlled agent follows the observed one.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from hashlib import blake2b
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.signals.demonstration import Demonstration
from intent_recognition.signals.onset import OnsetSettings, windowed_velocity
from intent_recognition.signals.signal import Signal
from intent_recognition.signals.slips import SignalPlace, likely_slips, place_of
from intent_recognition.signals.streams import LATENCY_S, recording_doubts
from intent_recognition.signals.units import Size, differing_unit, median_size, size_of

STEP_S = 0.02
"""Step between the lags of a speed correlation [s], finer than motion detection."""
LEAST_CORRELATION, LEAST_GAIN = 0.5, 0.1
"""Least speed correlation at which a lag is meaningful, and its least gain over the correlation at
the usual lag. Measured: docs/bags.md."""
LAGS_S = STEP_S * np.arange(-100, 101)
"""Lags of a `RecordingSummary.correlation`, (L,) [s]; lags beyond 2 s would shorten the overlap."""
USUAL_SPREAD = 4.0
"""Largest usual deviation of a lag, in robust standard deviations. Measured: docs/bags.md."""
LEAST_OTHERS = 5
"""Fewest other recordings that define what is usual; with three, good recordings are reported."""
EDGE_S = 0.2
"""Length of a recording's first and last part [s] in which the human usually rests."""
CUT_SPEED, REST_SPEED = 0.5, 0.2
"""Speed in that part, relative to the highest, from which a recording is cut; and up to which nine
of ten others rest. Of 295 recordings of five sets one is named; it begins at its highest speed."""
COUNTED = re.compile(r"\d+|(?<![^\W_])[^\W_](?![^\W_])")
"""Numbers and single letters, which count labels, as in `reach_2` or `reach_b`."""


class StreamFinding(NamedTuple):
    """Certain or possible fault of a recording, with the likely cause, in a sentence."""

    name: str
    reason: str

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}"


class RecordingSummary(NamedTuple):
    """What `stream_doubts` compares of a recording, small enough to keep many."""

    name: str
    task: str | None
    # correlations of both agents' speeds at the lags `LAGS_S` of the controlled one, (L,)
    correlation: Floats
    doubts: tuple[str, ...] = ()  # doubts about the recording by itself
    # digest of the observed agent's values, equal for copied recordings
    movement: bytes = b""
    # first DOF and size of the values of each signal
    sizes: tuple[tuple[str, Size], ...] = ()
    places: tuple[SignalPlace, ...] = ()  # where each signal lies
    # highest speeds in the first and last `EDGE_S`, relative to the highest of all
    edges: tuple[float, float] = (0.0, 0.0)

    @property
    def lag_s(self) -> float:
        """Lag of the highest correlation [s], positive if the controlled agent follows."""
        return float(LAGS_S[np.argmax(self.correlation)])


def summarise(recorded: Demonstration) -> RecordingSummary:
    """Summarise a recording for `stream_doubts`."""
    doubts = tuple(recording_doubts(recorded))
    digest = blake2b(digest_size=16)
    for signal in recorded.observed:
        digest.update(np.ascontiguousarray(signal.values).tobytes())
    signals = (*recorded.observed, *recorded.controlled)
    sizes = tuple((signal.names[0], size_of(signal.unit, signal.values)) for signal in signals)
    compared = () if recorded.context else signals  # a context says that places differ
    return RecordingSummary(
        recorded.name,
        recorded.task,
        _correlation(recorded),
        doubts,
        digest.digest(),
        sizes,
        tuple(place_of(one.names, one.unit, one.values) for one in compared),
        _edge_speeds(recorded.observed),
    )


def stream_doubts(summaries: Sequence[RecordingSummary]) -> list[StreamFinding]:
    """Recordings whose streams may not belong together, each with the likely cause.

    A lag is compared with those of the task's other recordings, or of all others if these are few.
    An unusual lag is only a hint, given if nothing stronger is found: an agent that reacts early or
    late looks the same.
    """
    by_name: dict[str, list[Size]] = {}
    for name, size in (named for one in summaries for named in one.sizes):
        by_name.setdefault(name, []).append(size)
    found, sizes = [], {name: median_size(sizes) for name, sizes in by_name.items()}
    slips = _slips(summaries)
    for index, one in enumerate(summaries):
        others = [*summaries[:index], *summaries[index + 1 :]]
        same = [other for other in others if str(other.task) == str(one.task)]
        compared = same if len(same) >= LEAST_OTHERS else others
        reasons = [*one.doubts] or [*_other_units(one, sizes)]
        if not reasons and one.task is not None:
            reasons += _cut_off(one, same)
        if not reasons and slips[index]:
            reasons.append(slips[index])
        if not reasons:
            reasons += _unusual_lag(one, compared)
        reasons += _same_under_another_label(one, summaries)
        found += [StreamFinding(one.name, reason) for reason in reasons]
    return found


def _other_units(one: RecordingSummary, usual: Mapping[str, Size]) -> Iterator[str]:
    """Signals whose unit differs from that in most recordings."""
    for name, size in one.sizes:
        found = differing_unit(size, usual[name])
        if found is not None:
            yield f"{name} {found.reason}"


def _cut_off(one: RecordingSummary, others: Sequence[RecordingSummary]) -> Iterator[str]:
    """Report if a recording begins or ends in motion, and others of its task do not."""
    if len(others) < LEAST_OTHERS:
        return
    usual = np.quantile([other.edges for other in others], 0.9, axis=0)
    for side, own, rest in zip(("begins", "ends"), one.edges, usual, strict=True):
        if own > CUT_SPEED and rest < REST_SPEED:
            yield (
                f"the recording {side} while the observed agent moves, at {100 * own:.0f}% of its"
                " highest speed, and the task's other recordings do not. Likely cut off."
            )


def _slips(summaries: Sequence[RecordingSummary]) -> list[str]:
    """What in each labelled recording lies unlike the others of its task; empty if nothing does."""
    by_task: dict[str, list[int]] = {}
    for index, one in enumerate(summaries):
        if one.task is not None:
            by_task.setdefault(one.task, []).append(index)
    found = likely_slips({t: [summaries[i].places for i in own] for t, own in by_task.items()})
    slips = [""] * len(summaries)
    for task, own in by_task.items():
        for index, slip in zip(own, found[task], strict=True):
            slips[index] = slip
    return slips


def _same_under_another_label(
    one: RecordingSummary, summaries: Sequence[RecordingSummary]
) -> Iterator[str]:
    """Report if a recording with the same observed movement has another label."""
    for other in summaries:
        alike = one.movement and one.movement == other.movement
        if alike and None not in (one.task, other.task) and one.task != other.task:
            yield (
                f"the observed movement is, number by number, that of {other.name}, and the labels"
                f" differ: {one.task} and {other.task}. Likely a copied recording: remove one."
            )
            return


def _unusual_lag(one: RecordingSummary, others: Sequence[RecordingSummary]) -> Iterator[str]:
    """Report if the controlled agent follows much earlier or later than in other recordings."""
    if len(others) < LEAST_OTHERS:
        return
    usual_s = np.array([other.lag_s for other in others])
    median = float(np.median(usual_s))
    spread = 1.4826 * float(np.median(np.abs(usual_s - median)))  # of a normal distribution
    away = one.lag_s - median
    best = float(one.correlation.max())
    gain = best - float(np.interp(median, LAGS_S, one.correlation))
    unusual = abs(away) > max(LATENCY_S, USUAL_SPREAD * spread)
    if unusual and best > LEAST_CORRELATION and gain > LEAST_GAIN:
        side = "later" if away > 0 else "earlier"
        yield (
            f"the controlled agent follows the observed one {abs(away):.2f} s {side} than in the"
            f" other recordings, by the correlation of their speeds ({best:.2f}). A hint, no proof:"
            " two clocks, or an agent that reacted so."
        )


def _edge_speeds(observed: Sequence[Signal]) -> tuple[float, float]:
    """Highest speeds in the first and last `EDGE_S`, relative to the highest of all."""
    found = np.zeros(2)
    for signal in observed:
        times_s = signal.seconds(int(signal.stamps_ns[0]))
        velocity = windowed_velocity(times_s, signal.values, OnsetSettings.window_s)
        speed = np.nan_to_num(np.linalg.norm(velocity, axis=1))
        edges = times_s <= EDGE_S, times_s >= times_s[-1] - EDGE_S
        highest = max(float(speed.max()), 1e-12)
        found = np.maximum(found, [speed[edge].max() / highest for edge in edges])
    return float(found[0]), float(found[1])


def _correlation(recorded: Demonstration) -> Floats:
    """Correlation of the agents' speeds at `LAGS_S`, (L,); zero if it cannot be computed."""
    none = np.zeros(len(LAGS_S))
    signals = (*recorded.observed, *recorded.controlled)
    if not recorded.controlled:
        return none
    start = max(int(signal.stamps_ns[0]) for signal in signals)
    end = min(int(signal.stamps_ns[-1]) for signal in signals)
    times_s = np.arange(0.0, (end - start) * 1e-9, STEP_S)
    if len(times_s) < len(LAGS_S) // 2:
        return none
    leading, following = (
        _speed(agent, start, times_s) for agent in (recorded.observed, recorded.controlled)
    )
    size = np.sqrt((leading @ leading) * (following @ following))
    if not size > 0.0:
        return none
    length = 2 * len(times_s)
    product = np.fft.rfft(following, length) * np.fft.rfft(leading, length).conj()
    shifts = np.round(LAGS_S / STEP_S).astype(int)
    reached = np.abs(shifts) < len(times_s)
    return np.where(reached, np.fft.irfft(product, length)[shifts % length], 0.0) / size


def _speed(agent: Sequence[Signal], start_ns: int, times_s: Floats) -> Floats:
    """Sum of the signals' speeds, each relative to its maximum, minus the sum's mean, (T,)."""
    total = np.zeros(len(times_s))
    for signal in agent:
        own_s = signal.seconds(start_ns)
        velocity = windowed_velocity(own_s, signal.values, OnsetSettings.window_s)
        speed = np.nan_to_num(np.linalg.norm(velocity, axis=1))
        total += np.interp(times_s, own_s, speed) / max(float(speed.max(initial=0.0)), 1e-12)
    return total - total.mean()


def label_doubts(recordings: Iterable[tuple[str, str | None]]) -> list[StreamFinding]:
    """Recordings whose label is rare and differs by one letter from a frequent label.

    Recordings are pairs of name and label. Case, spaces and underscores are ignored. A label is
    rare in at most two recordings; a frequent label has at least three times as many.
    """
    named = [(name, label) for name, label in recordings if label]
    counts = Counter(label for _, label in named)
    found = []
    for name, label in named:
        own, count = _plain(label), counts[label]
        if count > 2 or len(own) < 4:  # most words of three letters are close to other words
            continue
        others = {
            _plain(other): other
            for other, n in counts.items()
            if n >= 3 * count and COUNTED.findall(other) == COUNTED.findall(label)
        }
        least = 1.0 - 1.1 / len(own)  # similarity of two labels that differ by one letter
        for near in get_close_matches(own, others, 1, least):
            other = others[near]
            reason = f"{count} with the task {label}, {counts[other]} with {other}."
            found.append(StreamFinding(name, f"{reason} Did you mean {other}?"))
    return found


def _plain(label: str) -> str:
    return re.sub(r"[\W_]+", "", label.casefold())
