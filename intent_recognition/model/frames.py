# SPDX-License-Identifier: Apache-2.0
"""In which frames the observed poses of a model were learned; its provenance keeps them."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from intent_recognition.bags import POSE
from intent_recognition.demonstrations import is_raw_pose
from intent_recognition.learning import Trained
from intent_recognition.promp import TaskLibrary

FRAMES = "frames"
"""Key of the provenance."""

Frames = Mapping[str, tuple[str, ...]]
"""By observed topic the frames its poses are in, sorted."""


def merge_frames(parts: Iterable[Frames]) -> dict[str, tuple[str, ...]]:
    """All frames of each topic."""
    merged: dict[str, set[str]] = {}
    for part in parts:
        for topic, frames in part.items():
            merged.setdefault(topic, set()).update(frames)
    return {topic: tuple(sorted(frames)[:10]) for topic, frames in sorted(merged.items())}


def frames_of(library: TaskLibrary) -> dict[str, tuple[str, ...]]:
    """Frames in which a library was learned; nothing where that is not known."""
    kept = library.provenance.get(FRAMES)
    if not isinstance(kept, Mapping):
        return {}
    return {
        str(topic): tuple(map(str, frames))
        for topic, frames in kept.items()
        if isinstance(frames, (list, tuple))
    }


def with_frames(trained: Trained, frames: Frames) -> Trained:
    """What was learned, with the frames of further demonstrations."""
    merged = merge_frames([frames_of(trained.library), frames])
    provenance = {**trained.library.provenance, FRAMES: merged}
    return replace(trained, library=replace(trained.library, provenance=provenance))


def mixed_frames(frames: Frames) -> list[str]:
    """A sentence for each topic, and for all of `mocap_ingest`, recorded in several frames."""
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
