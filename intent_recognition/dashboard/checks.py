# SPDX-License-Identifier: Apache-2.0
"""Checks of what the page accepts from messages; each raises an ArgumentError if it fails."""

from collections.abc import Sequence, Sized

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.untrusted import LARGEST

MOST_NAMES = 100
"""Largest number of joints or tasks in a message, of nodes with health, of things in a scene and of
parts in a thing: far more than a cell has."""
LONGEST_NAME, LONGEST_SENTENCE = 200, 2000
"""Largest number of characters in a name, and in a message that is shown."""


def check(field: str, expected: str, holds: object, got: object) -> None:
    """Require that a condition on a field holds."""
    if not holds:
        cure = "`ros2 topic info --verbose` names who publishes it."
        raise ArgumentError.about(field, expected, got, cure)


def check_count(field: str, items: Sized, most: int, what: str) -> None:
    """Require that there are at most `most` items."""
    check(field, f"at most {most} {what}", len(items) <= most, len(items))


def checked_text(field: str, text: str, longest: int = LONGEST_NAME) -> str:
    """Return the text if it has at most `longest` characters."""
    check_count(field, text, longest, "characters")
    return text


def checked_names(field: str, names: Sequence[str]) -> tuple[str, ...]:
    """Return the names if there are at most `MOST_NAMES` and all differ."""
    check_count(field, names, MOST_NAMES, "names")
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    check(field, "names that differ", not twice, f"{twice[:1]} twice")
    return tuple(checked_text(field, name) for name in names)


def checked_numbers(field: str, numbers: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return the numbers as an array of this shape, finite and at most `LARGEST` in magnitude."""
    array = np.array(numbers, dtype=float)
    check(field, f"shape {shape}", array.shape == shape, f"shape {array.shape}")
    beyond = array[~(np.abs(array) <= LARGEST)]  # also NaN
    check(field, f"numbers up to {LARGEST:g}", not beyond.size, beyond[:1])
    return array
