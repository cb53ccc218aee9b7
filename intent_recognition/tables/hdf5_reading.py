# SPDX-License-Identifier: Apache-2.0
"""Read arrays of an HDF5 or MAT file by h5py or scipy; run by `isolated`."""

import importlib
import json
import re
import runpy
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_BYTES = 2**28
"""Largest array that is read [bytes]; an hour of fifty values at 100 Hz takes 0.15 GB."""
MOST_DOFS = 20
"""Most rows of an array that may be the columns of a transposed one; two arms with hands have a few
more, a recording has far more samples."""
MOST_OF_POSE = 7
"""Most elements of a pose in an array (T, n, d) of several bodies: a position and a quaternion."""
MOST_PLACES = 600
"""Most positions in an array (T, 3, n), or numbers in an array (T, 1, d): MediaPipe's face has 478
landmarks, a point cloud 1024 points."""
SMOOTH = 0.1
"""Roughness below which numbers are smooth: that of a sine with 14 samples per period."""
NUMBERED = re.compile(r"(.*?)[_-]?(\d+)")
"""Name of a group or array that may belong to one of several demonstrations."""
_WORD = r"(?:.*[\W_])?(?:demo(?:nstration)?|traj(?:ectory)?|episode|trial|take|recording)s?"
DEMONSTRATION = re.compile(_WORD, re.IGNORECASE)
"""Names of arrays that hold one demonstration each."""
LONGEST = 200
"""Most characters of a label among the attributes of a demonstration; robomimic stores a model."""
INSIDE = re.compile(rf"(?P<before>{_WORD})[_-]?(?P<number>\d+)(?P<after>[\W_].*)", re.IGNORECASE)
"""Names such as `trial_3_wrist`, of an array of one demonstration."""
PERIODS = ("dt", "ts", "sample_time", "sampling_time", "sampling_period")
"""Attributes of a file, or numbers in it, that state the time between samples [s]."""
RATES = ("fps", "rate", "rate_hz", "hz", "frequency", "control_freq", "sampling_rate",
         "sample_rate", "sampling_frequency", "frame_rate", "framerate", "capture_rate", "fs",
         "mocap_framerate", "mocap_frame_rate")  # fmt: skip
"""Attributes of a file, or numbers in it, that state its rate [Hz], in lower case."""
FILLS = ("_fillvalue", "missing_value")
"""Attributes of an array that state the number for missing values, in lower case."""
UNIT = ("unit", "units")
"""Names of attributes, or of texts beside arrays, that state a unit, in lower case."""
PANDAS = "pandas_type"
"""Attribute of groups that pandas writes."""
MATLAB = "MATLAB_class"
"""Attribute of all items that MATLAB writes."""
NO_ARRAY = {"MATLAB_empty", "MATLAB_object_decode"}
"""Attributes of empty arrays, which hold only their shape, and of objects such as tables."""
ENDS = "meta.episode_ends"
"""Array of replay buffers (diffusion policy, UMI) with the row after each demonstration."""


def read(path: str) -> dict[str, NDArray[Any]]:
    """Read arrays (T,), (T, d) or (T, n, d) by dotted path, with successive demonstrations joined.

    `demonstration` holds the demonstration of each row; `#rate` is the stated rate [Hz], 0 for
    none; `#unit` is the unit of all arrays, if known; `#units` lists units of arrays or of their
    elements; `#left_out` names arrays without a row for each sample. Images and arrays of more
    dimensions are left out.
    """
    if not (h5py := importlib.import_module("h5py")).is_hdf5(path):  # MATLAB's before 7.3
        return _of_matlab(importlib.import_module("scipy.io").loadmat(path, simplify_cells=True))
    with h5py.File(path, "r") as file:
        if any(MATLAB in item.attrs for item in filter(None, file.values())):
            return _of_matlab(_as_before(h5py, file, file))
        with suppress(KeyError, TypeError, ValueError):  # names may be of other kinds
            (frame,) = filter(None, file.values())
            if frame.attrs[PANDAS] in (b"frame", b"frame_table"):
                script = Path(__file__).with_name("hdf5_of_pandas.py")
                columns = runpy.run_path(str(script))["columns_of"](frame)
                return {**columns, "#rate": np.array(0.0)}
        top = file["data"] if isinstance(file.get("data"), h5py.Group) else file
        names = _demonstrations(h5py, top)
        rate = stated_rate({**top.attrs, **file.attrs})
        if not names:
            arrays = samples_first(on_end(_arrays(file)))
            ends = arrays.get(ENDS)
            if ends is not None and ends.ndim == 1:  # of a replay buffer: rows of all on end
                sizes = np.diff(ends, prepend=0)
                rows = {key: array for key, array in arrays.items() if len(array) == sizes.sum()}
                arrays = {"demonstration": np.repeat(np.arange(len(sizes)), sizes), **rows}
            return {**arrays, "#rate": np.array(rate), "#units": _units(file, ())}
        groups = [samples_first(_arrays(top[name])) for name in names]
        with suppress(KeyError, ValueError, TypeError):  # others note something else there
            rate = float(json.loads(top.attrs["env_args"])["env_kwargs"]["control_freq"])
        units = _units(top, names)
        said: list[dict[str, str]] = [{} for _ in names]
        with suppress(TypeError, OSError):  # of a type that numpy has not
            said = [{k: v for k, v in top[n].attrs.items() if isinstance(v, str)} for n in names]
    shared = [key for key in groups[0] if all(key in group for group in groups)]
    lengths = [max((len(group[key]) for key in shared), default=0) for group in groups]
    whole = [key for key in shared if [len(group[key]) for group in groups] == lengths]
    left_out = sorted({key for group in groups for key in group} - set(whole))
    labels = {"demonstration": [name.replace("/", "_") for name in names]}
    labels |= {key: [one.get(key, "") for one in said] for key in said[0] if key not in labels}
    return {
        **{k: np.repeat(v, lengths) for k, v in labels.items() if len(max(v, key=len)) <= LONGEST},
        **{key: np.concatenate([group[key] for group in groups]) for key in whole},
        "#rate": np.array(rate),
        "#units": units,
        "#left_out": np.array(left_out),
    }


def _of_matlab(content: dict[str, Any]) -> dict[str, NDArray[Any]]:
    """Like `read`, for the content of a MAT file by name."""
    for struct in content.values():
        if isinstance(struct, dict) and (found := _of_qualisys(struct)):
            return {**found, "#rate": np.array(struct["FrameRate"]), "#unit": np.array("mm")}
    arrays = samples_first(on_end(dict(_of_structs(content, ""))))
    for key, array in arrays.items():
        if array.shape[1:] == (3, 2) or (array.shape[1:] == (3, 4) and not _are_turns(array)):
            arrays[key] = np.swapaxes(array, 1, 2)  # places (T, 3, n), as MATLAB has them
    said: dict[str, set[str]] = {}
    for key in [key for key in arrays if ".#unit" in key]:
        said.setdefault(key.partition(".#unit")[0], set()).add(str(arrays.pop(key)))
    structs = [content, *(one for one in content.values() if isinstance(one, dict))]
    rate = max(map(stated_rate, structs))
    return {**arrays, "#rate": np.array(rate), "#units": _pairs(said)}


def _are_turns(array: NDArray[Any]) -> bool:
    """Whether numbers (T, 3, 4) are rotation matrices with a position, or three quaternions."""
    lengths = np.stack([np.linalg.norm(array[..., :n], axis=2) for n in (3, 4)])
    return bool(np.nanmax(np.abs(lengths - 1.0), axis=(1, 2)).min() < 0.01)


def _as_before(h5py: Any, file: Any, item: Any) -> Any:
    """Content of a MAT file of version 7.3, in the form in which scipy reads older ones: axes in
    MATLAB's order, structs as mappings, cells and arrays of structs as arrays of objects.
    """
    if isinstance(item, h5py.Group):
        parts = {key: part for key, part in item.items() if not key.startswith("#")}
        fields = {key: _as_before(h5py, file, part) for key, part in parts.items()}
        of_array = [
            MATLAB not in part.attrs
            and h5py.check_ref_dtype(getattr(part, "dtype", np.dtype("f8")))
            for part in parts.values()
        ]
        if not all(of_array) or not parts:
            return fields
        rows = zip(*fields.values(), strict=True)  # of an array of structs
        return _objects([dict(zip(fields, row, strict=True)) for row in rows])
    if NO_ARRAY & set(item.attrs) or item.size * 8 > MOST_BYTES:
        return np.empty(0)
    array = item[()].T
    if h5py.check_ref_dtype(item.dtype) is not None:
        return _objects([_as_before(h5py, file, file[one]) for one in array.ravel(order="F")])
    is_text = item.attrs.get(MATLAB) == b"char"
    return "".join(map(chr, array.ravel())) if is_text else array.squeeze()


def _objects(values: list[Any]) -> NDArray[Any]:
    """Convert a list to an array (n,) of objects."""
    found = np.empty(len(values), object)
    found[:] = values
    return found


def is_of_places(array: Any) -> bool:
    """Whether an array holds places or poses: (T, n, d), MATLAB's (T, 3, n), or one body's."""
    if array.ndim != 3:
        return False
    _, n, d = array.shape
    return bool(d <= 4 or (max(n, d) <= MOST_PLACES and (d <= MOST_OF_POSE or n in (1, 3))))


def stated_rate(attributes: dict[str, Any]) -> float:
    """The rate [Hz] that the attributes of a file state, also by a period, 0 for none."""
    for key, value in attributes.items():
        if np.size(value) == 1 and np.asarray(value).dtype.kind in "fiu":
            number = float(np.ravel(value)[0])
            if key.lower() in RATES:
                return number
            if key.lower() in PERIODS and 0.0 < number < 1.0:
                return 1.0 / number
    return 0.0


def on_end(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Join arrays (n, T, d) of n demonstrations to (n T, d), with the column `demonstration`.

    Arrays count as such if n is far too small for samples, there are times (T,), or the numbers are
    smooth along the second axis only. Arrays (n, T), (T,) and (n,) are repeated to match. Arrays
    with numbered names, such as `demo_0`, `demo_1` or `t_0`, `q_0`, `t_1`, ..., are joined, too.
    """
    arrays = _by_numbers(arrays)
    lengths = {len(a) for a in arrays.values() if a.ndim == 1 and a.dtype.kind == "f"}
    cubes = [array for array in arrays.values() if array.ndim == 3]
    shapes = {cube.shape[:2] for cube in cubes}
    (count, size), *others = shapes or {(0, 0)}
    are_few = count <= MOST_DOFS < size or (size in lengths and count not in lengths)
    if not are_few and not lengths & {count, size}:
        are_few = bool(cubes) and all(map(goes_on_along_rows, cubes))
    if others or not count or not are_few:
        return arrays
    found = {"demonstration": np.repeat(np.arange(count), size)}
    for key, array in arrays.items():
        if array.shape[:2] == (count, size):
            found[key] = array.reshape(-1, *array.shape[2:])
        elif array.shape in ((size,), (count,)):
            found[key] = np.tile(array, count) if len(array) == size else np.repeat(array, size)
    return found


def _by_numbers(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Join arrays of numbered demonstrations, recognised by their names or differing lengths."""
    found: dict[int, dict[str, NDArray[Any]]] = {}
    rest = {}
    for key, array in arrays.items():
        if not array.ndim:
            rest[key] = array
        elif inside := INSIDE.fullmatch(key):
            name = inside["before"] + inside["after"]
            found.setdefault(int(inside["number"]), {})[name] = array
        elif match := NUMBERED.fullmatch(key):
            found.setdefault(int(match[2]), {})[match[1]] = array
        else:
            rest[key] = array
    groups = [samples_first(found[number]) for number in sorted(found)]
    shapes = [{key: array.shape[1:] for key, array in group.items()} for group in groups]
    lengths = [{len(array) for array in group.values()} for group in groups]
    if len(groups) < 2 or any(one != shapes[0] for one in shapes) or max(map(len, lengths)) > 1:
        return arrays
    sizes = [size for one in lengths for size in one]
    words = [word for key in shapes[0] for word in (*key.split("."), *key.split("_"))]
    is_said = any(map(DEMONSTRATION.fullmatch, words))
    if not is_said and (len(groups) < 3 or len(set(sizes)) == 1):  # two may be agents
        return arrays
    of_each = {}
    if len(set(sizes)) == 1:  # times of all
        of_each = {k: np.tile(a, len(groups)) for k, a in rest.items() if a.shape == (sizes[0],)}
    of_each |= {k: np.repeat(a, sizes) for k, a in rest.items() if a.shape == (len(groups),)}
    joined = {key: np.concatenate([group[key] for group in groups]) for key in shapes[0]}
    return {"demonstration": np.repeat(sorted(found), sizes), **joined, **rest, **of_each}


def samples_first(arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Transpose arrays (d, T), as MATLAB stores them in HDF5, to (T, d) or (T,) if T is known.

    T is the length of other arrays (T,) or (T, d), or else the width that several wide arrays
    share, or else that of arrays that are smooth along their rows only.
    """
    wide = [k for k, a in arrays.items() if a.ndim == 2 and len(a) <= MOST_DOFS < a.shape[1]]
    lengths = {len(a) for k, a in arrays.items() if a.ndim and len(a) > MOST_DOFS}
    widths = [arrays[key].shape[1] for key in wide]
    if not lengths:
        shared = [width for width in widths if widths.count(width) > 1]
        lengths = {max(shared, key=shared.count)} if shared else set()
        lengths = lengths or {arrays[k].shape[1] for k in wide if goes_on_along_rows(arrays[k])}
    turned = {key: np.squeeze(arrays[key].T) for key in wide if arrays[key].shape[1] in lengths}
    return arrays | turned


def goes_on_along_rows(array: NDArray[Any]) -> bool:
    """Whether the numbers of an array (d, T) or (n, T, d) are smooth along its second axis only."""
    return _roughness(array, 1) < SMOOTH < _roughness(array, 0)


def _roughness(array: NDArray[Any], axis: int) -> float:
    """Mean square step along an axis over twice the variance (von Neumann 1941): 1 for noise."""
    if array.dtype.kind not in "fiub" or not array.size:
        return np.inf
    values = np.asarray(array[:1000, :1000], np.float64)  # a part of a large array suffices
    finite = np.isfinite(values).all(axis=axis, keepdims=True)
    values = np.where(finite, values, 0.0)  # a line with gaps does not count
    variance = float(np.var(values, axis=axis).sum())
    if values.shape[axis] < 2 or not variance > 0.0:
        return np.inf
    return float(np.mean(np.diff(values, axis=axis) ** 2, axis=axis).sum()) / (2.0 * variance)


def _of_qualisys(take: dict[str, Any]) -> dict[str, NDArray[Any]]:
    """Columns `MARKER.x`, `BODY.x`, ... of a QTM take, which has positions (n, d, T) and names."""
    found: dict[str, NDArray[Any]] = {}
    markers = take.get("Trajectories", {}).get("Labeled", {})
    bodies = take.get("RigidBodies", {})
    for group, said, key in ((markers, "Labels", "Data"), (bodies, "Name", "Positions")):
        if "FrameRate" in take and {said, key} <= group.keys() and np.size(group[key]):
            width = 4 if group is markers else 3  # a residual after x, y, z
            places = np.reshape(group[key], (-1, width, np.shape(group[key])[-1]))
            for name, rows in zip(np.atleast_1d(group[said]), places, strict=True):
                found |= {f"{name}.{axis}": row for axis, row in zip("xyz", rows, strict=False)}
    return found


def _of_structs(content: dict[str, Any], before: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays of numbers, texts and units in nested structs, by their paths."""
    for key, value in content.items():
        array = np.asarray(value)
        if isinstance(value, dict):
            yield from _of_structs(value, f"{before}{key}.")
        elif key.startswith("__"):  # added by scipy
            continue
        elif isinstance(value, str) and key.lower() in UNIT and value:
            yield f"{before}#unit", array
        elif array.ndim == 1 and array.size and all(isinstance(v, str) for v in array):
            yield before + key, array.astype(str)
        elif array.dtype == object and array.ndim == 1:
            # an array of structs or cells, unless it has one for each sample
            are_few = len(array) <= 1000 or isinstance(array[0], dict)
            for k, one in enumerate(array if are_few else ()):
                inside = (one, f"{before}{key}.") if isinstance(one, dict) else ({key: one}, before)
                for name, inner in _of_structs(*inside):
                    yield f"{name}_{k}", inner
        elif array.dtype.kind in "fiub" and array.size and array.ndim in (1, 2, 3):
            yield before + key, array


def _demonstrations(h5py: Any, top: Any, are_below: bool = False) -> list[str]:
    """Sorted names of groups `demo_0`, `traj_0`, ..., or paths `ann/trial_0`, ...; other groups may
    stand beside `demo_0`, ... only.
    """
    groups = [name for name in top if isinstance(top[name], h5py.Group)]
    inside = {n: _demonstrations(h5py, top[n], True) for n in groups if not are_below}
    of_each = [NUMBERED.fullmatch(one) for names in inside.values() for one in names]
    are_inside = all(len(names) == len(top[name]) > 0 for name, names in inside.items())
    if inside and are_inside and all(one and DEMONSTRATION.fullmatch(one[1]) for one in of_each):
        return [f"{name}/{one}" for name, names in inside.items() for one in names]
    matches = [NUMBERED.fullmatch(name) for name in groups]
    alone = len({match[1] for match in matches if match}) == 1 and all(matches)
    demos = [name for name in groups if name.startswith("demo_")]  # robomimic has masks beside
    return sorted(groups if alone else demos, key=lambda name: (len(name), name))


def _units(top: Any, names: Collection[str]) -> NDArray[Any]:
    """Pairs (n, 2) of an array or array element and its units, stated by it or its groups."""
    found: dict[str, set[str]] = {}
    depth = max((name.count("/") + 1 for name in names), default=1)

    def visit(path: str, item: Any) -> None:
        if hasattr(item, "ndim"):
            of = "/".join(path.split("/")[:depth])
            name = path[len(of) + 1 :] if of in names else path
            numbered = NUMBERED.fullmatch(name)  # perhaps put on end by `on_end`
            also = [numbered[1]] if numbered and numbered[1] not in top else []
            units = _unit_of(item)
            elements = item.dtype.names or range(len(units))
            ends = [""] if len(set(units)) == 1 else [f".{element}" for element in elements]
            for array in (name, *also):
                for end, unit in zip(ends, units, strict=False):
                    found.setdefault(f"{array}{end}".replace("/", "."), set()).add(unit or "none")

    top.visititems(visit)
    return _pairs(found)


def _pairs(found: dict[str, set[str]]) -> NDArray[Any]:
    said = {name: " or ".join(sorted(units)) for name, units in found.items()}
    return np.array([pair for pair in said.items() if pair[1] != "none"], str).reshape(-1, 2)


def _unit_of(item: Any) -> list[str]:
    """The unit of an array or of each element, stated by it or its groups; [""] for none."""
    said = next((v for k, v in item.attrs.items() if k.lower() in UNIT), ())
    texts = [v for v in np.ravel(said).tolist() if isinstance(v, str | bytes)]
    if not texts and item.name != "/":
        return _unit_of(item.parent)
    return [v.decode() if isinstance(v, bytes) else v for v in texts] or [""]


def _measured(item: Any) -> NDArray[Any]:
    """The numbers of an array; NaN for the missing value that its attributes state (CF 2.5.1)."""
    array = np.asarray(item[()])
    said = [np.ravel(v) for k, v in item.attrs.items() if k.lower() in FILLS]
    missing = np.concatenate([[], *(values for values in said if values.dtype.kind in "fiu")])
    is_none = np.isin(array, missing) & (array.dtype.kind != "b")
    return np.where(is_none, np.nan, array) if is_none.any() else array


def _arrays(group: Any) -> dict[str, NDArray[Any]]:
    found = {}
    is_text = importlib.import_module("h5py").check_string_dtype

    def visit(name: str, item: Any) -> None:
        dotted = name.replace("/", ".")
        if not hasattr(item, "ndim") or item.size * 8 > MOST_BYTES or not item.size:
            return
        if item.dtype.names and item.ndim == 1:
            fields = [field for field in item.dtype.names if item.dtype[field].base.kind in "fiub"]
            found.update({f"{dotted}.{field}": np.asarray(item[field]) for field in fields})
        # wider rows are compressed images, as ALOHA keeps them
        if item.ndim == 2 and item.dtype == np.uint8 and item.shape[1] > 256:
            return
        if item.dtype.kind in "fiub" and (item.ndim in (1, 2) or is_of_places(item)):
            found[dotted] = _measured(item)
        if is_text(item.dtype) and item.ndim == 1:
            texts = item.asstr(errors="replace")[()]
            if max(map(len, texts)) * 4 * item.size <= MOST_BYTES:
                found[dotted] = texts.astype(str)

    group.visititems(visit)
    return found
