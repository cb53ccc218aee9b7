# SPDX-License-Identifier: Apache-2.0
"""Arrays of an HDF5 file by h5py: run by `isolated`."""

import importlib
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_BYTES = 2**28
"""Of one array. Convention: an hour of fifty values at 100 Hz takes 0.15 GB."""
EPISODE = "demo_"
"""How robomimic and Isaac Lab name their demonstrations, groups below `data`."""


def read(path: str) -> dict[str, NDArray[Any]]:
    """Arrays of numbers (T,) or (T, d) by their path, with dots, demonstrations on end.

    `demonstration` says of each row of those which it is of; `#rate` is the control rate that
    robomimic notes, 0 for none. Images and what has more dimensions are left out.

    Raises:
        Exception: whatever h5py raises.
    """
    h5py = importlib.import_module("h5py")
    with h5py.File(path, "r") as file:
        data = file.get("data")
        names = [name for name in data if name.startswith(EPISODE)] if data is not None else []
        rate = 0.0
        if names:
            names.sort(key=lambda name: (len(name), name))
            groups = [_arrays(data[name]) for name in names]
            if "env_args" in data.attrs:
                about = json.loads(data.attrs["env_args"])
                rate = float(about.get("env_kwargs", {}).get("control_freq", 0.0))
        else:
            names, groups = [], [_arrays(file)]
    shared = [key for key in groups[0] if all(key in group for group in groups)]
    found = {}
    if names:
        lengths = [max((len(group[key]) for key in shared), default=0) for group in groups]
        equal = [
            all(len(g[key]) == n for g, n in zip(groups, lengths, strict=True)) for key in shared
        ]
        shared = [key for key, same in zip(shared, equal, strict=True) if same]
        found["demonstration"] = np.repeat(np.array(names), lengths)
    for key in shared:
        found[key] = np.concatenate([group[key] for group in groups])
    return {**found, "#rate": np.array(rate)}


def _arrays(group: Any) -> dict[str, NDArray[Any]]:
    found = {}

    def visit(name: str, item: Any) -> None:
        if not hasattr(item, "ndim") or item.dtype.kind not in "fiub":
            return
        if item.ndim in (1, 2) and item.shape[0] and item.size * 8 <= MOST_BYTES:
            found[name.replace("/", ".")] = np.asarray(item[()])

    group.visititems(visit)
    return found
