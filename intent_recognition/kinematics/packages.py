# SPDX-License-Identifier: Apache-2.0
"""Files to which a robot's description refers: ROS packages and meshes.

Packages are installed, or found as source around the file. Meshes are checked before a C library
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
"""Pattern of package names. Other names may be paths, for which no link is made."""


def package_shares() -> list[str]:
    """Folders of the installed packages to which `package://` refers."""
    return [str(Path(prefix) / "share") for prefix in _prefixes()]


def packages_around(folder: Path) -> dict[str, Path]:
    """Packages by name in a folder, three parents and their direct subfolders, as in a clone.

    The folder and its parents also have their own names, as in the `share` of an installation.
    """
    places = (folder, *folder.parents[:3])  # `urdf`, its package, the repository
    found: dict[str, Path] = {}
    for above in places:
        with suppress(OSError):
            for place in (above, *sorted(above.iterdir())):
                with suppress(OSError, UntrustedError):
                    name = load_xml(read_text(place / "package.xml")).findtext("name", "").strip()
                    if _NAME.fullmatch(name):
                        found.setdefault(name, place)
    return {place.name: place for place in places if _NAME.fullmatch(place.name)} | found


@contextmanager
def as_installed(packages: Mapping[str, Path]) -> Iterator[str]:
    """Yield a value of AMENT_PREFIX_PATH with which these packages are found after installed ones.

    The packages are links in a temporary ament prefix, which is deleted when the context ends.
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
    """Check that mesh files are regular files with finite vertices.

    coal ends the process if a vertex is not finite. coal and PyBullet wait forever for a FIFO, even
    for one that an OBJ file names as its material. Files that cannot be found or read are left to
    these libraries, which report them.

    Raises:
        ArgumentError: a mesh file is not regular, or has vertices that are not finite.
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
    """Existing files that an OBJ file names for its materials."""
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
    except Exception:  # each reader of trimesh raises its own errors
        return True
