# SPDX-License-Identifier: Apache-2.0
"""Points of a C3D file by ezc3d, or by c3d where it cannot: run by `isolated`."""

import importlib
import re
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_STATED, MOST_LABELS = 2**16 - 1, 255
"""Frames that a header can state, and texts that a parameter holds."""
NAMED = re.compile(r"LABELS\d*")
INTEL, SGI = b"\x54", b"\x56"
"""Processors by the fourth byte of the parameters; of others, VAX, the words of a float change
places, and words are as Intel's."""
Arrays = dict[str, NDArray[Any]]


def read(path: str) -> Arrays:
    """`points` (T, N, 3), NaN where a marker was not seen, `labels`, `unit`, `rate`, `said`: how
    many frames the file says it has.
    """
    return _first(path, {"ezc3d": _by_ezc3d, "c3d": _by_c3d})


def read_again(path: str) -> Arrays:
    """As `read`, of a file that crashed it: ezc3d 1.7.2 does for analog channels without scales."""
    return _first(path, {"c3d": _by_c3d})


def _first(path: str, readers: Mapping[str, Callable[[Any, str], Arrays]]) -> Arrays:
    """What the first library that can makes of it."""
    reasons = []
    for name, reader in readers.items():
        try:
            library = importlib.import_module(name)
        except ImportError:
            continue
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # that there is no analog channel
                return reader(library, path)
        except Exception as error:  # they raise what they meet
            reasons.append(f"{name} says: {error}")
    raise ValueError("; ".join(reasons) or "no library")


def _by_ezc3d(library: Any, path: str) -> Arrays:
    file = library.c3d(path)
    point = file["parameters"]["POINT"]
    points = file["data"]["points"][:3].transpose(2, 1, 0)
    residuals = file["data"]["meta_points"]["residuals"][0].T
    header = file["header"]["points"]
    values = file["data"]["analogs"].size / max(len(points), 1)
    if (fitting := _fitting_values(path)) not in (None, values):
        raise ValueError(f"{values:g} analog values a frame, where the file has room for {fitting}")
    return {
        "points": np.where((residuals < 0.0)[:, :, None], np.nan, points),
        "labels": np.array(
            _all_labels({key: point[key].get("value", ()) for key in point}, points.shape[1])
        ),
        "unit": np.array("".join(point["UNITS"]["value"][:1]) if "UNITS" in point else ""),
        "rate": np.array(float(header["frame_rate"]) or float(point["RATE"]["value"][0])),
        "said": np.array(_stated(path)),
    }


def _by_c3d(library: Any, path: str) -> Arrays:
    with Path(path).open("rb") as stream:
        reader = library.Reader(stream)
        units = reader.get("POINT:UNITS")
        named = [key for key in ("LABELS", "LABELS2", "LABELS3") if reader.get(f"POINT:{key}")]
        labels = {key: reader.get(f"POINT:{key}").string_array.ravel() for key in named}
        frames = [points for _, points, _ in reader.read_frames()]
        points = np.array(frames, np.float64).reshape(len(frames), -1, 5)
        return {
            "points": np.where((points[:, :, 3] < 0.0)[:, :, None], np.nan, points[:, :, :3]),
            "labels": np.array(_all_labels(labels, points.shape[1])),
            "unit": np.array(str(units.string_array.ravel()[0]) if units is not None else ""),
            "rate": np.array(float(reader.point_rate)),
            "said": np.array(_stated(path)),
        }


def _all_labels(parts: Mapping[str, Any], count: int) -> list[str]:
    """Labels of LABELS, and of LABELS2, ... after a full one or for points without one."""
    order = sorted((key for key in parts if NAMED.fullmatch(key)), key=lambda key: (len(key), key))
    found: list[str] = []
    for key in order:
        own = [str(label).strip() for label in parts[key]]
        if found and own[: len(found)] == found:
            found = own
        elif len(found) % MOST_LABELS == 0 or len(found) + len(own) <= count:
            found += own
    return found


def _fitting_values(path: str) -> int | None:
    """Analog values of a frame by the header, where its frames fill the file with them."""
    values, frames, frame, size = _header(path)
    return values if frames and 0 <= size - frames * frame < 512 else None


def _stated(path: str) -> int:
    """Frames that the header states or the file has room for, 0 where neither is known."""
    _, stated, frame, size = _header(path)
    if not frame or size < 0:
        return stated
    held = size // frame  # the last block may be filled up: by frames that nobody stated
    return max(stated, held if (held - max(stated, MOST_STATED)) * frame >= 512 else 0)


def _header(path: str) -> tuple[int, int, int, int]:
    """Analog values of a frame, count of frames, bytes of one and of all that follow.

    Words of the header, from 1 on: 2 points, 3 analog values of a frame, 4 and 5 first and last
    frame, 7 and 8 scale, 9 block where the data begin.
    """
    with Path(path).open("rb") as stream:
        head = stream.read(18)
        stream.seek(head[0] * 512 - 509)
        processor = stream.read(1)
        size = stream.seek(0, 2)
    words = np.frombuffer(head, ">u2" if processor == SGI else "<u2").astype(int).tolist()
    last = words[4] if words[4] < 2**16 - 1 else 0
    frames = last - words[3] + 1 if 0 < words[3] <= last else 0
    sign = words[7] if processor == INTEL else words[6]
    width = 4 if sign >= 2**15 else 2  # bytes: a scale below zero says that values are floats
    return words[2], frames, (4 * words[1] + words[2]) * width, size - (words[8] - 1) * 512
