# SPDX-License-Identifier: Apache-2.0
"""Bags that no recorder writes: sizes, times, definitions and messages that lie."""

import struct
import zlib
from pathlib import Path

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"
POSE, JOINTS = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/JointState"


def text(value: str | bytes) -> bytes:
    data = value if isinstance(value, bytes) else value.encode()
    return struct.pack("<I", len(data)) + data


def record(opcode: int, content: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(content) if length is None else length) + content


def schema(number: int, name: str, definition: str | bytes, encoding: str = "ros2msg") -> bytes:
    return record(3, struct.pack("<H", number) + text(name) + text(encoding) + text(definition))


def channel(number: int, schema_number: int, topic: str, metadata: bytes = b"") -> bytes:
    head = struct.pack("<HH", number, schema_number)
    return record(4, head + text(topic) + text("cdr") + text(metadata))


def message(number: int, log_ns: int, data: bytes, length: int | None = None) -> bytes:
    return record(5, struct.pack("<HIQQ", number, 0, log_ns, log_ns) + data, length)


def chunk(
    records: bytes,
    compression: str = "",
    size: int | None = None,
    times: tuple[int, int] = (0, 2**62),
    crc: int | None = None,
    packed: bytes | None = None,
) -> bytes:
    pack = {"": bytes, "zstd": zstandard.compress, "lz4": lz4.frame.compress}
    data = pack.get(compression, bytes)(records) if packed is None else packed
    crc = zlib.crc32(records) if crc is None else crc
    head = struct.pack("<QQQI", *times, len(records) if size is None else size, crc)
    return record(6, head + text(compression) + struct.pack("<Q", len(data)) + data)


def write(folder: Path, *records: bytes, finished: bool = True) -> Path:
    """A bag without metadata.yaml."""
    folder.mkdir(parents=True)
    end = record(15, bytes(4)) + record(2, bytes(20)) + MAGIC if finished else b""
    content = MAGIC + record(1, text("ros2") + text("fuzz")) + b"".join(records) + end
    (folder / "bag_0.mcap").write_bytes(content)
    return folder
