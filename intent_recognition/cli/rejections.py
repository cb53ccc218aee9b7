# SPDX-License-Identifier: Apache-2.0
"""Prints which parts of the recordings could not be used."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from intent_recognition.cli.console import say
from intent_recognition.errors import BagError, first_of
from intent_recognition.learning import TrainingReport
from intent_recognition.model import Frames, FromBags, mixed_frames
from intent_recognition.signals import Demonstration, Rejection, StreamFinding


def print_left_out(
    console: Console, left_out: Sequence[object], n_left_out: int | None = None
) -> None:
    """Print what could not be used and why, one line for each kind of reason."""
    lines = [f"left out {line}" for line in _folded(left_out)]
    if n_left_out is not None and n_left_out > len(left_out):
        lines.append(f"left out {n_left_out - len(left_out)} more")
    _print_lines(console, lines)


def nothing_of(argument: str, expected: str, left_out: Sequence[Rejection], cure: str) -> BagError:
    """The error that all was left out: one line per kind of reason, and each cure once."""
    alike: dict[str, list[Rejection]] = {}
    for one in left_out:
        alike.setdefault(_without_numbers(f"{one.topic}: {one.reason}"), []).append(one)
    kinds, hidden = list(alike.values())[:3], list(alike.values())[3:]
    lines = [
        str(replace(kind[0], cure="")).removesuffix(".")
        + (f" (and {len(kind) - 1} more alike)" if kind[1:] else "")
        for kind in kinds
    ]
    if more := sum(map(len, hidden)):
        lines.append(f"and {more} more")
    cures = dict.fromkeys(kind[0].cure or cure for kind in kinds) or [cure]
    return BagError.about(argument, expected, "; ".join(lines) or "none", " ".join(cures))


def _without_numbers(text: str) -> str:
    return re.sub(r"\d[\d.e+]*", "0", text)


def print_doubtful(console: Console, doubtful: Sequence[object]) -> None:
    """Print what was used but may be wrong, one line for each kind of reason."""
    _print_lines(console, [f"doubtful {line}" for line in _folded(doubtful)])


def print_mixed_frames(console: Console, frames: Frames) -> None:
    """Print which topics were recorded in several frames, one line per topic."""
    _print_lines(console, mixed_frames(frames))


def _folded(items: Sequence[object]) -> Iterator[str]:
    """One line for each item, or for all items whose reasons differ only in numbers."""
    kinds: dict[tuple[str, int], dict[str, str]] = {}
    for item in items:
        name = item.path if isinstance(item, Rejection) else str(item).partition(": ")[0]
        reason = str(item)[len(name) :]
        pattern, k = _without_numbers(reason), 0
        while name in kinds.setdefault((pattern, k), {}):
            k += 1
        kinds[pattern, k][name] = reason
    for kind in kinds.values():
        (first, reason), *others = kind.items()
        if len(kind) < 3:
            yield from (f"{name}{own}" for name, own in kind.items())
            continue
        names = [first, *(Path(name).name for name, _ in others)]
        yield f"{first_of(names, 10)}{reason}"


def _print_lines(console: Console, lines: Sequence[str]) -> None:
    for text in lines:
        say(console, text, "yellow")


def with_found(
    report: TrainingReport,
    rejections: Sequence[Rejection],
    doubts: Iterable[StreamFinding],
) -> TrainingReport:
    """Extend a report by unreadable recordings and by what is doubtful."""
    unread = [(r.path, f"{r.topic}: {r.reason}" if r.topic else r.reason) for r in rejections]
    return report._replace(rejected=(*unread, *report.rejected), doubts=tuple(doubts))


def print_found(console: Console, found: FromBags) -> None:
    """Print which parts of the bags could not be used, and why."""
    accumulated = found.accumulated
    print_left_out(console, found.rejections, found.n_rejections)
    reasons = [f"{name}: {reason}" for name, reason in accumulated.rejected]
    print_left_out(console, reasons, accumulated.n_rejected)
    print_dropped_counts(console, found.dropped)


def print_dropped(console: Console, demonstrations: Sequence[Demonstration]) -> None:
    """Print how many messages were dropped in all, by reason."""
    total: Counter[str] = Counter()
    for demonstration in demonstrations:
        total.update(demonstration.rejected)
    print_dropped_counts(console, total)


def print_dropped_counts(console: Console, total: Mapping[str, int]) -> None:
    """Print counts of dropped messages by reason."""
    if total:
        parts = ", ".join(f"{count} {reason}" for reason, count in sorted(total.items()))
        console.print(f"messages dropped: {parts}", style="yellow")
