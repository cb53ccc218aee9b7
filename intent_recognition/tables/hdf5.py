# SPDX-License-Identifier: Apache-2.0
"""HDF5 of robot learning: robomimic, Isaac Lab, ALOHA, and any with arrays (T, d); MATLAB's MAT."""

from pathlib import Path

import numpy as np

from intent_recognition.errors import optional
from intent_recognition.tables.isolated import read_isolated
from intent_recognition.tables.npz import flat_columns, transposed
from intent_recognition.tables.table import Table, table_of, unusable

MOST_LISTED = 6
"""Arrays that a note lists. Convention."""


def open_hdf5(path: Path) -> Table:
    """Arrays by their path: `obs.robot0_eef_pos.0`, `observations.qpos.3`, `action.0`.

    Groups that are numbered, as robomimic, Isaac Lab and ManiSkill have one for each
    demonstration, are told apart by the column `demonstration`.
    """
    optional("h5py")
    arrays = read_isolated("hdf5_reading.py", path, "an HDF5 or MAT file")
    rate = float(arrays.pop("#rate"))
    left_out = arrays.pop("#left_out", np.empty(0)).tolist()
    columns = flat_columns(path, arrays)
    if not columns:
        raise unusable(path, "arrays of numbers (T, d)", "none", "Save arrays of numbers.")
    defaults: dict[str, object] = {"time": {"rate": rate}} if rate > 0.0 else {}
    if "demonstration" in columns:
        defaults["segments"] = {"column": "demonstration"}
    notes = transposed(arrays)
    if left_out:
        notes.append(
            f"without a row for each sample, left out: {', '.join(left_out[:MOST_LISTED])}"
        )
    return table_of(path, columns, defaults=defaults, notes=notes)
