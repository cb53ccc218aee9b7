# SPDX-License-Identifier: Apache-2.0
"""HDF5 of robot learning: robomimic, Isaac Lab, ALOHA, and any with arrays (T, d)."""

from pathlib import Path

from intent_recognition.errors import optional
from intent_recognition.tables.isolated import read_isolated
from intent_recognition.tables.npz import flat_columns, transposed
from intent_recognition.tables.table import Table, table_of, unusable


def open_hdf5(path: Path) -> Table:
    """Arrays by their path: `obs.robot0_eef_pos.0`, `observations.qpos.3`, `action.0`.

    The demonstrations of robomimic and Isaac Lab are told apart by the column `demonstration`.
    """
    optional("h5py")
    arrays = read_isolated("hdf5_reading.py", path, "an HDF5 file")
    rate = float(arrays.pop("#rate"))
    columns = flat_columns(path, arrays)
    if not columns:
        raise unusable(path, "arrays of numbers (T, d)", "none", "Check it with h5dump.")
    defaults: dict[str, object] = {"time": {"rate": rate}} if rate > 0.0 else {}
    if "demonstration" in columns:
        defaults["segments"] = {"column": "demonstration"}
    return table_of(path, columns, defaults=defaults, notes=transposed(arrays))
