# SPDX-License-Identifier: Apache-2.0
"""Arrays of an HDF5 file by h5py: run by `isolated`."""

import importlib
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_BYTES = 2**28
"""Of one array. Convention: an hour of fifty values at 100 Hz takes 0.15 GB."""
ENDS = "meta.episode_ends"
"""Where replay buffers (diffusion policy, UMI) say the row after each demonstration."""


def read(path: str) -> dict[str, NDArray[Any]]:
    """Arrays of numbers (T,), (T, d) or (T, n, 3) by path, with dots, demonstrations on end.

    `demonstration` says of each row of those which it is of; `#rate` is the control rate that
    robomimic notes, 0 for none. Images and what has more dimensions are left out.
    """
    h5py = importlib.import_module("h5py")
    with h5py.File(path, "r") as file:
        data = file.get("data")
        # so robomimic and Isaac Lab name their demonstrations
        names = [name for name in data if name.startswith("demo_")] if data is not None else []
        rate = 0.0
        if names:
            names.sort(key=lambda name: (len(name), name))
            groups = [_arrays(data[name]) for name in names]
            if "env_args" in data.attrs:
                about = json.loads(data.attrs["env_args"])
                rate = float(about.get("env_kwargs", {}).get("control_freq", 0.0))
        else:
            names, groups = [], [_arrays(file)]
            ends = groups[0].get(ENDS)
            if ends is not None and ends.ndim == 1:  # of a replay buffer: rows of all on end
                return _numbered(groups[0], np.diff(ends, prepend=0)) | {"#rate": np.array(rate)}
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


def _numbered(arrays: dict[str, NDArray[Any]], lengths: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Arrays of a replay buffer that have a row for each sample, and which demonstration it is."""
    rows = {key: array for key, array in arrays.items() if len(array) == lengths.sum()}
    return {"demonstration": np.repeat(np.arange(len(lengths)), lengths), **rows}


def _arrays(group: Any) -> dict[str, NDArray[Any]]:
    found = {}

    def visit(name: str, item: Any) -> None:
        dotted = name.replace("/", ".")
        if not hasattr(item, "ndim") or item.size * 8 > MOST_BYTES or not item.size:
            return
        if item.dtype.names and item.ndim == 1:
            fields = [field for field in item.dtype.names if item.dtype[field].kind in "fiub"]
            found.update({f"{dotted}.{field}": np.asarray(item[field]) for field in fields})
        is_of_places = item.ndim == 3 and item.shape[2] <= 4
        # wider rows are compressed images, as ALOHA keeps them
        if item.ndim == 2 and item.dtype == np.uint8 and item.shape[1] > 256:
            return
        if item.dtype.kind in "fiub" and (item.ndim in (1, 2) or is_of_places):
            found[dotted] = np.asarray(item[()])

    group.visititems(visit)
    return found
