# SPDX-License-Identifier: Apache-2.0
"""Arrays of NPZ, NPY, MATLAB's MAT, and HDF5 of robot learning, any with samples (T, d)."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from intent_recognition.errors import first_of, optional
from intent_recognition.tables.cells import OF_IMAGE, Values, are_of_image, pixels_of
from intent_recognition.tables.hdf5_reading import (
    MOST_DOFS,
    MOST_OF_POSE,
    UNIT,
    goes_on_along_rows,
    is_of_places,
    on_end,
    samples_first,
    stated_rate,
)
from intent_recognition.tables.isolated import read_isolated
from intent_recognition.tables.table import Table, check_columns, table_of, unusable
from intent_recognition.tables.times import is_clock
from intent_recognition.untrusted import UntrustedError, read_arrays


def open_npz(path: Path) -> Table:
    """Arrays (T,) by name, those of arrays (T, d) as `NAME.0`, of (T, n, 3) as `NAME.0.0`, ..."""
    left_out: list[str] = []
    try:
        arrays = read_arrays(path, left_out=left_out)
        if left_out and not arrays:
            raise UntrustedError(f"pickled objects {first_of(left_out, 6)}")
    except (UntrustedError, OSError) as error:
        cure = "Write it with numpy.savez, with arrays of numbers or texts."
        raise unusable(path, "an .npz of plain arrays", error, cure) from error
    read = samples_first(on_end(dict(_fields(arrays))))
    table = table_of_arrays(path, read, stated_rate(arrays))
    said = f"pickled objects, left out: {first_of(left_out, 6)}"
    return replace(table, notes=(*table.notes, *[said] * bool(left_out)))


def open_npy(path: Path) -> Table:
    """One array (T, d), or (n, T, d) of n demonstrations: columns have numbers."""
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
        is_plain = array.ndim in (2, 3) and array.dtype.kind in "fiub"
        if not is_plain and not (array.dtype.names and array.ndim == 1):
            raise ValueError(f"an array of {array.dtype} of shape {array.shape}")
    except (OSError, ValueError, EOFError) as error:
        cure = "Write it with numpy.save, or several with numpy.savez."
        raise unusable(path, "one array (T, d) or (n, T, d) of numbers", error, cure) from error
    return table_of_arrays(path, samples_first(on_end(dict(_fields({"": array})))))


def _fields(arrays: Mapping[str, Values]) -> Iterator[tuple[str, Values]]:
    """Arrays by name, of arrays with fields each of these."""
    for name, array in arrays.items():
        if array.dtype.names is None:
            yield name, array
        for field in array.dtype.names or ():
            yield from _fields({".".join(filter(None, (name, field))): array[field]})


def table_of_arrays(path: Path, arrays: Mapping[str, Values], rate: float = 0.0) -> Table:
    """The table of arrays whose samples are along their first axes, at a rate, 0 for none."""
    images = [k for k, a in arrays.items() if a.ndim == 3 == a.shape[2] and are_of_image(a)]
    columns = flat_columns(path, {**arrays, **{key: pixels_of(arrays[key]) for key in images}})
    clocks = any(is_clock(key, array) for key, array in arrays.items() if array.ndim == 1)
    # a rate that is stated may be that of a camera
    defaults: dict[str, object] = {"time": {"rate": rate}} if rate > 0.0 and not clocks else {}
    if "demonstration" in columns:
        defaults["segments"] = {"column": "demonstration"}
    texts = [columns[key] for key in columns if key.lower() in UNIT]
    said = "".join(str(text[0]) for text in texts if text.dtype.kind == "U" and text.size == 1)
    notes = (*transposed(arrays), *[OF_IMAGE][: len(images)])
    narrow = {key for key, array in arrays.items() if array.shape[1:] == (1,)}
    aliases = {f"{key}.0": k for k, key in enumerate(columns) if key in narrow}
    about = {"defaults": defaults, "notes": notes, "unit": said, "aliases": aliases}
    return table_of(path, columns, **about)


def flat_columns(source: Path, arrays: Mapping[str, Values]) -> dict[str, Values]:
    """Columns of arrays (T,) and (T, 1) by their names, of arrays (T, d) as `NAME.0`, ...

    Arrays (T, n, 3) are `NAME.0.0`, ..., `NAME.n.2`; images and what has more dimensions are left
    out.
    """
    columns: dict[str, Values] = {}
    for name, array in arrays.items():
        if array.ndim > 2 and not is_of_places(array):
            continue
        if array.ndim == 3 and array.shape[1] == 1:
            array = array[:, 0]
        elif array.ndim == 3 and array.shape[2] > MOST_OF_POSE:
            array = np.swapaxes(array, 1, 2)  # MATLAB's (T, 3, n)
        array = array[:, 0] if name and array.shape[1:] == (1,) else np.atleast_1d(array)
        shape = array.shape[1:]
        check_columns(source, len(columns) + int(np.prod(shape)))
        for index in np.ndindex(shape):
            place: tuple[Any, ...] = (slice(None), *index)
            columns[".".join(filter(None, (name, *map(str, index))))] = array[place]
    if arrays and not columns:
        shapes = ", ".join(f"{name} of shape {array.shape}" for name, array in arrays.items())
        cure = "Put one demonstration after the other, with a column that counts them."
        raise unusable(source, "arrays (T,), (T, d) or (T, n, 3)", shapes, cure)
    return columns


def transposed(arrays: Mapping[str, Values]) -> list[str]:
    """Which arrays likely have their samples along another axis than the first."""
    most = max((len(array) for array in arrays.values() if array.ndim), default=0)
    found = []
    for name, array in arrays.items():
        is_wide = array.ndim == 2 and len(array) <= MOST_DOFS < array.shape[1]
        # wide ones beside others, or whose numbers say it, are turned by `samples_first`
        if (is_wide and most in array.shape) or (array.ndim == 2 and goes_on_along_rows(array)):
            found.append(
                f"{name or 'it'} has {len(array)} rows and {array.shape[1]} columns. Likely its"
                " columns are samples: transpose it."
            )
        elif array.ndim == 3 and array.shape[1] <= 4 and MOST_DOFS < array.shape[2] > len(array):
            found.append(
                f"{name or 'it'} has the shape {array.shape}. Likely its last axis is samples: move"
                " that to the front."
            )
    return found


def open_hdf5(path: Path) -> Table:
    """Arrays by their path: `obs.robot0_eef_pos.0`, `observations.qpos.3`, `action.0`.

    Groups that are numbered, as robomimic, Isaac Lab and ManiSkill have one for each
    demonstration, are told apart by the column `demonstration`.
    """
    optional("h5py")
    arrays = read_isolated("hdf5_reading.py", path, "an HDF5 or MAT file")
    rate = float(arrays.pop("#rate"))
    unit = str(arrays.pop("#unit", ""))
    units = dict(arrays.pop("#units", np.empty((0, 2))).tolist())
    left_out = arrays.pop("#left_out", np.empty(0)).tolist()
    table = table_of_arrays(path, arrays, rate)
    if not table.names:
        cure = "Save arrays of numbers; of a MATLAB table table2struct(T, ToScalar=true)."
        raise unusable(path, "arrays of numbers (T, d)", "none", cure)
    said = f"without a row for each sample, left out: {', '.join(left_out[:6])}"
    of: dict[int, str] = {}
    for k, name in enumerate(table.names):
        while name and name not in units:
            name = name.rpartition(".")[0]
        of[k] = units.get(name, "")
    notes = (*table.notes, *[said] * bool(left_out))
    return replace(table, units=of, must_say=bool(unit), unit=unit or table.unit, notes=notes)
