# SPDX-License-Identifier: Apache-2.0
"""Set the references of orientations, the base points of their tangent spaces."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from intent_recognition.array_types import Floats
from intent_recognition.bags import BagReader
from intent_recognition.demonstrations.dofs import DofSpec, is_raw_pose
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.fields import extract_present, stamp_of
from intent_recognition.demonstrations.folders import Paths, as_paths, find_bags
from intent_recognition.demonstrations.hand_poses import hand_numbers, read_by_joints
from intent_recognition.errors import ArgumentError, BagError, DofError, check_type
from intent_recognition.signals import mean_orientation
from intent_recognition.tracking import Extrinsics, IngestSettings, frame_name, multiply_quaternions


def settle_orientations(dofs: DofSpec, paths: Paths) -> DofSpec:
    """Set the missing references of orientations to the mean of the recordings.

    At most 50 bags are read, since the mean need not be exact.

    Raises:
        BagError: a path does not exist.
        DofError: no recording has a measured orientation for an entry.
    """
    check_type("dofs", dofs, DofSpec, "Read it with `load_dofs(path)`, and pass it first.")
    if all(entry.reference for entry in dofs.recorded if entry.orientation):
        return dofs
    bags = [bag for path in as_paths(paths) for bag in find_bags(path)]
    readers = [*map(_sound_reader, bags[:: -(-len(bags) // 50) or 1])]

    def settled(entry: DofEntry) -> DofEntry:
        if not entry.orientation or entry.reference:
            return entry
        found = [
            mean
            for reader in readers
            if (mean := _mean_in(reader, entry, dofs.tracker_frames)) is not None
        ]
        if not found:
            got = f"none in {len(readers)} of the recordings"
            cure = "Record orientations, or give the entry a reference."
            raise DofError.about(entry.names[0], "orientations to take the mean of", got, cure)
        return replace(entry, reference=tuple(mean_orientation(found).tolist()))

    return replace(
        dofs,
        observed=tuple(map(settled, dofs.observed)),
        controlled=tuple(map(settled, dofs.controlled)),
        context=tuple(map(settled, dofs.context)),
    )


def _sound_reader(path: Path) -> BagReader | None:
    try:
        return BagReader(path)
    except BagError:  # reported later, when its demonstrations are read
        return None


def _mean_in(
    reader: BagReader | None, entry: DofEntry, extrinsics: Extrinsics | None
) -> Floats | None:
    """Mean orientation (4,) in a recording; None if none was measured."""
    if reader is None:
        return None
    dofs, arms = read_by_joints(reader, DofSpec((), (entry,)))
    source = replace(dofs.controlled[0], orientation="")
    try:
        messages = [
            message.message
            for message in reader.messages([source.topic])
            if stamp_of(source, message.message, message.log_time_ns) is not None
        ]
        numbers = [extract_present(source, message) for message in messages]
        if arms and numbers:
            return mean_orientation(hand_numbers(entry, arms[0].forward_kinematics(numbers)))
        if extrinsics is not None and is_raw_pose(source.topic, source.type):
            numbers = _in_world(messages, numbers, IngestSettings(extrinsics=extrinsics))
        return mean_orientation(numbers)
    except (ArgumentError, BagError):
        return None


def _in_world(
    messages: Sequence[Any], quaternions: Sequence[Floats], settings: IngestSettings
) -> list[Floats]:
    """Orientations (4,) in the world of the messages whose frames are known."""
    frames = [settings.frames.get(frame_name(message.header.frame_id)) for message in messages]
    return [
        multiply_quaternions(frame.quaternion, quaternion)
        for frame, quaternion in zip(frames, quaternions, strict=True)
        if frame is not None
    ]
