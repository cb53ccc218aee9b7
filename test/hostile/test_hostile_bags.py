# SPDX-License-Identifier: Apache-2.0
"""Bags of strangers: read or refused in one line, 1 GB and 20 s."""

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from hostile import bags_of_strangers as bag
from hostile.strangers import EACH, SEED, YAMLS, check, mutated, spoiled, write_bag

from intent_recognition.bags.definitions import definition

pytestmark = pytest.mark.slow

LARGEST_INTEGER = 2**64 - 1


def read_bag(worker, path, rng):
    check(worker, "inspect", path, *(["--json"] if rng.random() < 0.3 else []))
    if rng.random() < 0.4:
        check(worker, "recover", path, "--output", path.with_name(path.name + "_saved"))
    if rng.random() < 0.4:
        check(worker, "train", path, "--output", path.with_name("m.npz"))


def test_what_is_whole_is_read(worker, whole, learned, tmp_path):
    path = write_bag(tmp_path / "bag", whole)
    assert check(worker, "inspect", path)["code"] == 0
    assert check(worker, "inspect", learned)["code"] == 0
    assert check(worker, "load_trained", learned)["code"] == 0
    made = bag.write(tmp_path / "made", known(), bag.chunk(bag.message(1, 5, stamped()), "lz4"))
    assert '"count": 1' in check(worker, "inspect", made, "--json")["text"]


def test_metadata(worker, whole, tmp_path):
    rng = np.random.default_rng(SEED)
    for k in range(EACH):
        if k < len(YAMLS):
            text = YAMLS[k](rng)
        elif k % 2:
            text = yaml.dump(spoiled(rng, yaml.safe_load(whole[2]), 0.1))
        else:
            text = mutated(rng, whole[2].encode())
        read_bag(worker, write_bag(tmp_path / f"{k}", whole, text), rng)


def test_damaged_recordings(worker, whole, tmp_path):
    rng = np.random.default_rng(SEED + 5)
    for k in range(EACH):
        read_bag(worker, write_bag(tmp_path / f"{k}", whole, content=mutated(rng, whole[1])), rng)


def stamped(count=1, tail=b""):
    """A PoseStamped with these bytes behind its header."""
    return b"\0\1\0\0" + bytes(8) + b"\2\0\0\0w\0" + bytes(2) + bytes(56 * count) + tail


def known(topic="mocap/wrist/pose", kind=bag.POSE, text=None):
    return bag.schema(1, kind, definition(kind).text if text is None else text) + bag.channel(
        1, 1, topic
    )


def chunks(rng):
    """Chunks whose sizes and times lie; the file is small."""
    zeros = bytes(2**26)
    small = bag.message(1, 5, stamped())
    many = small * 1000
    yield bag.chunk(zeros + b"x", "lz4", size=100)
    yield bag.chunk(b"", "zstd", size=2**40, packed=zstandard.compress(zeros))
    yield bag.chunk(b"", "zstd", size=100, packed=zstandard.compress(zeros))
    yield bag.chunk(b"", "lz4", size=100, packed=lz4.frame.compress(zeros))
    yield bag.chunk(b"", "lz4", size=2**62, packed=lz4.frame.compress(zeros))
    claim = b"\x28\xb5\x2f\xfd\xe0" + (2**33).to_bytes(8, "little") + b"\x01\x00\x00"
    yield bag.chunk(b"", "zstd", size=2**33, packed=claim)
    yield bag.chunk(b"", "zstd", size=2**25, packed=claim)
    bomb = bag.chunk(b"", "zstd", size=len(zeros), crc=0, packed=zstandard.compress(zeros))
    yield bomb * 40
    yield bomb
    tiny = bag.message(1, 5, b"")
    full = tiny * (2**22 // len(tiny))
    yield bag.chunk(full, "zstd", times=(5, 5)) * 2
    yield bag.chunk(full, "lz4", times=(5, 5))
    yield bag.chunk(many, "zstd", times=(0, 2**63))
    for log_ns in (2**63, LARGEST_INTEGER, 2**62):
        yield bag.chunk(bag.message(1, log_ns, stamped()), times=(0, log_ns))
        yield bag.message(1, log_ns, stamped())
    yield bag.chunk(many, "zstd", size=10)
    yield bag.chunk(many, "", size=10)
    yield bag.chunk(many, "bzip2")
    yield bag.chunk(many, "x" * 70_000)
    yield bag.chunk(many, "zstd", times=(9, 2))
    yield bag.chunk(bag.message(7, 5, stamped()))
    yield bag.chunk(bag.message(1, 5, b"", length=2**63))
    yield bag.chunk(bag.message(1, 5, b"", length=3))
    yield bag.record(6, b"", length=2**63)
    yield bag.record(0x80, b"", length=LARGEST_INTEGER)
    yield bag.record(7, bytes(6)) * 50_000
    yield bag.chunk(bag.chunk(many))
    yield bag.schema(0, "", "") * 3000 + bag.channel(1, 9, "")
    while True:
        sizes = rng.integers(0, 2**40, 2)
        data = rng.bytes(int(rng.integers(0, 200)))
        kind = str(rng.choice(["zstd", "lz4", "", "none"]))
        yield bag.chunk(data, kind, int(sizes[0]), (0, int(sizes[1])), 0)


def test_chunks(worker, tmp_path):
    rng = np.random.default_rng(SEED + 6)
    for k, records in zip(range(EACH), chunks(rng), strict=False):
        path = bag.write(tmp_path / f"{k}", known(), records, finished=bool(k % 3))
        assert sum(f.stat().st_size for f in path.iterdir()) < 15_000_000
        read_bag(worker, path, rng)


def definitions(rng):
    yield "float64 a\n" * 300_000
    yield "".join(f"float64 a{k}\n" for k in range(300_000))
    yield "".join(f"float64 a{k}\n" for k in range(1900))
    yield "uint8[4000000000] a"
    yield "uint8[99999999999999999999999999] a"
    yield "string[999999999] a"
    of = "=" * 80 + "\nMSG: x/"
    nested = (f"{of}{a}\nx/{b}[1000] a\n" for a, b in zip("ABCDEF", "BCDEFG", strict=True))
    yield "x/A[1000] a\n" + "".join(nested) + f"{of}G\nuint8 a"
    yield f"x/A[] a\n{of}A\n"
    yield f"x/A[] a\n{of}A\nx/B b\n{of}B\n"
    yield f"x/A[] a\n{of}A\nuint8[0] b\n"
    yield f"x/A a\n{of}A\nx/A a"
    yield f"x/A a\n{of}A\nx/B a\n{of}B\nx/A a"
    yield "geometry_msgs/msg/PoseStamped a"
    yield "float64"
    yield "no/such[] a"
    yield "float64 a=1e999"
    yield 'string a="' + "x" * 50_000
    yield "int8 a = " + "9" * 9000
    yield "string<=3 a\nstring[<=3] b\nwstring c\nuint8[<=5] d"
    yield "(" * 10_000
    yield "float64 __class__\nfloat64 self\nfloat64 import"
    yield "\x1b[2J a"
    yield "\0"
    yield "# " + "x" * 90_000
    yield "=" * 90_000
    yield ("=" * 80 + "\nMSG: a/b\n") * 900
    shipped = definition(bag.POSE).text
    while True:
        yield mutated(rng, shipped.encode()).decode("latin-1")


def test_definitions(worker, tmp_path):
    rng = np.random.default_rng(SEED + 7)
    data = b"\0\1\0\0" + b"\xff\xff\xff\x7f" * 20
    for k, text in zip(range(EACH), definitions(rng), strict=False):
        kind = bag.POSE if k % 2 else "x/msg/Y"
        messages = b"".join(bag.message(1, n, d) for n, d in enumerate((data, stamped(), b"")))
        path = bag.write(tmp_path / f"{k}", known(kind=kind, text=text), bag.chunk(messages))
        check(worker, "inspect", path)
        check(worker, "train", path, "--output", tmp_path / "m.npz")
        check(worker, "recover", path, "--output", tmp_path / f"{k}_saved")


def test_messages(worker, tmp_path):
    rng = np.random.default_rng(SEED + 8)
    joints = b"\0\1\0\0" + bytes(8) + b"\1\0\0\0\0\0\0\0" + b"\xff\xff\xff\xff" + bytes(40)
    for k in range(EACH):
        kind, topic = ((bag.POSE, "mocap/wrist/pose"), (bag.JOINTS, "joint_states"))[k % 2]
        good = stamped() if kind == bag.POSE else joints
        numbers = np.frombuffer(good, np.uint8).copy()
        found = []
        for n in range(60):
            data = mutated(rng, good) if n % 2 else numbers.tobytes()
            found.append(bag.message(1, 5 + n, data))
        special = rng.choice([0x7FF8000000000000, 0x7FF0000000000000, 0xFFEFFFFFFFFFFFFF], 7)
        found.append(bag.message(1, 99, good[:20] + special.astype("<u8").tobytes()))
        path = bag.write(tmp_path / f"{k}", known(topic, kind), bag.chunk(b"".join(found), "zstd"))
        read_bag(worker, path, rng)
