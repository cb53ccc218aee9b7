# SPDX-License-Identifier: Apache-2.0
"""The file of an annotated object: one `.npz` without pickled objects, checked on reading."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from intent_recognition.durable import write_arrays
from intent_recognition.errors import IntentError, ModelError, as_path
from intent_recognition.share import share_path
from intent_recognition.untrusted import UntrustedError, read_arrays
from intent_recognition.warping import AnnotatedObject, Grasp

KNOWN_VERSIONS = (1, 2)
"""Versions that can be read; version 1 has no grasp."""
FOLDER = "config/objects"
"""Folder of the shipped objects in the share directory."""
CURE = "Write it again with `save_object`; docs/warping.md says how."


def save_object(path: str | Path, annotated: AnnotatedObject) -> Path:
    """Write an annotated object; positions and normals are rounded to 32 bits."""
    arrays = {
        "format_version": np.array(2),
        "name": np.array(annotated.name),
        "points": annotated.points.astype(np.float32),
        "normals": annotated.normals.astype(np.float32),
        "labels": annotated.labels.astype(np.uint8),
    }
    if annotated.grasp is not None:
        arrays |= {
            "grasp": annotated.grasp.pose,
            "grasp_width_m": np.array(annotated.grasp.width_m),
        }
    write_arrays(Path(path), arrays)
    return Path(path)


def load_object(path: str | Path) -> AnnotatedObject:
    """Read an annotated object.

    Raises:
        ModelError: the file is missing or of another version, or an array is missing or invalid.
    """
    try:
        arrays = read_arrays(as_path("path", path))
    except (OSError, UntrustedError) as error:
        raise ModelError.about(str(path), "an annotated object", error, CURE) from error
    version = arrays.get("format_version")
    whole = version is not None and not version.shape and version.dtype.kind in "iu"
    if not whole or version not in KNOWN_VERSIONS:
        place = f"{path}: format_version"
        raise ModelError.about(place, f"one of {KNOWN_VERSIONS}", version, CURE)
    missing = {"name", "points", "normals", "labels"} - arrays.keys()
    if missing:
        raise ModelError.about(str(path), "all arrays", f"no {sorted(missing)}", CURE)
    numbers = arrays.keys() & {"points", "normals", "labels", "grasp", "grasp_width_m"}
    if others := sorted(name for name in numbers if arrays[name].dtype.kind not in "fiu"):
        got = f"{others[0]} of {arrays[others[0]].dtype}"
        raise ModelError.about(str(path), "arrays of real numbers", got, CURE)
    try:
        grasp = None
        if "grasp" in arrays:
            grasp = Grasp(arrays["grasp"], float(arrays["grasp_width_m"]))
        name, surface = str(arrays["name"]), (arrays["points"], arrays["normals"])
        return AnnotatedObject(*surface, arrays["labels"], name, grasp)
    except (IntentError, KeyError, TypeError, ValueError) as error:
        raise ModelError(f"{path}: {error}") from error


def find_object(name: str | Path) -> Path:
    """Path of an annotated object: a file, or the name of a shipped one.

    Raises:
        ModelError: it is neither.
    """
    if Path(name).is_file():
        return Path(name)
    folder = share_path(FOLDER)
    shipped = folder / f"{name}.npz"
    if Path(name).name == str(name) and shipped.is_file():
        return shipped
    names = ", ".join(sorted(path.stem for path in folder.glob("*.npz")))
    expected = f"a file, or one of {names}"
    raise ModelError.about(str(name), expected, "neither", "See docs/warping.md.")
