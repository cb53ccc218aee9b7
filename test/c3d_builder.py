# SPDX-License-Identifier: Apache-2.0
"""C3D files of every kind, byte by byte: no library writes what exporters do."""

import struct

import numpy as np
import pytest

START = struct.pack("<H", 2**16 - 2)
"""Where data begin, until it is known."""


def c3d_file(
    points,
    *,
    units="mm",
    labels,
    rate=100.0,
    frames_by="FRAMES",
    repeat=False,
    analog_stated=0,
    analog=0,
    analog_rate=0.0,
    order="<",
    more=(),
    used=None,
    said_rate=0.0,
    said_frames=0,
    scale=-1.0,
) -> bytes:
    """A file with float values.

    Args:
        points: (T, N, 3).
        units: of the points; None for no such parameter.
        labels: of the points, (N,).
        rate: frames a second.
        frames_by: parameter that states more than 65 535 frames.
        repeat: whether parameters are there twice.
        analog_stated: analog values of a frame that the header states; there are none.
        analog: channels, whose scales and names the file does not say.
        analog_rate: values of each channel a second, also where there is none; 0 for none said.
        order: of bytes, "<" of Intel or ">" of SGI.
        more: further parameters of the points, names and texts.
        used: how many points parameters say there are, not the header; 0 for no such parameter.
        said_rate: that of the header, 0 for the same.
        said_frames: how many parameters say there are, not the header.
        scale: that of the parameters.
    """
    pytest.importorskip("ezc3d", reason="it reads them")
    frames, count = points.shape[:2]
    body = _group(order, 1, "POINT") + _group(order, 2, "ANALOG") + _group(order, 3, "TRIAL")
    used = count if used is None else used
    body += _parameter(order, 1, "USED", 2, [], struct.pack(f"{order}H", used)) if used else b""
    stated = struct.pack(f"{order}H", said_frames or min(frames, 2**16 - 1))
    body += _parameter(order, 1, "FRAMES", 2, [], stated)
    body += _parameter(order, 1, "SCALE", 4, [], struct.pack(f"{order}f", scale))
    body += _parameter(order, 1, "RATE", 4, [], struct.pack(f"{order}f", rate))
    body += _parameter(order, 1, "DATA_START", 2, [], START)
    body += _parameter(order, 2, "USED", 2, [], struct.pack(f"{order}H", analog))
    if analog_rate:
        body += _parameter(order, 2, "RATE", 4, [], struct.pack(f"{order}f", analog_rate))
    for k in range(0, count, 255):
        body += _texts(order, 1, f"LABELS{k // 255 + 1 if k else ''}", labels[k : k + 255])
    for name, values in dict(more).items():
        body += _texts(order, 1, name, values)
    for _ in range(2 if repeat else 1):
        body += b"" if units is None else _texts(order, 1, "UNITS", [units])
    if frames_by == "TRIAL":
        for name, number in (("ACTUAL_START_FIELD", 1), ("ACTUAL_END_FIELD", frames)):
            words = struct.pack(f"{order}HH", number % 2**16, number // 2**16)
            body += _parameter(order, 3, name, 2, [2], words)
    if frames_by == "LONG_FRAMES":
        body += _parameter(order, 1, "LONG_FRAMES", 4, [], struct.pack(f"{order}f", frames))
    body += b"\0\0"
    blocks = -(-(len(body) + 4) // 512)
    body = body.replace(START + b"\0", struct.pack(f"{order}H", 2 + blocks) + b"\0", 1)
    head = struct.pack(
        f"{order}BBHHHHHfHHf", 2, 0x50, count, analog_stated or analog, 1,
        min(frames, 2**16 - 1), 0, -1.0, 2 + blocks, int(analog > 0), said_rate or rate,
    )  # fmt: skip
    values = np.concatenate([points, np.zeros((frames, count, 1))], axis=2)
    values = np.hstack([values.reshape(frames, 4 * count), np.ones((frames, analog))])
    parameters = struct.pack("<BBBB", 1, 0x50, blocks, 84 if order == "<" else 86) + body
    return b"".join(map(_filled, (head, parameters, values.astype(f"{order}f4").tobytes())))


def _filled(data: bytes) -> bytes:
    return data.ljust(-(-len(data) // 512) * 512, b"\0")


def _group(order: str, number: int, name: str) -> bytes:
    return struct.pack("<bb", len(name), -number) + name.encode() + struct.pack(f"{order}hB", 3, 0)


def _parameter(
    order: str, group: int, name: str, kind: int, sizes: list[int], data: bytes
) -> bytes:
    content = struct.pack("<bB", kind, len(sizes)) + bytes(sizes) + data + b"\0"
    head = struct.pack("<bb", len(name), group) + name.encode()
    return head + struct.pack(f"{order}h", 2 + len(content)) + content


def _texts(order: str, group: int, name: str, values) -> bytes:
    rows = [value.encode("latin-1") for value in values]
    width = max(map(len, rows))
    return _parameter(
        order, group, name, -1, [width, len(rows)], b"".join(r.ljust(width) for r in rows)
    )
