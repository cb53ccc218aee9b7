# SPDX-License-Identifier: Apache-2.0
"""Files of strangers: regular, of bounded size; YAML, JSON, XML and arrays that cannot grow.

Whatever is wrong with a file is an `UntrustedError`, whose text says what came in place of what was
expected; the caller adds which file, and the cure.
"""

import json
import math
import stat
import zipfile
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TypeVar
from xml.etree import ElementTree as ET

import numpy as np
import yaml
from numpy.typing import NDArray

from intent_recognition.errors import ArgumentError, ModelError, describe

Content = TypeVar("Content")

MOST_TEXT = 4_000_000
"""Bytes of a YAML or JSON text. Convention: the metadata of a thousand topics take 0.7 MB."""
DEEPEST = 32
"""Nesting of YAML and XML. Convention: a DOF file has 4 levels, a URDF 5, metadata.yaml 7."""
MOST_NODES = 100_000
"""Nodes of YAML, with those that aliases repeat, and elements of XML. Convention: a thousand topics
take 60 000, a thousand links 20 000."""
MOST_MESH = 200_000_000
"""Bytes of a mesh or cloud. Convention: four million triangles."""
MOST_ARRAYS = 2**29
"""Bytes of all arrays in an `.npz`, unpacked. Convention: a model of ten tasks takes 0.02 GB."""
LARGEST = 1e6
"""Largest magnitude of a length, angle, mass or inertia, in SI units. Convention: beyond any arm or
map, and single precision still draws it to 0.1."""
LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The loader in C, where PyYAML was built with it: ten times as fast."""


class UntrustedError(ValueError):
    """A file that is not what it should be; the text says what it is."""


def check_regular(path: Path, most_bytes: int | None = None) -> None:
    """Make sure that a path is a file that can be read to its end: no FIFO, device or folder.

    Args:
        path: of the file.
        most_bytes: size allowed; None for any.

    Raises:
        OSError: nothing is there, or it may not be looked at.
        UntrustedError: it is another thing, or too large.
    """
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        raise UntrustedError("a folder" if stat.S_ISDIR(found.st_mode) else "no regular file")
    if most_bytes is not None and found.st_size > most_bytes:
        raise UntrustedError(f"{found.st_size} bytes, more than {most_bytes}")


def read_text(path: Path, most_bytes: int = MOST_TEXT) -> str:
    """The text of a file.

    Raises:
        OSError: it cannot be read.
        UntrustedError: it is no regular file, too large, or no UTF-8, or its name holds a NUL.
    """
    try:
        check_regular(path, most_bytes)
        return path.read_text(encoding="utf-8")
    except ValueError as error:
        raise UntrustedError(str(error)) from error


def read_named(path: Path, argument: str, cure: str, parse: Callable[[str], Content]) -> Content:
    """What is parsed from the text of the file that an argument names.

    Raises:
        ArgumentError: there is none that could be used; says which file.
    """
    name = f"{argument} {path}".strip()
    try:
        return parse(read_text(path))
    except (OSError, UntrustedError) as error:
        raise ArgumentError.about(name, "a file of YAML", error, cure) from error
    except ArgumentError as error:
        raise ArgumentError(f"{name}: {error}") from error


def read_log(path: Path, start: int = 0) -> bytes:
    """What a log of lines holds from a byte on.

    Raises:
        OSError: it cannot be read.
        ModelError: it is no regular file, or too large.
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
    """Plain values of a YAML text.

    Raises:
        UntrustedError: it is no YAML, too deep, or aliases make it too large.
    """
    try:
        _check_events(text)
        return yaml.load(text, Loader=LOADER)
    except UntrustedError:
        raise
    except Exception as error:  # dates, numbers and keys that are none raise what they meet
        reason = " ".join(str(error).split()).replace(' in "<unicode string>",', " at")
        raise UntrustedError(f"none ({reason or type(error).__name__})") from error


class YamlChecks(NamedTuple):
    """Checks of what people write in YAML; what fails is an ArgumentError that names the place."""

    cure: str  # last sentence of its message

    def refuse(self, place: str, expected: str, got: object) -> NoReturn:
        """Raise the error."""
        raise ArgumentError.about(place, expected, got, self.cure)

    def load(self, place: str, text: str) -> Any:
        """As `load_yaml`."""
        try:
            return load_yaml(text)
        except UntrustedError as error:
            self.refuse(place, "YAML", error)

    def keys(self, place: str, content: Iterable[object], known: Collection[str]) -> None:
        """Make sure that all keys of a mapping are known."""
        if unknown := sorted(set(map(str, content)).difference(known)):
            self.refuse(place, f"keys of {', '.join(known)}", ", ".join(unknown))

    def number(self, place: str, value: Any, least: float = -math.inf) -> float:
        """A finite number, not below the least."""
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not is_number or not math.isfinite(value) or value < least:
            limit = "" if least == -math.inf else f" from {least:g} on"
            self.refuse(place, f"finite numbers{limit}", value)
        return float(value)


def load_json(text: str) -> Any:
    """Plain values of a JSON text.

    Raises:
        UntrustedError: it is no JSON, too deep or too large.
    """
    if len(text) > MOST_TEXT:
        raise UntrustedError(f"{len(text)} characters, more than {MOST_TEXT}")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UntrustedError(str(error)) from error


def load_xml(text: str) -> ET.Element:
    """The root of an XML text without a document type: no entities, nothing that is elsewhere.

    Raises:
        UntrustedError: it is no XML, has a document type, is too deep or too large.
    """
    try:
        return ET.fromstring(text, ET.XMLParser(target=_BoundedTree()))
    except UntrustedError:
        raise
    except (ET.ParseError, ValueError, LookupError) as error:  # encodings that there are not
        raise UntrustedError(f"broken XML: {error}") from error


class _BoundedTree(ET.TreeBuilder):
    """Builds a tree as long as it is small."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = self._nodes = 0

    def doctype(self, *_: object) -> None:
        raise UntrustedError("XML with a document type")

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
    """Make sure that an `.npz` is a regular file and unpacks to a bounded size.

    Raises:
        OSError: nothing is there, or it cannot be read.
        UntrustedError: it is another thing, or too large.
    """
    check_regular(path)
    try:
        with zipfile.ZipFile(path) as archive:
            total = sum(info.file_size for info in archive.infolist())
    except (zipfile.BadZipFile, ValueError, NotImplementedError, EOFError) as error:
        raise UntrustedError("another file, or a damaged one") from error
    if total > MOST_ARRAYS:
        raise UntrustedError(f"arrays of {total} bytes, more than {MOST_ARRAYS}")


def read_arrays(path: Path, wanted: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
    """The arrays of an `.npz` without pickled objects: all, or those wanted that it has.

    Raises:
        OSError: nothing is there, or it may not be read.
        UntrustedError: it is another thing, damaged, or too large.
    """
    found, at = dict[str, NDArray[Any]](), ""
    check_archive(path)
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            names = archive.files if wanted is None else [n for n in wanted if n in archive.files]
            for at in names:
                found[at] = archive[at]
    except (OSError, MemoryError):
        raise
    except Exception as error:  # numpy and zipfile raise many kinds for what is no archive
        is_pickled = "pickle" in str(error)
        got = f"pickled objects {at}".strip() if is_pickled else "another file, or a damaged one"
        raise UntrustedError(got) from error
    if not all(isinstance(array, np.ndarray) for array in found.values()):
        raise UntrustedError("an archive of other files than arrays")
    return found


def _check_events(text: str) -> None:
    """Bound depth, nodes and numbers before anything is built: the loaders recurse."""
    sizes: dict[str, int] = {}  # nodes under each anchor
    open_: list[tuple[str | None, int]] = []  # anchor, and nodes before it
    nodes = 0
    for event in yaml.parse(text, Loader=LOADER):
        anchor = getattr(event, "anchor", None)
        if isinstance(event, yaml.AliasEvent):
            nodes += sizes.get(event.anchor or "", 0)
        elif isinstance(event, yaml.CollectionStartEvent):
            open_.append((anchor, nodes))
            nodes += 1
        elif isinstance(event, yaml.ScalarEvent):
            nodes += 1
            if anchor is not None:
                sizes[anchor] = 1
            if len(event.value) > 100 and _is_number(event):
                raise UntrustedError(f"a number of {len(event.value)} characters")
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = open_.pop()
            if anchor is not None:
                sizes[anchor] = nodes - before
        if len(open_) > DEEPEST:
            raise UntrustedError(f"more than {DEEPEST} levels")
        if nodes > MOST_NODES:
            raise UntrustedError(f"more than {MOST_NODES} values")


def _is_number(event: yaml.ScalarEvent) -> bool:
    plain = event.implicit[0] and event.value.lstrip("+-")[:1].isdigit()
    return bool(plain or (event.tag or "").endswith((":int", ":float")))
