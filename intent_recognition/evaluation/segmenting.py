# SPDX-License-Identifier: Apache-2.0
"""A session into demonstrations: where its interactions are, and, by a model, which they are."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
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
    end_ns: int  # when the last of both agents has come to rest
    task: str | None  # its label; None where no model has said one


def propose_segments(path: Path, dofs: DofSpec) -> list[Segment]:
    """Propose the interactions of a session from motion alone (`signals.propose_spans`).

    Raises:
        BagError: the session cannot be read.
    """
    session = read_whole(path, dofs)
    return [Segment(*span, None) for span in propose_spans(session.observed, session.controlled)]


def recognise_segments(path: Path, model: Model) -> list[Segment]:
    """The interactions of a session with the tasks that the online estimator takes them for.

    Where the agents do not rest in between, an interaction begins where the estimator says that
    another movement began. What is none of the tasks when it ends is left out.

    Raises:
        BagError: the session cannot be read.
    """
    session = read_whole(path, model.dofs)
    spans = propose_spans(session.observed, session.controlled)
    estimator = IntentEstimator(model.library, switching=False)  # a part is of one task
    samples = samples_of(BagReader(path), model, Counter())
    return label_spans(spans, follow(estimator, samples, Counter()))


def label_spans(spans: Sequence[Span], seen: Iterable[Estimate]) -> list[Segment]:
    """Divide spans at the onsets that an estimator found within them, and label each part.

    An onset that is nearer to a boundary than movements rest is that of what begins there.
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
    """Write segments of a session, in order of time, as demonstrations, each a bag of its own.

    They are `<name of the session>_000` and so on in the output folder. All topics are copied but
    the session's own markers. The DOFs are those by which it was segmented.

    Raises:
        ResourceBusyError: a directory exists already.
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
    parts = [
        BagPart(
            segment.start_ns + shift_ns,
            segment.end_ns + shift_ns,
            output / f"{session}_{number:03d}",
            _labels(reader.custom_data, session, segment),
        )
        for number, segment in enumerate(segments)
    ]
    markers = [name for name in reader.topics if f"/{name}".endswith(f"/{MARKER_TOPIC}")]
    for part in parts:  # before anything is written
        if part.path.exists():
            cure = "Choose another folder."
            raise ResourceBusyError.about("output", "no bag of that name", part.path, cure)
    cut_bag(reader, parts, markers)
    return [part.path for part in parts]


def _labels(custom_data: Mapping[str, str], session: str, segment: Segment) -> dict[str, str]:
    """Labels of a segment's bag: the session's, but for those of the whole of it."""
    labels = {key: value for key, value in custom_data.items() if key not in ("task", "tasks")}
    labels["session"] = session
    return labels | ({"task": segment.task} if segment.task else {})
