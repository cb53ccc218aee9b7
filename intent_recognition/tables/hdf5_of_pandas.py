# SPDX-License-Identifier: Apache-2.0
"""Read DataFrames that pandas wrote to an HDF5 file; run by `hdf5_reading`."""

import pickletools
from typing import Any

from numpy.typing import NDArray


def columns_of(frame: Any) -> dict[str, NDArray[Any]]:
    """Columns of a DataFrame by name. Levels of the names that are equal in all columns are left
    out, such as DeepLabCut's scorer, but never the last two.
    """
    columns: list[tuple[tuple[str, ...], NDArray[Any]]] = []
    if "table" in frame:
        table = frame["table"]
        index = table["index"]
        for field in table.dtype.names[1:]:
            values = table[field].reshape(len(table), -1)
            values = values.astype(str) if values.dtype.kind == "S" else values
            names = _listed(table.attrs[f"{field}_kind"])
            columns += zip(names, values.T, strict=True)
    else:
        index = frame["axis1"][()]
        for k in range(int(frame.attrs["nblocks"])):
            if frame[f"block{k}_values"].ndim == 2:  # texts are pickled, and left out
                values = frame[f"block{k}_values"][()]
                columns += zip(_items(frame, f"block{k}_items"), values.T, strict=True)
    kinds = [*map(set, zip(*(name for name, _ in columns), strict=True))]
    kept = [k for k, kind in enumerate(kinds) if len(kind) > 1 or k >= len(kinds) - 2]
    return {"index": index, **{".".join(name[k] for k in kept): one for name, one in columns}}


def _items(frame: Any, key: str) -> list[tuple[str, ...]]:
    """Names, of one or several levels, of the columns in a block of the `fixed` format."""
    levels = range(int(frame.attrs.get(f"{key}_nlevels", 0)))
    several = [frame[f"{key}_level{n}"][()][frame[f"{key}_label{n}"][()]] for n in levels]
    parts = [part.astype(str).tolist() for part in several or [frame[key][()]]]
    return [*zip(*parts, strict=True)]


def _listed(pickled: bytes) -> list[tuple[str, ...]]:
    """Read a list of texts, or of tuples of texts, pickled by protocol 0. The pickle is parsed only
    as text, so that none of its code runs.
    """
    names: list[tuple[str, ...]] = []
    memo: dict[Any, str] = {}
    own: list[str] = []
    for operation, value, _ in pickletools.genops(bytes(pickled)):
        if operation.name in ("UNICODE", "STRING", "INT", "GET"):
            own.append(memo[value] if operation.name == "GET" else str(value))
        elif operation.name == "PUT" and own:
            memo[value] = own[-1]
        elif operation.name == "APPEND":
            names.append(tuple(own))
            own = []
    return names
