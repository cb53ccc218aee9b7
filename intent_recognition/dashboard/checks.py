# SPDX-License-Identifier: Apache-2.0
"""What the page takes of a message: names, numbers and texts of bounded size."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError

LONGEST_NAME = 200
"""Characters of a name. Convention."""
LARGEST = 1e6
"""Largest magnitude of a number that is drawn [m or rad]: single precision draws it to 0.1.
Convention."""


def check(field: str, expected: str, holds: object, got: object) -> None:
    """Make sure that something holds of a field.

    Raises:
        ArgumentError: it does not.
    """
    if not holds:
        raise ArgumentError.about(field, expected, got, "See what publishes it.")


def checked_text(field: str, text: str, longest: int = LONGEST_NAME) -> str:
    """A text of at most so many characters.

    Raises:
        ArgumentError: it is longer.
    """
    check(field, f"at most {longest} characters", len(text) <= longest, len(text))
    return text


def checked_names(field: str, names: Sequence[str], most: int) -> tuple[str, ...]:
    """So many names at most, each another.

    Raises:
        ArgumentError: they are more, too long, or two are the same.
    """
    check(field, f"at most {most} names", len(names) <= most, len(names))
    check(field, "names that differ", len(set(names)) == len(names), "one twice")
    return tuple(checked_text(field, name) for name in names)


def checked_numbers(field: str, numbers: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Numbers of this shape, finite and not beyond `LARGEST`.

    Raises:
        ArgumentError: their shape is another, or one is not finite or too large.
    """
    array = np.array(numbers, dtype=float)
    check(field, f"shape {shape}", array.shape == shape, f"shape {array.shape}")
    within = np.all(np.abs(array) <= LARGEST)  # false for NaN
    check(field, f"numbers up to {LARGEST:g}", within, "others")
    return array
