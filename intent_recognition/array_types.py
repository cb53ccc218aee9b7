# SPDX-License-Identifier: Apache-2.0
"""Short names for array types, read-only arrays, and one-line text of objects with arrays."""

from collections.abc import Iterable
from dataclasses import fields
from reprlib import Repr
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

AClass = TypeVar("AClass", bound=type)
AValue = TypeVar("AValue")


def settle(owner: object, **values: object) -> None:
    """Set attributes of a frozen dataclass under construction; their arrays become read-only."""
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(owner, name, value)


def frozen(values: ArrayLike) -> Floats:
    """A read-only copy of numbers as an array."""
    return read_only(np.array(values, dtype=np.float64))


def read_only(value: AValue) -> AValue:
    """Make an array, or the arrays in a tuple, read-only; return the same object."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, tuple):
        for part in value:
            read_only(part)
    return value


class _Short(Repr):
    """Python's Repr, but with only the shapes of arrays, also inside of objects."""

    def __init__(self) -> None:
        super().__init__()
        self.maxother = self.maxstring = 120

    def repr_ndarray(self, array: NDArray[np.generic], level: int) -> str:
        return f"array {array.shape}" if array.ndim else repr(array[()])

    def repr_instance(self, value: object, level: int) -> str:
        names = getattr(value, "_fields", ())
        return self.fields_of(value, names) if names else super().repr_instance(value, level)

    def fields_of(self, value: object, names: Iterable[str]) -> str:
        said = ", ".join(f"{name}={self.repr(getattr(value, name))}" for name in names)
        return f"{type(value).__name__}({' '.join(said.split())})"


def brief(cls: AClass) -> AClass:
    """Class decorator for NamedTuples and dataclasses: repr on one line, with shapes of arrays."""
    names = getattr(cls, "_fields", ()) or [one.name for one in fields(cls)]

    def shown(self: object) -> str:
        return _Short().fields_of(self, names)

    cls.__repr__ = shown  # type: ignore[method-assign, assignment]
    return cls
