# SPDX-License-Identifier: Apache-2.0
"""Whether a task is another one whose label was misspelt."""

import re
from collections import Counter
from collections.abc import Iterable
from difflib import get_close_matches

from intent_recognition.signals.lags import StreamFinding

COUNTED = re.compile(r"\d+|(?<![^\W_])[^\W_](?![^\W_])")
"""What counts labels: `reach_2` is not `reach_1`, nor `reach_b` `reach_a`."""


def label_doubts(recordings: Iterable[tuple[str, str | None]]) -> list[StreamFinding]:
    """Recordings, by name and label, of a rare task whose label is one letter off a frequent one's.

    Upper case, spaces and underscores do not count. Rare are two recordings at most, frequent three
    times as many.
    """
    named = [(name, label) for name, label in recordings if label]
    counts = Counter(label for _, label in named)
    found = []
    for name, label in named:
        own, count = _plain(label), counts[label]
        if count > 2 or len(own) < 4:  # most words of three letters have others beside them
            continue
        others = {
            _plain(other): other
            for other, n in counts.items()
            if n >= 3 * count and COUNTED.findall(other) == COUNTED.findall(label)
        }
        least = 1.0 - 1.1 / len(own)  # the ratio of two labels of which one letter differs
        for near in get_close_matches(own, others, 1, least):
            other = others[near]
            reason = f"{count} with the task {label}, {counts[other]} with {other}."
            found.append(StreamFinding(name, f"{reason} Did you mean {other}?"))
    return found


def _plain(label: str) -> str:
    return re.sub(r"[\W_]+", "", label.casefold())
