# SPDX-License-Identifier: Apache-2.0
"""Streams in `intent inspect`: which recordings would be left out or are doubtful."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console

from intent_recognition.cli.rejections import print_doubtful
from intent_recognition.demonstrations import BagSummary, DofSpec, inspect_streams
from intent_recognition.errors import BagError
from intent_recognition.signals import Rejection, StreamFinding, stream_doubts


def stream_faults(
    bags: Sequence[tuple[Path, BagSummary | BagError]], root: Path, dofs: DofSpec | None
) -> dict[Path, list[StreamFinding]]:
    """What is wrong, or may be, between the streams of each bag.

    Damaged bags, of which more cannot be told, have nothing listed.
    """
    faults: dict[Path, list[StreamFinding]] = {path: [] for path, _ in bags}
    correlations, owners = [], []
    for path, summary in bags:
        if isinstance(summary, BagError) or summary.damage or summary.unfinished:
            continue
        name = str(path.relative_to(root))
        for index, found in enumerate(inspect_streams(path, dofs)):
            part = f"{name}#{index:03d}" if summary.demonstrations else name
            if isinstance(found, Rejection):
                faults[path].append(StreamFinding(part, found.reason))
            else:
                correlations.append(found._replace(name=part))
                owners.append(path)
    owner = {one.name: path for one, path in zip(correlations, owners, strict=True)}
    for doubt in stream_doubts(correlations):
        faults[owner[doubt.name]].append(doubt)
    return faults


def print_faults(console: Console, faults: Mapping[Path, Sequence[StreamFinding]]) -> None:
    """Print a line for each."""
    print_doubtful(console, [fault for found in faults.values() for fault in found])
