# SPDX-License-Identifier: Apache-2.0
"""Files that a robot's description speaks of: ROS packages, and meshes.

Packages are installed, or stand as source around the file; meshes are checked before a library in C
reads them.
"""

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from intent_recognition.errors import ArgumentError, optional
from intent_recognition.untrusted import (
    LARGEST,
    MOST_MESH,
    UntrustedError,
    check_regular,
    load_xml,
    read_text,
)

_PREFIXES = "AMENT_PREFIX_PATH"
_NAME = re.compile(r"\w[\w-]*")
"""The name of a package. Others may be paths, of which no link is made."""


def package_shares() -> list[str]:
    """Folders in which the installed packages of `package://` are."""
    return [str(Path(prefix) / "share") for prefix in _prefixes()]


def packages_around(folder: Path) -> dict[str, Path]:
    """Packages by name whose folders are above a folder, or stand beside those: a clone's."""
    found: dict[str, Path] = {}
    for above in (folder, *folder.parents[:3]):  # `urdf`, its package, what holds it
        with suppress(OSError):
            for place in (above, *sorted(above.iterdir())):
                with suppress(OSError, UntrustedError):
                    name = load_xml(read_text(place / "package.xml")).findtext("name", "").strip()
                    if _NAME.fullmatch(name):
                        found.setdefault(name, place)
    return found


@contextmanager
def as_installed(packages: Mapping[str, Path]) -> Iterator[str]:
    """The value of AMENT_PREFIX_PATH with which these packages are found, behind those installed.

    They are links in a prefix of ament's form, which lasts as long as the context.
    """
    with TemporaryDirectory(prefix="intent_packages_") as prefix:
        index = Path(prefix, "share", "ament_index", "resource_index", "packages")
        index.mkdir(parents=True)
        for name, folder in packages.items():
            (index / name).touch()
            Path(prefix, "share", name).symlink_to(folder.resolve())
        yield os.pathsep.join([*_prefixes(), prefix])


def _prefixes() -> list[str]:
    return [prefix for prefix in os.environ.get(_PREFIXES, "").split(os.pathsep) if prefix]


def check_meshes(meshes: Iterable[ET.Element]) -> None:
    """Make sure that the files of meshes are regular, and their vertices finite.

    coal ends the process at a vertex that is not. It and PyBullet wait for ever for a FIFO, also
    for one that stands in an OBJ as its material. What cannot be found or read is left to them:
    they say so.

    Raises:
        ArgumentError: a mesh is neither.
    """
    for mesh in meshes:
        name, wrong = mesh.get("filename", ""), ""
        try:
            if (path := _find(name)) is not None:
                check_regular(path, MOST_MESH)
                for other in _materials(path):
                    check_regular(other, MOST_MESH)
                wrong = "" if _is_finite(path) else f"vertices beyond {LARGEST:g} m"
        except UntrustedError as error:
            wrong = str(error)
        except OSError:
            continue
        if wrong:
            cure = "Export it again."
            raise ArgumentError.about("robot", f"a mesh {name}", wrong, cure)


def _find(name: str) -> Path | None:
    scheme, _, rest = name.rpartition("://")
    places = [""] if scheme in ("", "file") else package_shares()
    return next((path for place in places if (path := Path(place, rest)).exists()), None)


def _materials(path: Path) -> Iterable[Path]:
    """Files that an OBJ names for its materials, as far as they are there."""
    if path.suffix.lower() != ".obj":
        return
    with path.open("rb") as lines:
        for line in lines:
            if line.lstrip().startswith(b"mtllib"):
                other = path.parent / os.fsdecode(line.strip()[len(b"mtllib") :].strip())
                if other.exists():
                    yield other


def _is_finite(path: Path) -> bool:
    trimesh = optional("trimesh")

    try:
        with np.errstate(all="ignore"):
            loaded: Any = trimesh.load(str(path), force="mesh", process=False, skip_materials=True)
        return bool(np.all(np.abs(loaded.vertices) <= LARGEST))
    except Exception:  # each reader of trimesh has errors of its own
        return True
