# SPDX-License-Identifier: Apache-2.0
"""One exception family; messages name the argument, what was expected, what came and the cure."""

import difflib
import importlib
import math
from collections.abc import Iterable, Sequence
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar, cast

from intent_recognition.extras import installing

AnError = TypeVar("AnError", bound="IntentError")


class IntentError(Exception):
    """Base of every error this package raises on purpose.

    Attributes:
        cure: last sentence of the message, what the caller can do; empty where it has none.
    """

    cure: str = ""

    @classmethod
    def about(cls: type[AnError], argument: str, expected: str, got: object, cure: str) -> AnError:
        """The error with the message of `describe`, from its four parts."""
        error = cls(describe(argument, expected, got, cure))
        error.cure = cure
        return error


class ArgumentError(IntentError, ValueError):
    """A value is outside what the function can take."""


class ShapeError(ArgumentError):
    """An array has the wrong shape."""


class DofError(IntentError):
    """A DOF file is malformed, or disagrees with a model or a recording."""


class BagError(IntentError):
    """A recording is damaged, incomplete or does not hold what was asked of it."""


class MessageError(BagError):
    """A single message cannot be read or lacks a field or a joint."""


class ModelError(IntentError):
    """A model file cannot be used: unknown version, missing array, wrong shape, non-finite."""


class TrainingError(IntentError):
    """The demonstrations cannot be learned from."""


class TrajectoryError(IntentError):
    """A trajectory command cannot be executed as it was sent."""


class KinematicsError(IntentError):
    """A pose cannot be reached, or a joint vector is outside the limits."""


class MissingPackageError(IntentError, ImportError):
    """An optional package is not installed."""


class ResourceBusyError(IntentError):
    """A port, a ROS domain or a file is in use or cannot be opened."""


def describe(argument: str, expected: str, got: object, cure: str) -> str:
    """Build the message every error of this package carries.

    Args:
        argument: name of the argument, file or topic at fault.
        expected: what would have been right.
        got: what came instead.
        cure: what the caller can do about it, as a sentence.
    """
    said = _words(got, argument)[:2000] or "nothing"
    came = "\n".join(map(printable, said.split("\n")))
    return f"{argument}: expected {expected}, got {came.removesuffix('.')}. {cure}"


def check_type(argument: str, value: object, expected: type, cure: str) -> None:
    """Make sure that an argument is of a class of this package.

    Raises:
        ArgumentError: it is of another.
    """
    if not isinstance(value, expected):
        came = f"one of type {type(value).__name__}"
        article = "an" if expected.__name__[0] in "AEIOU" else "a"
        raise ArgumentError.about(argument, f"{article} {expected.__name__}", came, cure)


def check_whole(
    argument: str, value: object, least: int, cure: str, most: float = math.inf
) -> None:
    """Make sure that an argument is a whole number in a range.

    Raises:
        ArgumentError: it is not.
    """
    if not (isinstance(value, Integral) and least <= number(value) <= most):
        expected = f"a whole number from {least} {'on' if most == math.inf else f'to {most}'}"
        raise ArgumentError.about(argument, expected, repr(value), cure)


def number(value: object) -> float:
    """A number as it is; for what is none NaN, which is in no range."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    return cast(float, value) if is_number else math.nan


def as_path(argument: str, value: object) -> Path:
    """An argument as a path.

    Raises:
        ArgumentError: it is none.
    """
    if not isinstance(value, str | PathLike):
        cure = "Pass where the file or the folder is."
        raise ArgumentError.about(argument, "a path", f"one of type {type(value).__name__}", cure)
    return Path(value)


def one_line(error: BaseException) -> str:
    """The message of an error on one printable line; the name of its class if it has none."""
    return printable(" ".join(_words(error).split())) or type(error).__name__


def _words(got: object, argument: str | None = None) -> str:
    """What came; of an error of the system its path, unless the argument says it, and reason."""
    if not (isinstance(got, OSError) and got.strerror):
        return str(got)
    reason = got.strerror
    if argument is not None:  # inside of a sentence
        reason = reason[0].lower() + reason[1:]
    known = got.filename is None or str(got.filename) in (argument or "")
    return reason if known else f"{got.filename}: {reason}"


def missing_package(error: ImportError) -> MissingPackageError | None:
    """What to say of an import that failed because an optional package, or ROS 2, is not there.

    None of any other: the error tells more than we could.
    """
    if isinstance(error, MissingPackageError):
        return error
    module = (error.name or "").partition(".")[0]
    if module.endswith(("rclpy", "_msgs", "_srvs", "_interfaces")):
        cure = "Source it, or pip install .[ros]."
        return MissingPackageError.about(module, "ROS 2 Jazzy", error, cure)
    if (package := installing(module)) is None:
        return None
    got = "none" if isinstance(error, ModuleNotFoundError) else error
    name, extra = package
    cure = f"Install it: pip install {name}, or .[{extra}] in a checkout."
    return MissingPackageError.about(module, f"the package {name}", got, cure)


def optional(module: str) -> Any:
    """A module of a package that not everybody needs (`extras.EXTRAS`).

    Raises:
        MissingPackageError: it is not installed; says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise missing_package(error) or error from None


def printable(text: str) -> str:
    r"""A text without what moves a cursor or colours a terminal: such characters as Python writes
    them.

    >>> print(printable("a\x1b[2Jb"))
    a\x1b[2Jb
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def first_of(names: Sequence[str], most: int = 5) -> str:
    """Names in words, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def nearest(name: str, known: Iterable[str], otherwise: str) -> str:
    """The cure against a misspelt name: the one that it is most like, if there is one."""
    near = difflib.get_close_matches(name, list(known), 1)
    return f"Did you mean {near[0]}?" if near else otherwise
