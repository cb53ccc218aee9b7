# SPDX-License-Identifier: Apache-2.0
"""The file of a pouring skill: one `.npz` without pickled objects, checked on reading."""

from functools import partial
from pathlib import Path

import numpy as np

from intent_recognition.durable import write_arrays
from intent_recognition.errors import IntentError, ModelError
from intent_recognition.model.arrays import check_arrays, require
from intent_recognition.promp import NormalizedRBFBasis
from intent_recognition.untrusted import read_arrays
from intent_recognition.warping import N_WARPED, PouringSkill, Reached, WarpedPrimitive

FORMAT_VERSION = 1
"""Version of the file format; other versions are rejected."""
CURE = "Write it again: `intent improve pouring --accept`, or `save_pouring_skill`."


def save_pouring_skill(path: str | Path, skill: PouringSkill) -> Path:
    """Write a skill learned from demonstrated pours."""
    primitive = skill.primitive
    arrays = {
        "format_version": np.array(FORMAT_VERSION),
        "basis": np.array([primitive.basis.n_basis, primitive.basis.width]),
        "mean": primitive.mean,
        "spread": primitive.spread,
        "duration_s": np.array(primitive.duration_s),
        "reached": np.array(skill.far),
    }
    write_arrays(Path(path), arrays)
    return Path(path)


def load_pouring_skill(path: str | Path) -> PouringSkill:
    """Read a skill learned from demonstrated pours.

    Raises:
        ModelError: the file is missing or of another version, or an array is missing or invalid.
    """
    try:
        found = dict(read_arrays(Path(path)))
    except (OSError, ValueError) as error:
        raise ModelError.about(str(path), "a pouring skill", error, CURE) from error
    version = found.pop("format_version", np.array(np.nan))
    known = not version.shape and bool(version == FORMAT_VERSION)
    require(known, f"{path}: format_version", str(FORMAT_VERSION), version, CURE)
    # a pour takes about a minute and moves by metres
    check = partial(check_arrays, path, found, largest=1e4, cure=CURE)
    check({"basis": (2,), "duration_s": (), "reached": (3,)})
    try:
        begin, largest, _ = found["reached"].tolist()
        expected = "a duration above 0, and 0 < begin < largest in reached"
        got = f"{found['duration_s']:g} s, {found['reached'].tolist()}"
        sound = bool(found["duration_s"] > 0.0) and 0.0 < begin < largest
        require(sound, str(path), expected, got, CURE)
        basis = NormalizedRBFBasis(int(found["basis"][0]), float(found["basis"][1]))
        rows = N_WARPED * basis.n_basis
        columns = found.get("spread", np.empty(0)).shape[-1:]
        check({"mean": (rows,), "spread": (rows, *columns)})
    except ModelError:
        raise
    except IntentError as error:
        raise ModelError(f"{path}: {error}") from error
    primitive = WarpedPrimitive(basis, found["mean"], found["spread"], float(found["duration_s"]))
    return PouringSkill(primitive, Reached(*found["reached"].tolist()))
