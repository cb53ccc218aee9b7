# SPDX-License-Identifier: Apache-2.0
"""Read the points of a C3D file by either of two libraries; run by `isolated`."""

import importlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_STATED, MOST_LABELS = 2**16 - 1, 255
"""Largest number of frames that a header can state, and most texts in one parameter."""
NAMED = re.compile(r"LABELS\d*")
INTEL, SGI = b"\x54", b"\x56"
"""Processors by the fourth byte of the parameters; any other is VAX, which swaps the two words of a
float, while the bytes of words are as in Intel's."""
OUTPUTS = {"ANGLE": "deg", "FORCE": "N", "MOMENT": "Nmm", "POWER": "W"}
"""What Vicon's models write as points: listed in ANGLES, ... with the unit in ANGLE_UNITS, ... or,
without one, that of Nexus."""
Arrays = dict[str, NDArray[Any]]


def ezc3d(path: str) -> Arrays:
    """Read `points` (T, N, 3), NaN where a marker was not seen, `labels`, `unit`, the `units` of
    outputs of models, `rate`, the header's `header_rate`, the stated number of frames `said`, and
    `room`, the number that fits.
    """
    file = importlib.import_module("ezc3d").c3d(path)
    point = file["parameters"]["POINT"]
    points = file["data"]["points"][:3].transpose(2, 1, 0)
    residuals = file["data"]["meta_points"]["residuals"][0].T
    values = file["data"]["analogs"].size / max(len(points), 1)
    scale = point["SCALE"]["value"][0] if "SCALE" in point else -1.0
    _check_frame(path, count := points.shape[1], values, scale)
    points = np.where((residuals < 0.0)[:, :, None], np.nan, points)
    texts = {key: list(map(str, point[key].get("value", ()))) for key in point}
    labels = _all_labels(texts, count)
    poses = file["data"].get("rotations", np.empty(0))  # (4, 4, n, T), as Theia writes bodies
    if poses.ndim == 4 and poses.size and poses.shape[3] == len(points):
        labels = [*labels, *[""] * count][:count]
        labels += file["parameters"]["ROTATION"]["LABELS"]["value"]
        points = np.concatenate([points, poses[:3, 3].transpose(2, 1, 0)], axis=1)
    return {
        "points": points,
        **_described(texts, labels),
        "rate": np.array(float(file["header"]["points"]["frame_rate"])),
        **_stated(path),
    }


def c3d(path: str) -> Arrays:
    """Read the same; analog channels without scales crash ezc3d 1.7.2."""
    library = importlib.import_module("c3d")
    # The check would refuse a rate of analog channels in a file without any.
    library.Reader._check_metadata = lambda _: None
    with Path(path).open("rb") as stream:
        reader = library.Reader(stream)
        values = reader.analog_used * reader.analog_per_frame
        _check_frame(path, reader.point_used, values, reader.point_scale)
        keys = ["LABELS", "LABELS2", "LABELS3", "UNITS"]
        keys += [f"{kind}{end}" for kind in OUTPUTS for end in ("S", "_UNITS")]
        named = [key for key in keys if reader.get(f"POINT:{key}")]
        texts = {key: reader.get(f"POINT:{key}").string_array.ravel() for key in named}
        frames = [points for _, points, _ in reader.read_frames()]
        points = np.array(frames, np.float64).reshape(len(frames), -1, 5)
        return {
            "points": np.where((points[:, :, 3] < 0.0)[:, :, None], np.nan, points[:, :, :3]),
            **_described(texts, _all_labels(texts, points.shape[1])),
            "rate": np.array(float(reader.point_rate)),
            **_stated(path),
        }


def _described(texts: Mapping[str, Any], labels: Sequence[str]) -> Arrays:
    """The `labels` of points, their `unit`, and the `units` of outputs of models, else ""."""
    unit_of: dict[str, str] = {}
    for kind, usual in OUTPUTS.items():
        unit = "".join(texts.get(f"{kind}_UNITS", ())[:1]).strip() or usual
        unit_of |= dict.fromkeys((name.strip() for name in texts.get(f"{kind}S", ())), unit)
    units = [unit_of.get(label.strip(), "") for label in labels]
    unit = "".join(texts.get("UNITS", ())[:1])
    return {"labels": np.array(labels), "unit": np.array(unit), "units": np.array(units)}


def _all_labels(parts: Mapping[str, Any], count: int) -> list[str]:
    """Labels from LABELS, and from LABELS2, ... if the one before is full or labels are missing."""
    order = sorted((key for key in parts if NAMED.fullmatch(key)), key=lambda key: (len(key), key))
    found: list[str] = []
    for key in order:
        own = [str(label).strip() for label in parts[key]]
        if found and own[: len(found)] == found:
            found = own
        elif len(found) % MOST_LABELS == 0 or len(found) + len(own) <= count:
            found += own
    return found


def _check_frame(path: str, points: int, values: float, scale: float) -> None:
    """Raise ValueError if a library assumes another frame size than a header that fits the file.

    The parameters may be wrong; then all values after the first frame would be read wrongly.
    """
    frames, said, size, _ = _header(path)
    frame = (4 * points + values) * (4 if scale < 0.0 else 2)
    if frames and 0 <= size - frames * said < 512 and frame != said:
        got = f"{points} points, {values:g} analog values and a scale of {scale:g}"
        raise ValueError(f"{got}, where the header has frames of {said} bytes")


def _stated(path: str) -> Arrays:
    """The header's rate, the number of frames for which the file without padding has `room`, and
    the stated number (`said`), which is `room` if the header cannot state so many.
    """
    frames, frame, size, rate = _header(path)
    room = max(size - 511, 0) // frame if frame else 0
    found = {"said": max(frames, room if room > MOST_STATED else 0), "room": room}
    return {name: np.array(number) for name, number in {**found, "header_rate": rate}.items()}


def _header(path: str) -> tuple[int, int, int, float]:
    """Number of frames that the header states, 0 for none; size of a frame, and of the file from
    the first frame on [bytes]; frames per second.

    The words of the header, from 1 on: 2 points, 3 analog values per frame, 4 first frame, 5 last
    frame, 7 and 8 scale, 9 first block of the data, 11 and 12 rate.
    """
    with Path(path).open("rb") as stream:
        head = stream.read(24)
        stream.seek(head[0] * 512 - 509)
        processor = stream.read(1)
        size = stream.seek(0, 2)
    order = ">" if processor == SGI else "<"
    words = np.frombuffer(head, f"{order}u2").astype(int).tolist()
    last = words[4] if words[4] < 2**16 - 1 else 0
    frames = last - words[3] + 1 if 0 < words[3] <= last else 0
    sign = words[7] if processor == INTEL else words[6]
    width = 4 if sign >= 2**15 else 2  # bytes; a negative scale means that values are floats
    is_vax = processor not in (INTEL, SGI)
    said = head[22:24] + head[20:22] if is_vax else head[20:24]
    rate = float(np.frombuffer(said, f"{order}f4")[0]) / (4.0 if is_vax else 1.0)
    return frames, (4 * words[1] + words[2]) * width, size - (words[8] - 1) * 512, rate
