# SPDX-License-Identifier: Apache-2.0
"""Mesh files of a URDF, checked before a library in C reads them."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from intent_recognition.errors import ArgumentError, optional
from intent_recognition.kinematics.packages import package_shares
from intent_recognition.untrusted import LARGEST, MOST_MESH, UntrustedError, check_regular


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
