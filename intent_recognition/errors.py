# SPDX-License-Identifier: Apache-2.0
"""One family of exceptions; messages name the argument, what was expected, what came and a cure."""

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
    """Base class of all errors that this package raises on purpose.

    Attributes:
        cure: last sentence of the message, what the caller can do; may be empty.
    """

    cure: str = ""

    @classmethod
    def about(cls: type[AnError], argument: str, expected: str, got: object, cure: str) -> AnError:
        """Create the error with the message of `describe`."""
        error = cls(describe(argument, expected, got, cure))
        error.cure = cure
        return error


class ArgumentError(IntentError, ValueError):
    """A value is outside the range that a function accepts."""


class ShapeError(ArgumentError):
    """An array has the wrong shape."""


class DofError(IntentError):
    """A DOF file is malformed, or disagrees with a model or recording."""


class BagError(IntentError):
    """A recording is damaged, incomplete, or lacks what was requested."""


class MessageError(BagError):
    """A single message cannot be read, or lacks a field or joint."""


class ModelError(IntentError):
    """A model file cannot be used: unknown version, missing array, wrong shape, non-finite."""


class TrainingError(IntentError):
    """Nothing can be learned from the demonstrations."""


class TrajectoryError(IntentError):
    """A trajectory command cannot be executed as it was sent."""


class KinematicsError(IntentError):
    """A pose cannot be reached, or a joint vector is outside the limits."""


class MissingPackageError(IntentError, ImportError):
    """An optional package is not installed."""


class ResourceBusyError(IntentError):
    """A port, a ROS domain or a file is in use or cannot be opened."""


def describe(argument: str, expected: str, got: object, cure: str) -> str:
    """Build the message of an error of this package.

    Args:
        argument: name of the argument, file or topic at fault.
        expected: what would be right.
        got: what came instead.
        cure: what the caller can do, as a sentence.
    """
    said = _words(got, argument)[:2000] or "nothing"
    came = "\n".join(map(printable, said.split("\n")))
    return f"{argument}: expected {expected}, got {came.removesuffix('.')}. {cure}"


def check_type(argument: str, value: object, expected: type, cure: str) -> None:
    """Require that an argument is an instance of a class of this package.

    Raises:
        ArgumentError: it is not.
    """
    if not isinstance(value, expected):
        came = f"one of type {type(value).__name__}"
        article = "an" if expected.__name__[0] in "AEIOU" else "a"
        raise ArgumentError.about(argument, f"{article} {expected.__name__}", came, cure)


def check_whole(
    argument: str, value: object, least: int, cure: str, most: float = math.inf
) -> None:
    """Require that an argument is an integer in a range.

    Raises:
        ArgumentError: it is not.
    """
    if not (isinstance(value, Integral) and least <= number(value) <= most):
        expected = f"a whole number from {least} {'on' if most == math.inf else f'to {most}'}"
        raise ArgumentError.about(argument, expected, repr(value), cure)


def number(value: object) -> float:
    """The value if it is a number, else NaN, which is outside every range."""
    is_number = isinstance(value, Real) and not isinstance(value, bool)
    return cast(float, value) if is_number else math.nan


def as_path(argument: str, value: object) -> Path:
    """Convert an argument to a path.

    Raises:
        ArgumentError: it is not a path.
    """
    if not isinstance(value, str | PathLike):
        cure = "Pass the path of the file or folder."
        raise ArgumentError.about(argument, "a path", f"one of type {type(value).__name__}", cure)
    return Path(value)


def one_line(error: BaseException) -> str:
    """Message of an error as one printable line; the class name if it has no message."""
    return printable(" ".join(_words(error).split())) or type(error).__name__


def _words(got: object, argument: str | None = None) -> str:
    """Text of a value; for a system error its path, unless in `argument`, and its reason."""
    if not (isinstance(got, OSError) and got.strerror):
        return str(got)
    reason = got.strerror
    if argument is not None:  # the text continues a sentence
        reason = reason[0].lower() + reason[1:]
    known = got.filename is None or str(got.filename) in (argument or "")
    return reason if known else f"{got.filename}: {reason}"


def missing_package(error: ImportError) -> MissingPackageError | None:
    """The error to raise if an import failed because ROS 2 or an optional package is missing.

    None for any other failure, whose own message says more.
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
    """Import a module of an optional package (`extras.EXTRAS`).

    Raises:
        MissingPackageError: the package is not installed; says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise missing_package(error) or error from None


def printable(text: str) -> str:
    r"""Escape characters that move the cursor or colour a terminal, as in Python's literals.

    >>> print(printable("a\x1b[2Jb"))
    a\x1b[2Jb
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def first_of(names: Sequence[str], most: int = 5) -> str:
    """The first names, and the number of remaining ones, in words."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def nearest(name: str, known: Iterable[str], otherwise: str) -> str:
    """A cure for a misspelt name: the most similar known name, or else `otherwise`."""
    near = difflib.get_close_matches(name, list(known), 1)
    return f"Did you mean {near[0]}?" if near else otherwise
