# SPDX-License-Identifier: Apache-2.0
"""The file of a pouring skill: one `.npz` without pickled objects, checked on reading."""

from pathlib import Path

import numpy as np

from intent_recognition.durable import write_arrays
from intent_recognition.errors import IntentError, ModelError
from intent_recognition.promp import NormalizedRBFBasis
from intent_recognition.untrusted import read_arrays
from intent_recognition.warping import N_WARPED, PouringSkill, Reached, WarpedPrimitive

FORMAT_VERSION = 1
"""Of the file; others are not read."""
LARGEST = 1e4
"""Of all numbers in the file. Convention: a pour takes a minute, and moves by metres."""
CURE = "Write it again: `intent improve pouring --accept`, or `save_pouring_skill`."


def save_pouring_skill(path: str | Path, skill: PouringSkill) -> Path:
    """Write what was learned from demonstrated pours."""
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
    """Read what was learned from demonstrated pours.

    Raises:
        ModelError: it is not there, of another version, or an array is missing or bad.
    """
    try:
        arrays = read_arrays(Path(path))
        if any(array.dtype.kind not in "fiu" for array in arrays.values()):
            raise ValueError("arrays of something else than numbers")
        found = {name: np.asarray(array, np.float64) for name, array in arrays.items()}
    except (OSError, ValueError) as error:  # texts are no numbers
        raise ModelError.about(str(path), "a pouring skill", error, CURE) from error
    version = found.pop("format_version", np.array(np.nan))
    if version.shape or version != FORMAT_VERSION:
        place = f"{path}: format_version"
        raise ModelError.about(place, str(FORMAT_VERSION), version, CURE)
    needed = {"basis": (2,), "duration_s": (), "reached": (3,)}
    try:
        if not all(np.all(np.abs(array) <= LARGEST) for array in found.values()):
            expected = f"numbers up to {LARGEST:g}"
            raise ModelError.about(str(path), expected, "larger ones, or NaN", CURE)
        if not all(found[name].shape == shape for name, shape in needed.items()):
            raise ModelError.about(str(path), "arrays of the right shape", "others", CURE)
        begin, largest, _ = found["reached"].tolist()
        if not (found["duration_s"] > 0.0 and 0.0 < begin < largest):
            expected = "a duration above 0, and 0 < begin < largest in reached"
            got = f"{found['duration_s']:g} s, {found['reached'].tolist()}"
            raise ModelError.about(str(path), expected, got, CURE)
        basis = NormalizedRBFBasis(int(found["basis"][0]), float(found["basis"][1]))
        mean, spread = found["mean"], found["spread"]
        rows = N_WARPED * basis.n_basis
        if mean.shape != (rows,) or spread.ndim != 2 or len(spread) != rows:
            got = f"{mean.shape} and {spread.shape}"
            raise ModelError.about(f"{path}: weights", f"{rows} of them", got, CURE)
    except KeyError as error:
        raise ModelError.about(str(path), "all arrays", f"no {error}", CURE) from error
    except ModelError:
        raise
    except IntentError as error:
        raise ModelError(f"{path}: {error}") from error
    primitive = WarpedPrimitive(basis, mean, spread, float(found["duration_s"]))
    return PouringSkill(primitive, Reached(*found["reached"].tolist()))
