# SPDX-License-Identifier: Apache-2.0
"""Safe reading of untrusted files: regular files of bounded size; YAML, JSON, XML and arrays.

Every defect of a file raises an `UntrustedError`, whose text says what was found; the caller adds
the file's name, what was expected and the cure.
"""

import json
import math
import re
import stat
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeVar
from xml.etree import ElementTree as ET

import numpy as np
import yaml
from numpy.typing import NDArray

from intent_recognition.errors import ArgumentError, ModelError, describe

Content = TypeVar("Content")

MOST_TEXT = 4_000_000
"""Largest YAML or JSON text [bytes]; the metadata of a thousand topics take 0.7 MB."""
DEEPEST = 32
"""Deepest nesting of YAML and XML; a DOF file has 4 levels, a URDF 5, metadata.yaml 7."""
MOST_NODES = 100_000
"""Largest number of YAML nodes, including those repeated by aliases, or XML elements; a thousand
topics take 60 000, a thousand links 20 000."""
MOST_MESH = 200_000_000
"""Largest mesh or cloud [bytes]: four million triangles."""
MOST_ARRAYS = 2**29
"""Largest size of all unpacked arrays in an `.npz` [bytes]; a model of ten tasks takes 0.02 GB."""
LARGEST = 1e6
"""Largest magnitude of a length, angle, mass or inertia, in SI units: beyond any arm or map, and
still drawn to within 0.1 in single precision."""
LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The C loader if PyYAML has it, which is ten times as fast."""


class UntrustedError(ValueError):
    """A file does not have the expected content; the text says what was found."""


def check_regular(path: Path, most_bytes: int | None = None) -> None:
    """Require that a path is a regular file of bounded size: no FIFO, device or folder.

    Args:
        path: path of the file.
        most_bytes: largest size; None for any.

    Raises:
        OSError: the path does not exist or is not accessible.
        UntrustedError: it is not a regular file, or too large.
    """
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        raise UntrustedError("a folder" if stat.S_ISDIR(found.st_mode) else "no regular file")
    if most_bytes is not None and found.st_size > most_bytes:
        raise UntrustedError(f"{found.st_size} bytes, more than {most_bytes}")


def read_text(path: Path, most_bytes: int = MOST_TEXT) -> str:
    """Read a text file.

    Raises:
        OSError: the file cannot be read.
        UntrustedError: it is not a regular file, is too large, is not UTF-8, or its name has a NUL.
    """
    try:
        check_regular(path, most_bytes)
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise UntrustedError(f"text that is not UTF-8 (byte {error.start})") from error
    except ValueError as error:
        raise UntrustedError(str(error)) from error


def read_named(path: Path, argument: str, cure: str, parse: Callable[[str], Content]) -> Content:
    """Read the file that an argument names, and parse its text.

    Raises:
        ArgumentError: the file cannot be read or parsed; names the file.
    """
    name = f"{argument} {path}".strip()
    try:
        return parse(read_text(path))
    except (OSError, UntrustedError) as error:
        raise ArgumentError.about(name, "a file of YAML", error, cure) from error
    except ArgumentError as error:
        raise ArgumentError(f"{name}: {error}") from error


def read_log(path: Path, start: int = 0) -> bytes:
    """Read a log of lines from a byte offset on.

    Raises:
        OSError: the file cannot be read.
        ModelError: it is not a regular file, or is too large.
    """
    try:
        check_regular(path, 100_000_000)  # 300,000 changes or executions
    except UntrustedError as error:
        cure = "Remove it, or choose another folder."
        raise ModelError(describe(str(path), "a log of lines", error, cure)) from error
    with path.open("rb") as stream:
        stream.seek(start)
        return stream.read()


def load_yaml(text: str) -> Any:
    """Parse a YAML text into plain values.

    Raises:
        UntrustedError: it is not YAML, too deep, or too large with its aliases.
    """
    try:
        _check_events(text)
        return yaml.load(text, Loader=LOADER)
    except UntrustedError:
        raise
    except Exception as error:  # constructors of dates, numbers and keys raise anything
        reason = " ".join(str(error).split()).replace(' in "<unicode string>",', " at")
        raise UntrustedError(f"none ({reason or type(error).__name__})") from error


class YamlChecks(NamedTuple):
    """Checks of YAML written by people; failures raise an ArgumentError that names the place."""

    cure: str  # last sentence of the messages

    def refuse(self, place: str, expected: str, got: object) -> NoReturn:
        """Raise the error for a place."""
        raise ArgumentError.about(place, expected, got, self.cure)

    def load(self, place: str, text: str) -> Any:
        """Parse a YAML text with `load_yaml`."""
        try:
            return load_yaml(text)
        except UntrustedError as error:
            self.refuse(place, "YAML", error)

    def keys(self, place: str, content: Iterable[object], known: Collection[str]) -> None:
        """Require that all keys of a mapping are known."""
        if unknown := sorted(set(map(str, content)).difference(known)):
            self.refuse(place, f"keys of {', '.join(known)}", ", ".join(unknown))

    def number(self, place: str, value: Any, least: float = -math.inf) -> float:
        """Return a finite number that is at least `least`."""
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not is_number or not math.isfinite(value) or value < least:
            limit = "" if least == -math.inf else f" from {least:g} on"
            self.refuse(place, f"finite numbers{limit}", value)
        return float(value)


def load_json(text: str) -> Any:
    """Parse a JSON text into plain values.

    Raises:
        UntrustedError: it is not JSON, too deep or too large.
    """
    if len(text) > MOST_TEXT:
        raise UntrustedError(f"{len(text)} characters, more than {MOST_TEXT}")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UntrustedError(str(error)) from error


def load_xml(text: str) -> ET.Element:
    """Parse an XML text without entities or external references.

    Raises:
        UntrustedError: it is not XML, its document type declares something, or it is too deep or
            too large.
    """
    text = re.sub(r"<!DOCTYPE[^<\[>]*>", "", text, count=1)
    try:
        return ET.fromstring(text, ET.XMLParser(target=_BoundedTree()))
    except UntrustedError:
        raise
    except (ET.ParseError, ValueError, LookupError) as error:  # unknown encodings
        raise UntrustedError(f"broken XML: {error}") from error


class _BoundedTree(ET.TreeBuilder):
    """Builds a tree while its size is within bounds."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = self._nodes = 0

    def doctype(self, *_: object) -> None:
        raise UntrustedError("XML with a document type that declares something")

    def start(self, tag: Any, attrs: Any, /) -> ET.Element:
        self._depth, self._nodes = self._depth + 1, self._nodes + 1
        if self._depth > DEEPEST:
            raise UntrustedError(f"XML of more than {DEEPEST} levels")
        if self._nodes > MOST_NODES:
            raise UntrustedError(f"XML of more than {MOST_NODES} elements")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ET.Element:
        self._depth -= 1
        return super().end(tag)


def check_archive(path: Path) -> None:
    """Require that an `.npz` is a regular file that unpacks to a bounded size.

    Raises:
        OSError: the file does not exist or cannot be read.
        UntrustedError: it is not an archive, or too large.
    """
    check_regular(path)
    try:
        with zipfile.ZipFile(path) as archive:
            total = sum(info.file_size for info in archive.infolist())
    except (zipfile.BadZipFile, ValueError, NotImplementedError, EOFError) as error:
        raise UntrustedError("another file, or a damaged one") from error
    if total > MOST_ARRAYS:
        raise UntrustedError(f"arrays of {total} bytes, more than {MOST_ARRAYS}")


def read_arrays(
    path: Path, wanted: Collection[str] | None = None, left_out: list[str] | None = None
) -> dict[str, NDArray[Any]]:
    """Read arrays of an `.npz`: all of them, or the wanted ones it has.

    Pickled objects are an error, or are only named in the list `left_out`.

    Raises:
        OSError: the file does not exist or cannot be read.
        UntrustedError: it is not an archive of arrays, damaged, or too large.
    """
    found, at = dict[str, NDArray[Any]](), ""
    check_archive(path)
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            names = archive.files if wanted is None else [n for n in wanted if n in archive.files]
            for at in names:
                try:
                    found[at] = archive[at]
                except ValueError as error:
                    if left_out is None or "pickle" not in str(error):
                        raise
                    left_out.append(at)
    except (OSError, MemoryError):
        raise
    except Exception as error:  # numpy and zipfile raise many kinds for invalid archives
        is_pickled = "pickle" in str(error)
        got = f"pickled objects {at}".strip() if is_pickled else "another file, or a damaged one"
        raise UntrustedError(got) from error
    if not all(isinstance(array, np.ndarray) for array in found.values()):
        raise UntrustedError("an archive of other files than arrays")
    return found


def _check_events(text: str) -> None:
    """Check depth, nodes, numbers and keys before anything is built: the loaders recurse."""
    sizes: dict[str, int] = {}  # number of nodes below each anchor
    # anchor, number of nodes before it, keys so far, and which of the next nodes are keys
    open_: list[tuple[str | None, int, set[str], Iterator[bool]]] = []
    nodes = 0
    for event in yaml.parse(text, Loader=LOADER):
        anchor = getattr(event, "anchor", None)
        is_key = open_ and isinstance(event, yaml.NodeEvent) and next(open_[-1][3])
        if is_key and isinstance(event, yaml.ScalarEvent) and event.value != "<<":
            keys = open_[-1][2]
            if event.value in keys:
                raise UntrustedError(f"the key {event.value} twice")
            keys.add(event.value)
        if isinstance(event, yaml.AliasEvent):
            nodes += sizes.get(event.anchor or "", 0)
        elif isinstance(event, yaml.CollectionStartEvent):
            is_mapping = isinstance(event, yaml.MappingStartEvent)
            open_.append((anchor, nodes, set(), cycle([is_mapping, False])))
            nodes += 1
        elif isinstance(event, yaml.ScalarEvent):
            nodes += 1
            if anchor is not None:
                sizes[anchor] = 1
            if len(event.value) > 100 and _is_number(event):
                raise UntrustedError(f"a number of {len(event.value)} characters")
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before, *_ = open_.pop()
            if anchor is not None:
                sizes[anchor] = nodes - before
        if len(open_) > DEEPEST:
            raise UntrustedError(f"more than {DEEPEST} levels")
        if nodes > MOST_NODES:
            raise UntrustedError(f"more than {MOST_NODES} values")


def _is_number(event: yaml.ScalarEvent) -> bool:
    plain = event.implicit[0] and event.value.lstrip("+-")[:1].isdigit()
    return bool(plain or (event.tag or "").endswith((":int", ":float")))
