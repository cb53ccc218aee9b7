# SPDX-License-Identifier: Apache-2.0
"""Check that the streams of one recording belong together: overlap, clocks and units."""

from collections.abc import Iterator, Mapping
from typing import Protocol

import numpy as np

from intent_recognition.array_types import Flags, Floats
from intent_recognition.signals.onset import earliest_onset
from intent_recognition.signals.segmentation import LEAST_RATE_HZ, onset_settings
from intent_recognition.signals.signal import Signal
from intent_recognition.signals.units import Known, in_words, misfit, scene_misfit, time_misfit

LARGEST_MISSING_SHARE = 0.1
"""Largest share of the observed recording that a controlled stream may miss after the human's onset
or at the end. Recorders cause at most 0.085 in the shipped recordings."""
LATENCY_S = 0.25
"""Shift between streams above which it is reported [s], longer than the latency of trackers."""
LEAST_EXTENT = {"m": 0.01, "rad": 0.01}
"""Extent below which an agent has not moved [m, rad], several times the noise of trackers and
encoders."""


class _Recorded(Protocol):
    """Attributes of a `Demonstration` used here, since `Demonstration` imports this module."""

    @property
    def source(self) -> str: ...
    @property
    def observed(self) -> tuple[Signal, ...]: ...
    @property
    def controlled(self) -> tuple[Signal, ...]: ...
    @property
    def context(self) -> tuple[Signal, ...]: ...
    @property
    def start_ns(self) -> int: ...
    @property
    def end_ns(self) -> int: ...
    @property
    def known(self) -> tuple[Known | None, ...]: ...
    @property
    def wrapped(self) -> tuple[str, ...]: ...
    @property
    def delays_s(self) -> tuple[float, ...]: ...
    @property
    def rejected(self) -> Mapping[str, int]: ...


def stream_defect(recorded: _Recorded) -> str:
    """Why a recording cannot be used for learning or scoring, with the likely cause; else empty.

    The controlled agent must have been recorded while the observed one moved: nothing is
    extrapolated.
    """
    certain = (reason for is_certain, reason in _misfits(recorded) if is_certain)
    return next(certain, "") or _missing(recorded)


def common_span(recorded: _Recorded) -> tuple[int, int]:
    """The part of [start_ns, end_ns] in which all controlled streams were recorded."""
    first = [int(signal.stamps_ns[0]) for signal in recorded.controlled]
    last = [int(signal.stamps_ns[-1]) for signal in recorded.controlled]
    return max([recorded.start_ns, *first]), min([recorded.end_ns, *last])


def recording_doubts(recorded: _Recorded, *, brief: bool = False) -> list[str]:
    """Doubts about a usable recording, each with the likely cause.

    With `brief`, doubts about a unit have the same text in all recordings.
    """
    clock = [*_shifted_clock(recorded)] or [*_shifted_edges(recorded)]
    return [
        *(clock or _in_part(recorded)),
        *_holes(recorded),
        *(said for one in recorded.observed for said in sparse(one)),
        *(said for one in (*recorded.observed, *recorded.controlled) for said in zeros(one)),
        *_found_late(recorded),
        *(reason for is_certain, reason in _misfits(recorded, brief) if not is_certain),
        *_resting(recorded),
        *_wrapped(recorded),
    ]


def _wrapped(recorded: _Recorded) -> Iterator[str]:
    if recorded.wrapped:
        yield (
            f"{', '.join(recorded.wrapped)} jumps by 2 pi: a wrapped angle. It is taken as"
            " continuous; publish the angle without wrapping it where the driver can."
        )


def _misfits(recorded: _Recorded, brief: bool = False) -> Iterator[tuple[bool, str]]:
    """For each signal that is hardly in its unit, whether this is certain, and why."""
    signals = (*recorded.observed, *recorded.controlled)
    for late in filter(None, map(time_misfit, signals)):
        if late.certain:  # `sparse` reports the others
            yield late.certain, late.reason
    of_arms = recorded.known or (None,) * len(recorded.controlled)
    known = (*[None] * len(recorded.observed), *of_arms)
    found = [(one, misfit(one, of)) for one, of in zip(signals, known, strict=True)]
    found += [(one, scene_misfit(one)) for one in recorded.context]
    sides = ["observed"] * len(recorded.observed) + ["controlled"] * len(recorded.controlled)
    sides += ["context"] * len(recorded.context)
    for (signal, odd), side in zip(found, sides, strict=True):
        if odd is not None:
            short = brief and odd.likely
            said = f"{in_words(signal.names)}: {short}" if short else odd.reason
            from_arrays = not recorded.source and np.isfinite(odd.factor)
            said += f" Or pass their unit as {side}_unit." if from_arrays else ""
            yield odd.certain, said


def _missing(recorded: _Recorded) -> str:
    """Report a controlled stream that misses too much of the observed recording; else empty."""
    start_ns, end_ns = recorded.start_ns, recorded.end_ns
    length = max(end_ns - start_ns, 1)
    onset_ns = start_ns + round((_onset_s(recorded) or 0.0) * 1e9)
    for signal in recorded.controlled:
        if not len(signal.stamps_ns):
            return f"{in_words(signal.names)} has no sample while the human was observed"
        first, last = int(signal.stamps_ns[0]), int(signal.stamps_ns[-1])
        if first > end_ns or last < start_ns:
            away_s = max(first - end_ns, start_ns - last) * 1e-9
            edge = f"ends {away_s:.3g} s before they begin"
            edge = f"begins {away_s:.3g} s after they end" if first > end_ns else edge
            return (
                f"{in_words(signal.names)} does not overlap with the observed streams: it"
                f" {edge}. Likely two clocks: synchronise them (chrony), or stamp both"
                " streams on one machine."
            )
        late, early = first - onset_ns, end_ns - last
        if max(late, early) <= LARGEST_MISSING_SHARE * length:
            continue
        share = (min(last, end_ns) - max(first, start_ns)) / length
        missed = LARGEST_MISSING_SHARE * length
        where = [f"begins {late * 1e-9:.2f} s after the human's movement"] * (late > missed)
        where += [f"ends {early * 1e-9:.2f} s before they do"] * (early > missed)
        cause = "a stream that stopped early or started late"
        if last - first > length - missed:
            cause = "two clocks, since it is as long as they are"
        return (
            f"{in_words(signal.names)} covers {share:.0%} of the observed streams: it"
            f" {' and '.join(where)}. Likely {cause}: record again."
        )
    return ""


def _onset_s(recorded: _Recorded) -> float | None:
    """Onset of the human's first movement [s after the start], None if there is none."""
    settings = onset_settings([recorded.observed])
    return earliest_onset(settings, recorded.observed, recorded.start_ns)


def _shifted_clock(recorded: _Recorded) -> Iterator[str]:
    """Report controlled streams whose delay from stamp to log time differs from the human's."""
    if not recorded.delays_s:
        return
    n_observed = len(recorded.observed)
    reference = float(np.median(recorded.delays_s[:n_observed]))
    for signal, delay_s in zip(recorded.controlled, recorded.delays_s[n_observed:], strict=True):
        shift = reference - delay_s
        if abs(shift) > LATENCY_S:
            side = "ahead of" if shift > 0 else "behind"
            yield (
                f"the stamps of {in_words(signal.names)} are {abs(shift):.2f} s {side} those of the"
                " observed streams received at the same time. Likely two clocks: synchronise them."
            )


def _shifted_edges(recorded: _Recorded) -> Iterator[str]:
    """Report controlled streams whose start and end differ from the observed by an equal shift."""
    for signal in recorded.controlled:
        begins_s = (int(signal.stamps_ns[0]) - recorded.start_ns) * 1e-9
        ends_s = (int(signal.stamps_ns[-1]) - recorded.end_ns) * 1e-9
        alike = abs(ends_s - begins_s) < 0.5 * LATENCY_S
        if alike and min(abs(begins_s), abs(ends_s)) > LATENCY_S:
            side = "later" if begins_s > 0 else "earlier"
            yield (
                f"{in_words(signal.names)} begins and ends {abs(begins_s):.2f} s {side} than"
                " the observed streams. Likely two clocks: synchronise them."
            )


def _in_part(recorded: _Recorded) -> Iterator[str]:
    """Report if one agent was recorded in only a part of the other's recording."""
    if not recorded.controlled:
        return
    first = max(int(signal.stamps_ns[0]) for signal in recorded.controlled)
    last = min(int(signal.stamps_ns[-1]) for signal in recorded.controlled)
    late_s, early_s = (recorded.start_ns - first) * 1e-9, (last - recorded.end_ns) * 1e-9
    limit_s = LARGEST_MISSING_SHARE * max(recorded.end_ns - recorded.start_ns, last - first) * 1e-9
    parts = [f"begin {late_s:.2f} s later"] if late_s > limit_s else []
    parts += [f"end {early_s:.2f} s earlier"] if early_s > limit_s else []
    if parts:
        yield (
            f"the observed streams {' and '.join(parts)} than the controlled ones, and only what"
            " both show is used. Likely a tracker that lost the body, or two clocks."
        )
    if -late_s > limit_s:
        yield (
            f"the controlled streams begin {-late_s:.2f} s later than the observed ones, before the"
            " human moves. Likely a driver that started late, or two clocks."
        )


def _holes(recorded: _Recorded) -> Iterator[str]:
    """Report streams with long gaps, and recordings with many stamps that went back."""
    signals = (*recorded.observed, *recorded.controlled)
    length_ns = recorded.end_ns - recorded.start_ns
    for signal in signals:
        steps_ns = np.diff(signal.between(recorded.start_ns, recorded.end_ns).stamps_ns)
        hole_ns = steps_ns.max(initial=0)
        if hole_ns > LARGEST_MISSING_SHARE * length_ns and hole_ns > 3.0 * np.median(steps_ns):
            yield (
                f"{in_words(signal.names)} has no sample for {hole_ns * 1e-9:.2f} s,"
                f" {hole_ns / length_ns:.0%} of the recording, and is interpolated there. Likely a"
                " tracker that lost the body, a driver that stopped, or a clock that was set."
            )
    late = recorded.rejected.get("stamp_not_increasing", 0)
    if late > LARGEST_MISSING_SHARE * (late + sum(len(s.stamps_ns) for s in signals)):
        yield (
            f"{late} messages have stamps not later than those before, and are left out. Likely a"
            " clock that was set back, or messages that were recorded twice."
        )


def sparse(signal: Signal) -> list[str]:
    """Report a signal whose rate is too low to detect an onset; empty if there is none."""
    steps_ns = np.diff(signal.stamps_ns)
    rate_hz = 1e9 / np.median(steps_ns) if len(steps_ns) else np.inf
    if rate_hz >= LEAST_RATE_HZ - 1e-6:
        return []
    if np.any(steps_ns % 10**9):
        return [
            f"{in_words(signal.names)} was sampled at {rate_hz:.2g} Hz, and no movement is found"
            f" online below {LEAST_RATE_HZ:.2g} Hz. Record it at 10 Hz or more."
        ]
    return [
        f"the times of {in_words(signal.names)} are whole seconds. Likely milliseconds, or"
        " numbers of samples, for seconds: correct the times."
    ]


def zeros(signal: Signal) -> list[str]:
    """Report samples in `hidden_rows`, and positions that are zero in every sample."""
    if len(signal.names) < 2 or not signal.values.size:
        return []
    if not signal.values.any():  # joints of a simulation may stay at zero
        said = "is at exactly zero in every sample. Likely it was never seen."
        said = f"{in_words(signal.names)} {said}"
        return [said] if signal.unit == "m" else []
    hidden = hidden_rows(signal.values)
    number = signal.values[hidden.argmax(), 0]
    if not hidden.any() or (number != 0.0 and signal.unit != "m"):
        return []
    return [
        f"{in_words(signal.names)} is at exactly {f'{number:.6g}' if number else 'zero'} in"
        f" {hidden.sum()} of {hidden.size} samples, and jumps there. Likely nothing was measured"
        " then: leave these samples out."
    ]


def hidden_rows(places: Floats, never_zero: bool = False) -> Flags:
    """Which rows (T,) of values (T, d) hold a number that stands for nothing measured.

    Such a number, as zero or -9999, is in every column, and the values jump to it and from it. With
    `never_zero`, rows of zeros need not be jumped to, if there are other rows.
    """
    known = np.isfinite(places).all(axis=1)
    same = known & np.all(places == places[:, :1], axis=1)
    numbers, counts = np.unique(places[same, 0], return_counts=True)
    hidden = same & np.isin(places[:, 0], numbers[counts == counts.max(initial=0)][:1])
    if not (never_zero and np.all(places[hidden] == 0.0)):
        steps = np.linalg.norm(np.diff(places[known], axis=0), axis=1)
        edge = np.diff(hidden[known])
        usual = steps[~edge].max(initial=0.0)  # of a movement, also to zero
        hidden &= hidden.sum() + 2 < known.sum() and np.all(steps[edge] > 3.0 * usual)
    return hidden & (not np.array_equal(hidden, known))


def _found_late(recorded: _Recorded) -> Iterator[str]:
    """Report if the onset is detected only after much of the movement, or never."""
    onset_s, shares = _onset_s(recorded), []
    for signal in recorded.observed:
        extent = float(np.ptp(signal.values, axis=0).max(initial=0.0))
        if extent <= LEAST_EXTENT.get(signal.unit, 0.0):
            continue
        until = signal.seconds(recorded.start_ns) <= (np.inf if onset_s is None else onset_s)
        before = np.ptp(signal.values[until], axis=0).max() if until.any() else 0.0
        shares.append(float(before) / extent)
    if shares and min(shares) > 0.2:  # a reach is detected within 2 % of its path
        yield (
            f"the observed movement is found only after {min(shares):.0%} of its way: it is too"
            " slow beside its noise. Likely a very long task: divide it, or record it faster."
        )


def _resting(recorded: _Recorded) -> Iterator[str]:
    """Report agents that do not move: no task can be learned from a human at rest."""
    for agent, signals, cause in (
        ("observed", recorded.observed, "a tracker that lost the body, or another unit"),
        ("controlled", recorded.controlled, "a driver that repeats itself, or an arm switched off"),
    ):
        moved = [s for s in signals if len(s.values)]
        extents = [float(np.ptp(signal.values, axis=0).max()) for signal in moved]
        if not moved or any(
            extent > LEAST_EXTENT.get(signal.unit, 0.0)
            for extent, signal in zip(extents, moved, strict=True)
        ):
            continue
        most = ", ".join(f"{e:.3g} {s.unit}" for e, s in zip(extents, moved, strict=True))
        yield f"the {agent} agent does not move (by {most} at most). Likely {cause}."
