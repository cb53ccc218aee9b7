# SPDX-License-Identifier: Apache-2.0
"""Splits a session into demonstrations: finds its interactions and labels them with a model."""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import islice, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intent_recognition.bags import BagPart, BagReader, cut_bag
from intent_recognition.demonstrations import (
    MARKER_TOPIC,
    DofSpec,
    clock_shift_ns,
    read_whole,
    stamp_of,
)
from intent_recognition.errors import ResourceBusyError
from intent_recognition.evaluation.replaying import follow, samples_of
from intent_recognition.model import Model
from intent_recognition.promp import NONE
from intent_recognition.recognition import Estimate, IntentEstimator
from intent_recognition.signals import OnsetSettings, Span, propose_spans


class Segment(NamedTuple):
    """One interaction of a session."""

    start_ns: int  # onset of the human's movement
    end_ns: int  # stamp at which both agents have come to rest
    task: str | None  # label; None without a model


def propose_segments(path: Path, dofs: DofSpec) -> list[Segment]:
    """Propose the interactions of a session by motion alone (`signals.propose_spans`).

    Raises:
        BagError: the session cannot be read.
    """
    session = read_whole(path, dofs)
    return [Segment(*span, None) for span in propose_spans(session.observed, session.controlled)]


def recognise_segments(path: Path, model: Model) -> list[Segment]:
    """Find the interactions of a session and label them with the online estimator.

    If the agents do not rest in between, an interaction starts where the estimator detects a new
    onset. A movement that is unknown at its end is left out.

    Raises:
        BagError: the session cannot be read.
    """
    session = read_whole(path, model.dofs)
    spans = propose_spans(session.observed, session.controlled)
    estimator = IntentEstimator(model.library, switching=False)  # one task per part
    samples = samples_of(BagReader(path), model, Counter())
    return label_spans(spans, follow(estimator, samples, Counter()))


def label_spans(spans: Sequence[Span], seen: Iterable[Estimate]) -> list[Segment]:
    """Divide spans at the onsets that an estimator found within them, and label each part.

    An onset closer to a boundary than the shortest rest belongs to the part that starts there.
    """
    rest_ns = round(OnsetSettings.rest_s * 1e9)
    moving = [one for one in seen if one.moving]
    stamps = np.array([one.stamp_ns for one in moving], dtype=np.int64)
    onsets = np.array([one.onset_ns for one in moving], dtype=np.int64)
    found = []
    for span in spans:
        within = np.unique(onsets[(stamps > span.start_ns) & (stamps <= span.end_ns)])
        inner = within[
            (within > span.start_ns + rest_ns) & (within < span.end_ns - rest_ns)
        ].tolist()
        bounds = [span.start_ns, *inner, span.end_ns]
        for start_ns, end_ns in pairwise(bounds):
            last = int(np.searchsorted(stamps, end_ns, side="right")) - 1
            if last >= 0 and stamps[last] > start_ns and moving[last].task != NONE:
                found.append(Segment(start_ns, end_ns, moving[last].task))
    return found


def write_segments(
    path: Path, dofs: DofSpec, segments: Sequence[Segment], output: Path
) -> list[Path]:
    """Write segments of a session, in order of time, as demonstrations with a bag each.

    The bags are named `<name of the session>_000` and so on. They hold all topics except the
    session's own markers. `dofs` are those used for the segmentation.

    Raises:
        ResourceBusyError: a directory already exists.
    """
    reader = BagReader(path)
    entries = {entry.topic: entry for entry in dofs.observed}
    messages = islice(reader.messages(entries), 100)
    stamps = (
        (m.log_time_ns, stamp_of(entries[m.topic.lstrip("/")], m.message, m.log_time_ns))
        for m in messages
    )
    shift_ns = clock_shift_ns(np.array([a - b for a, b in stamps if b is not None], np.int64))
    session = path.resolve().name.removesuffix(".mcap")
    labels = {k: v for k, v in reader.custom_data.items() if k not in ("task", "tasks")}
    labels["session"] = session
    parts = [
        BagPart(
            segment.start_ns + shift_ns,
            segment.end_ns + shift_ns,
            output / f"{session}_{number:03d}",
            labels | ({"task": segment.task} if segment.task else {}),
        )
        for number, segment in enumerate(segments)
    ]
    markers = [name for name in reader.topics if f"/{name}".endswith(f"/{MARKER_TOPIC}")]
    for part in parts:  # check all before writing any
        if part.path.exists():
            cure = "Choose another folder."
            raise ResourceBusyError.about("output", "no bag of that name", part.path, cure)
    cut_bag(reader, parts, markers)
    return [part.path for part in parts]
