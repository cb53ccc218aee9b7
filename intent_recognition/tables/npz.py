# SPDX-License-Identifier: Apache-2.0
"""Arrays of an `.npz`."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from intent_recognition.tables.cells import Values
from intent_recognition.tables.table import Table, check_columns, table_of, unusable
from intent_recognition.untrusted import UntrustedError, read_arrays


def open_npz(path: Path) -> Table:
    """Arrays (T,) by name, those of arrays (T, d) as `NAME.0`, `NAME.1`, ...

    Raises:
        BagError: it is no archive of such arrays.
    """
    try:
        arrays = read_arrays(path)
    except (UntrustedError, OSError) as error:
        cure = "Write it with numpy.savez, with arrays of numbers or texts."
        raise unusable(path, "an .npz of plain arrays", error, cure) from error
    return table_of(path, flat_columns(path, arrays))


def flat_columns(source: Path, arrays: Mapping[str, Values]) -> dict[str, Values]:
    """Columns of arrays (T,) by their names, of arrays (T, d) as `NAME.0`, `NAME.1`, ...

    Raises:
        BagError: an array has more dimensions, or they are too many.
    """
    columns: dict[str, Values] = {}
    for name, array in arrays.items():
        if array.ndim > 2:
            shape = f"{name} of shape {array.shape}"
            cure = "Put one demonstration after the other, with a column that counts them."
            raise unusable(source, "arrays (T,) or (T, d)", shape, cure)
        if array.ndim == 2:
            check_columns(source, len(columns) + array.shape[1])
            columns.update({f"{name}.{k}": array[:, k] for k in range(array.shape[1])})
        else:
            columns[name] = np.atleast_1d(array)
    return columns
