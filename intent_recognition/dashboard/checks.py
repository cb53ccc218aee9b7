# SPDX-License-Identifier: Apache-2.0
"""What the page takes of a message: names, numbers and texts of bounded size."""

from collections.abc import Sequence, Sized

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.untrusted import LARGEST

MOST_NAMES = 100
"""Joints or tasks of a message, nodes whose health is shown, things of a scene and parts of each.
Convention: far more than a cell has."""
LONGEST_NAME, LONGEST_SENTENCE = 200, 2000
"""Characters of a name, and of a message that is shown. Convention."""


def check(field: str, expected: str, holds: object, got: object) -> None:
    """Make sure that something holds of a field.

    Raises:
        ArgumentError: it does not.
    """
    if not holds:
        cure = "`ros2 topic info --verbose` names who publishes it."
        raise ArgumentError.about(field, expected, got, cure)


def check_count(field: str, items: Sized, most: int, what: str) -> None:
    """Make sure that there are at most so many.

    Raises:
        ArgumentError: there are more.
    """
    check(field, f"at most {most} {what}", len(items) <= most, len(items))


def checked_text(field: str, text: str, longest: int = LONGEST_NAME) -> str:
    """A text of at most so many characters.

    Raises:
        ArgumentError: it is longer.
    """
    check_count(field, text, longest, "characters")
    return text


def checked_names(field: str, names: Sequence[str]) -> tuple[str, ...]:
    """At most `MOST_NAMES` names, each another.

    Raises:
        ArgumentError: they are more, too long, or two are the same.
    """
    check_count(field, names, MOST_NAMES, "names")
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    check(field, "names that differ", not twice, f"{twice[:1]} twice")
    return tuple(checked_text(field, name) for name in names)


def checked_numbers(field: str, numbers: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Numbers of this shape, finite and not beyond `LARGEST`.

    Raises:
        ArgumentError: their shape is another, or one is not finite or too large.
    """
    array = np.array(numbers, dtype=float)
    check(field, f"shape {shape}", array.shape == shape, f"shape {array.shape}")
    beyond = array[~(np.abs(array) <= LARGEST)]  # NaN, too
    check(field, f"numbers up to {LARGEST:g}", not beyond.size, beyond[:1])
    return array
