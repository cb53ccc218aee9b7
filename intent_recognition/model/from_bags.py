# SPDX-License-Identifier: Apache-2.0
"""Statistics of the demonstrations in bags, accumulated in this process or in others.

A bounded, evenly spaced sample of the bags is read first and determines the preprocessing. The
other bags are reduced to statistics where they are read. The division of the bags does not depend
on who does the work, so neither does the result.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

from intent_recognition.bags import POSE
from intent_recognition.demonstrations import (
    DofSpec,
    find_bags,
    is_raw_pose,
    iter_demonstrations,
    no_bag,
)
from intent_recognition.learning import (
    BATCH,
    NAMES_KEPT,
    REFERENCE_RECORDINGS,
    Accumulated,
    Preprocessing,
    Trained,
    TrainingSettings,
    accumulate,
    merge_accumulated,
    slips_of,
)
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import (
    Demonstration,
    RecordingSummary,
    Rejection,
    StreamFinding,
    stream_doubts,
    summarise,
)

FRAMES = "frames"
"""Key of the frames in the provenance."""

Frames = Mapping[str, tuple[str, ...]]
"""Sorted names of the frames of poses, by topic."""


def merge_frames(parts: Iterable[Frames]) -> dict[str, tuple[str, ...]]:
    """Union of the frames of each topic."""
    merged: dict[str, set[str]] = {}
    for part in parts:
        for topic, frames in part.items():
            merged.setdefault(topic, set()).update(frames)
    return {topic: tuple(sorted(frames)[:10]) for topic, frames in sorted(merged.items())}


def frames_of(library: TaskLibrary) -> dict[str, tuple[str, ...]]:
    """Frames in which a library was learned; empty if unknown."""
    kept = library.provenance.get(FRAMES)
    if not isinstance(kept, Mapping):
        return {}
    return {
        str(topic): tuple(map(str, frames))
        for topic, frames in kept.items()
        if isinstance(frames, (list, tuple))
    }


def with_frames(trained: Trained, frames: Frames) -> Trained:
    """Trained state with the frames of further demonstrations added."""
    merged = merge_frames([frames_of(trained.library), frames])
    provenance = {**trained.library.provenance, FRAMES: merged}
    return replace(trained, library=replace(trained.library, provenance=provenance))


def mixed_frames(frames: Frames) -> list[str]:
    """A sentence for each topic recorded in several frames, or for all topics of `mocap_ingest`."""
    tracked = [topic for topic in frames if is_raw_pose(topic, POSE)]
    groups = [tracked, *([topic] for topic in frames if topic not in tracked)]
    sentences = []
    for topics in groups:
        found = sorted({frame for topic in topics for frame in frames[topic]})
        if len(found) > 1:
            sentences.append(
                f"{', '.join(topics)}: recorded in the frames {', '.join(found)}, and learned as"
                " if they were one. Write `extrinsics` in the DOF file, or record in one frame."
            )
    return sentences


T = TypeVar("T")
R = TypeVar("R")
Run = Callable[[Callable[[T], R], Iterable[T]], Iterator[R]]
"""Applies a function to items, here or elsewhere, and yields results in order like `map`."""


class FromBags(NamedTuple):
    """Statistics of the demonstrations in bags, and what was left out."""

    accumulated: Accumulated
    # reasons why bags, or parts of them, were left out; limited to the first ones
    rejections: tuple[Rejection, ...] = ()
    n_rejections: int = 0
    dropped: Mapping[str, int] = Counter()  # number of dropped messages, by reason
    # summaries of the recordings, for `stream_doubts`; limited to the first ones
    summaries: tuple[RecordingSummary, ...] = ()
    frames: Frames = merge_frames(())  # frames of the poses

    def doubts(self, trained: Trained) -> list[StreamFinding]:
        """What is doubtful in them, also beside all that `trained` was learned from."""
        doubts = stream_doubts(self.summaries)
        others = {one.name for one in self.summaries} - {doubt.name for doubt in doubts}
        slips = slips_of(trained.tasks, trained.preprocessing)
        return [*doubts, *(slip for slip in slips if slip.name in others)]

    def plus(self, other: "FromBags") -> "FromBags":
        """Combine both."""
        return FromBags(
            merge_accumulated(self.accumulated, other.accumulated),
            (self.rejections + other.rejections)[:NAMES_KEPT],
            self.n_rejections + other.n_rejections,
            Counter(self.dropped) + Counter(other.dropped),
            (self.summaries + other.summaries)[:NAMES_KEPT],
            merge_frames([self.frames, other.frames]),
        )


def accumulate_bags(
    paths: Sequence[Path],
    dofs: DofSpec,
    settings: TrainingSettings,
    *,
    preprocessing: Preprocessing | None = None,
    run: Run = map,
    progress: Callable[[int], None] = lambda n_bags: None,
) -> FromBags:
    """Statistics of all demonstrations below `paths`.

    A given `preprocessing` brings its own settings; without one it is determined here. `run`
    applies the work to the bags like `map`; `progress` is called with the number of bags processed
    since its last call.

    Raises:
        BagError: a path does not exist.
    """
    bags, empty = list_bags(paths)
    total = FromBags(Accumulated(preprocessing, {}), tuple(empty)[:NAMES_KEPT], len(empty))
    while total.accumulated.preprocessing is None and bags:
        head, bags = split_evenly(bags, REFERENCE_RECORDINGS)
        total = total.plus(_collect(run(partial(read_bag, dofs), head), settings, progress))
    settled = total.accumulated.preprocessing
    if settled is None:  # no usable recording
        return total
    parts = [bags[start : start + BATCH] for start in range(0, len(bags), BATCH)]
    work = partial(accumulate_part, dofs, settled)
    for part, found in zip(parts, run(work, parts), strict=True):
        total = total.plus(found)
        progress(len(part))
    return total


def list_bags(paths: Iterable[Path]) -> tuple[list[Path], list[Rejection]]:
    """All bags below `paths`, each once, and the folders without any.

    Raises:
        BagError: a path does not exist.
    """
    bags, empty = [], []
    for path in paths:
        found = find_bags(Path(path))
        bags += [bag.absolute() for bag in found]
        if not found:
            empty.append(no_bag(Path(path)))
    return [*{bag.resolve(): bag for bag in bags}.values()], empty


def split_evenly(items: Sequence[T], n: int) -> tuple[list[T], list[T]]:
    """At most n of the items, evenly spaced, and the remaining items; both in order."""
    if len(items) <= n:
        return list(items), []
    taken = {k * len(items) // n for k in range(n)}
    others = [item for index, item in enumerate(items) if index not in taken]
    return [items[index] for index in sorted(taken)], others


def read_bag(dofs: DofSpec, bag: Path) -> list[Demonstration | Rejection]:
    """Demonstrations and rejections of one bag."""
    return list(iter_demonstrations([bag], dofs))


def accumulate_part(dofs: DofSpec, preprocessing: Preprocessing, bags: Sequence[Path]) -> FromBags:
    """Statistics of some bags, read one after another."""
    contents = (read_bag(dofs, bag) for bag in bags)
    return _collect(contents, preprocessing.settings, lambda n_bags: None, preprocessing)


def _collect(
    contents: Iterable[list[Demonstration | Rejection]],
    settings: TrainingSettings,
    progress: Callable[[int], None],
    preprocessing: Preprocessing | None = None,
) -> FromBags:
    """Statistics of the demonstrations read from each bag."""
    rejections: list[Rejection] = []
    dropped: Counter[str] = Counter()
    summaries: list[RecordingSummary] = []
    frames: Frames = {}

    def demonstrations() -> Iterator[Demonstration]:
        nonlocal frames
        for content in contents:
            for found in content:
                if isinstance(found, Rejection):
                    rejections.append(found)
                else:
                    dropped.update(found.rejected)
                    frames = merge_frames([frames, found.frames])
                    if len(summaries) < NAMES_KEPT:
                        summaries.append(summarise(found))
                    yield found
            progress(1)

    accumulated = accumulate(demonstrations(), settings, preprocessing)
    kept = tuple(rejections[:NAMES_KEPT])
    return FromBags(accumulated, kept, len(rejections), dropped, tuple(summaries), frames)
