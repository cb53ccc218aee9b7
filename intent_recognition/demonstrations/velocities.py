# SPDX-License-Identifier: Apache-2.0
"""Measured velocities in the DOF file: which observed DOFs they are of, and what is no evidence."""

from collections.abc import Sequence
from typing import Protocol

from intent_recognition.errors import DofError, describe


class Entry(Protocol):
    """What is asked of an entry of the DOF file."""

    topic: str
    names: tuple[str, ...]
    of: tuple[str, ...]


def place_of(
    observed: Sequence[Entry], names: tuple[str, ...]
) -> tuple[int, tuple[int, ...]] | None:
    """The observed entry that has all these DOFs, and which of its DOFs they are."""
    for group, entry in enumerate(observed):
        if set(names) <= set(entry.names):
            return group, tuple(entry.names.index(name) for name in names)
    return None


def check_velocities(observed: Sequence[Entry], velocities: Sequence[Entry], source: str) -> None:
    """Every velocity belongs to one DOF, and none is differentiated from its own evidence.

    Raises:
        DofError: names the entry and the key.
    """
    tracked = {entry.topic for entry in observed}
    for k, entry in enumerate(velocities):
        place = f"{source}: velocities[{k}]"
        if len(entry.of) != len(entry.names) or len(set(entry.of)) != len(entry.of):
            expected = f"{len(entry.names)} different names, one for each field or joint"
            raise _error(f"{place}: of", expected, ", ".join(entry.of))
        if place_of(observed, entry.of) is None:
            raise _error(f"{place}: of", "DOFs of one observed entry", ", ".join(entry.of))
        *before, kind, body = ["", *entry.topic.split("/")]
        if kind == "human" and "/".join([*before[1:], "mocap", body, "pose"]) in tracked:
            raise _error(
                f"{place}: topic",
                "velocities measured independently",
                f"{entry.topic}, differentiated from the same poses",
            )


def _error(argument: str, expected: str, got: object) -> DofError:
    return DofError(describe(argument, expected, got, "Correct the file; docs/bags.md shows one."))
