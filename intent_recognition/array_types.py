# SPDX-License-Identifier: Apache-2.0
"""Short names of the arrays that most functions take and give, and what holds them on one line."""

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
    """Set attributes of a frozen dataclass that is being made; arrays cannot be written to then."""
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(owner, name, value)


def frozen(values: ArrayLike) -> Floats:
    """A copy of numbers that nobody can change."""
    return read_only(np.array(values, dtype=np.float64))


def read_only(value: AValue) -> AValue:
    """The same value; its arrays, those of a tuple too, cannot be written to from now on."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, tuple):
        for part in value:
            read_only(part)
    return value


class _Short(Repr):
    """As Python's, but for arrays, of which the shape is said, and for what holds them."""

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
    """Let a NamedTuple or a dataclass be printed on one line, of its arrays the shapes alone."""
    names = getattr(cls, "_fields", ()) or [one.name for one in fields(cls)]

    def shown(self: object) -> str:
        return _Short().fields_of(self, names)

    cls.__repr__ = shown  # type: ignore[method-assign, assignment]
    return cls
