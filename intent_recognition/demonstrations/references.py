# SPDX-License-Identifier: Apache-2.0
"""References of orientations: what their tangent space is attached to."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations.dofs import DofSpec
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.fields import extract_present, stamp_of
from intent_recognition.demonstrations.folders import Paths, as_paths, find_bags
from intent_recognition.demonstrations.hand_poses import hand_numbers, read_by_joints
from intent_recognition.errors import ArgumentError, BagError, DofError, describe
from intent_recognition.signals import mean_orientation

REFERENCE_BAGS = 50
"""Recordings from which the mean orientation is taken. Convention: the mean need not be exact."""


def settle_orientations(dofs: DofSpec, paths: Paths) -> DofSpec:
    """The same DOFs, with a reference for every orientation that has none: the mean of recordings.

    Args:
        dofs: topics and fields to read.
        paths: bags and folders of bags, of which at most `REFERENCE_BAGS` are read.

    Raises:
        BagError: a path does not exist.
        DofError: no recording has an orientation that was measured.
    """
    if all(entry.reference for entry in dofs.recorded if entry.orientation):
        return dofs
    bags = [bag for path in as_paths(paths) for bag in find_bags(path)]
    readers = [*map(_sound_reader, bags[:: -(-len(bags) // REFERENCE_BAGS) or 1])]

    def settled(entry: DofEntry) -> DofEntry:
        if not entry.orientation or entry.reference:
            return entry
        found = [mean for reader in readers if (mean := _mean_in(reader, entry)) is not None]
        if not found:
            got = f"none in {len(readers)} of the recordings"
            cure = "Record orientations, or give the entry a reference."
            raise DofError(describe(entry.names[0], "orientations to take the mean of", got, cure))
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
    except BagError:  # what is wrong is said when it is read
        return None


def _mean_in(reader: BagReader | None, entry: DofEntry) -> NDArray[np.float64] | None:
    """Mean orientation (4,) in a recording; None where there is none."""
    if reader is None:
        return None
    dofs, arms = read_by_joints(reader, DofSpec((), (entry,)))
    source = replace(dofs.controlled[0], orientation="")
    try:
        numbers = [
            extract_present(source, message.message)
            for message in reader.messages([source.topic])
            if stamp_of(source, message.message, message.log_time_ns) is not None
        ]
        if arms and numbers:
            return mean_orientation(hand_numbers(entry, arms[0].forward_kinematics(numbers)))
        return mean_orientation(numbers)
    except (ArgumentError, BagError):
        return None
