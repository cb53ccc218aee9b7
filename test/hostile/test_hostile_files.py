# SPDX-License-Identifier: Apache-2.0
"""650 files of strangers, of fifteen kinds: each is read or refused in one line, 1 GB and 20 s."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from hostile import bags_of_strangers as bag
from hostile.strangers import EACH, SEED, YAMLS, check, mutated, spoiled

from intent_recognition.bags.definitions import definition

pytestmark = pytest.mark.slow

LARGEST_INTEGER = 2**64 - 1


@pytest.fixture(scope="module")
def whole(repository):
    """A shipped bag, as bytes and metadata."""
    path = next(iter(sorted((repository / "bags/toolbox/train").iterdir())))
    mcap = next(path.glob("*.mcap"))
    return mcap.name, mcap.read_bytes(), (path / "metadata.yaml").read_text()


def write_bag(folder: Path, whole, metadata: str | bytes | None = None, content=None) -> Path:
    folder.mkdir()
    (folder / whole[0]).write_bytes(whole[1] if content is None else content)
    text = whole[2] if metadata is None else metadata
    (folder / "metadata.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return folder


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


def test_dof_files(worker, whole, tmp_path, repository):
    rng = np.random.default_rng(SEED + 1)
    shipped = (repository / "config/dofs.yaml").read_text()
    path = write_bag(tmp_path / "bag", whole)
    for k in range(EACH):
        if k < len(YAMLS):
            text = YAMLS[k](rng)
        elif k % 2:
            text = yaml.dump(spoiled(rng, yaml.safe_load(shipped), 0.15))
        else:
            text = mutated(rng, shipped.encode())
        file = tmp_path / f"{k}.yaml"
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        check(worker, "train", path, "--dofs", file, "--output", tmp_path / "m.npz")


@pytest.fixture(scope="module")
def learned(worker, repository, tmp_path_factory):
    """A model with its statistics, of a few recordings."""
    path = tmp_path_factory.mktemp("learned") / "m.npz"
    found = sorted((repository / "bags/toolbox/train").iterdir())
    few = [folder for folder in found if folder.name.endswith(("_00", "_01", "_02"))]
    assert worker.run("train", *few, "--output", path)["code"] == 0
    return path


@pytest.fixture(scope="module")
def model(learned):
    with np.load(learned) as content:
        return {name: content[name] for name in content.files}


def save(path, arrays):
    np.savez(path, **arrays)
    return path


def test_tables_and_their_maps(worker, tmp_path, repository):
    rng = np.random.default_rng(SEED + 10)
    text = "t,x,y,z,q\n" + "".join(f"{k / 10},{k},0,1,{k}\n" for k in range(30))
    arrays = {name: np.arange(30.0) + 1 for name in "txyzq"}
    np.savez(tmp_path / "whole.npz", **arrays)
    entry = yaml.safe_load((repository / "config/dofs.yaml").read_text())["observed"][0]
    arm = {"topic": "/joint_states", "type": "sensor_msgs/msg/JointState", "joints": ["a"]}
    content = {
        "observed": [entry | {"columns": ["x", "y", "z"], "columns_unit": "mm"}],
        "controlled": [arm | {"unit": "rad", "columns": ["q"]}],
        "time": {"column": "t", "unit": "s", "since": 1_700_000_000},
        "segments": [{"start": 0.5, "end": 2.5, "task": "give"}],
        "task": "take",
        "labels": {"give": "hand"},
        "metadata": {"group": {"column": "x"}},
        "every": 1,
    }
    codes = []
    for k in range(EACH):
        kind = ("csv", "npz", "c3d")[k % 3]
        whole = text.encode() if kind == "csv" else (tmp_path / "whole.npz").read_bytes()
        data = mutated(rng, whole) if rng.random() < 0.5 else whole
        table, written = tmp_path / f"{k}.{kind}", tmp_path / f"{k}.yaml"
        table.write_bytes(data)
        told = spoiled(rng, content, 0.04) if rng.random() < 0.6 else content
        written.write_text(yaml.safe_dump(told))
        words = ("import", table, "--map", written, "--output", tmp_path / f"bags_{k}")
        codes.append(check(worker, *words)["code"])
    assert {0, 1} <= set(codes)


def test_tables_that_lie(worker, tmp_path, repository):
    """Times no stamp holds, cells, columns and elements without end, folders of other things."""
    entry = yaml.safe_load((repository / "config/dofs.yaml").read_text())["observed"][0]
    arm = {"topic": "/a", "type": "sensor_msgs/msg/JointState", "joints": ["a"], "unit": "rad"}
    content = {
        "observed": [entry | {"columns": ["x", "y", "z"]}],
        "controlled": [arm | {"columns": ["q"]}],
        "time": {"column": "t", "unit": "s"},
    }
    rows = "t,x,y,z,q\n" + "".join(f"{k},{k},0,1,{k}\n" for k in range(9))
    array = {"topic": "/b", "type": "std_msgs/msg/Float64MultiArray", "unit": "m", "columns": "x"}
    header = {**entry, "fields": ["header.frame_id"], "columns": ["x"]}
    maps = [
        content | {"time": {"column": "t", "unit": "s", "since": since}}
        for since in (1e300, 10**40)
    ]
    maps += [content | {"time": {"rate": rate}} for rate in (1e-300, 1e300)]
    maps += [
        content | {"observed": [array | {"fields": [f"data[{n}]"]}]} for n in (10**9, "9" * 30)
    ]
    maps += [content | {"observed": [header]}, content | {"skip_rows": 10**12}]
    maps += [content | {"segments": [{"start": 1e300, "end": 2e300}]}]
    tables = [
        f"t,x,y,z,q\n{time},1,1,1,1\n"
        for time in ("1e9999999", "-1e9999999", "1" * 60_000, "inf", "snan")
    ]
    tables += [",".join(f"c{k}" for k in range(100_000)), "t,x,y,z,q\n" + "\n" * 30_000_000]
    tables += ["t,x,y,z,q\n" + "1,1,1,1,1\n" * 2_100_000]
    for k in range(len(maps) + len(tables)):
        told = maps[k] if k < len(maps) else content
        (tmp_path / "map.yaml").write_text(yaml.safe_dump(told))
        (tmp_path / "t.csv").write_text(rows if k < len(maps) else tables[k - len(maps)])
        words = ("--map", tmp_path / "map.yaml", "--output", tmp_path / f"o{k}")
        assert check(worker, "import", tmp_path / "t.csv", *words)["code"] == 1


def test_data_sets(worker, tmp_path, repository):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    entry = yaml.safe_load((repository / "config/dofs.yaml").read_text())["observed"][0]
    columns = [f"observation.state.{k}" for k in range(3)]
    told = tmp_path / "map.yaml"
    told.write_text(yaml.safe_dump({"observed": [entry | {"columns": columns}]}))
    values = {
        "observation.state": [[float(k), 0.0, 1.0] for k in range(9)],
        "timestamp": [0.1 * k for k in range(9)],
        "episode_index": [0] * 9,
        "task_index": [0] * 9,
    }
    info = {"codebase_version": "v2.1", "features": {}, "data_path": "data/{episode_index}.parquet"}
    task = '{"task_index": 0, "task": "give"}'
    cases = [({}, {}, task)]
    cases += [({"data_path": path}, {}, task) for path in ("", ".", "**", "/dev/*", "../*", 5)]
    cases += [
        ({}, {}, f'{{"task_index": {n}, "task": "x"}}') for n in ("1e400", "NaN", "[]", '"a"')
    ]
    indices = ([None] * 9, [float("nan")] * 9, ["a"] * 9, [[0]] * 9)
    cases += [({}, {"task_index": index}, task) for index in indices]
    cases += [({}, {"observation.state": [[0.0] * 20_000] * 9}, task)]
    cases += [({}, {"timestamp": ["9" * 10_000_000] * 9}, task), ({}, {}, None)]
    for k, (meta, other, tasks) in enumerate(cases):
        folder = tmp_path / f"{k}"
        (folder / "meta").mkdir(parents=True)
        (folder / "data").mkdir()
        (folder / "meta/info.json").write_text(json.dumps(info | meta))
        parquet.write_table(arrow.table(values | other), folder / "data/0.parquet")
        if tasks is None:
            os.mkfifo(folder / "meta/tasks.jsonl")
            os.mkfifo(folder / "data/1.parquet")
        else:
            (folder / "meta/tasks.jsonl").write_text(tasks)
        answer = check(worker, "import", folder, "--map", told, "--output", tmp_path / f"o{k}")
        assert answer["code"] == (meta != {} or tasks is None) or k > 6, (k, answer)


def test_folders_of_tasks(worker, learned, tmp_path):
    rng = np.random.default_rng(SEED + 11)
    at = "2026-01-01T00:00:00+00:00"
    change = {"time": at, "action": "start", "task": "", "bag": "", "model": "models/0001.npz"}
    change |= {"tasks": {"a": 3}}
    execution = {"time": at, "task": "a", "bag": "executions/a/a_0000", "model": ""}
    execution |= {"values": {"outcome": "arrived", "spilled": "0.2", "corrections": "1"}}
    for k in range(EACH // 2):
        folder = tmp_path / f"{k}"
        (folder / "models").mkdir(parents=True)
        for name in ("model.npz", "models/0001.npz"):
            (folder / name).symlink_to(learned)
        for name, whole_line in (("history", change), ("outcomes", execution)):
            lines = [json.dumps(spoiled(rng, whole_line, 0.2)) for _ in range(4)]
            (folder / f"{name}.jsonl").write_text("\n".join(lines))
        if k in (0, 1):
            (folder / ("history.jsonl", "outcomes.jsonl")[k]).unlink()
            os.mkfifo(folder / ("history.jsonl", "outcomes.jsonl")[k])
        check(worker, "inspect", folder)
        check(worker, "tasks", folder)


def test_pouring_skills(worker, tmp_path, repository):
    rng = np.random.default_rng(SEED + 12)
    with np.load(repository / "config/skills/pouring.npz") as content:
        skill = {name: content[name] for name in content.files}
    assert check(worker, "load_pouring_skill", save(tmp_path / "s.npz", skill))["code"] == 0
    for k, name in enumerate([*skill] * 6):
        array = skill[name]
        changed = (
            np.full(array.shape, rng.choice(NUMBERS)), array.astype(complex), np.array(["a"] * 3),
            np.full(array.shape, 1e300), np.zeros(0), np.full(array.shape, 1e9),
        )[k // len(skill)]  # fmt: skip
        path = save(tmp_path / f"{k}.npz", skill | {name: changed})
        check(worker, "load_pouring_skill", path)


def test_headers_of_models(worker, model, tmp_path):
    rng = np.random.default_rng(SEED + 2)
    header = json.loads(str(model["header"]))
    odd = ["[" * 100_000, '{"a":' * 50_000, "", "null", "[]", "1" * 10_000, "\x1b", "NaN"]
    odd += [
        json.dumps(header | {"labels": labels})
        for labels in (
            [],
            "ab",
            [1],
            ["none"],
            ["a"] * 3,
            [["a"]],
            ["\x1b[2J", "b", "c"],
            ["x" * 500, "b", "c"],
        )
    ]
    odd += [
        json.dumps(header | {"basis": basis})
        for basis in (None, {}, {"n_basis": 10**9}, {"n_basis": -1}, {"n_basis": "7"})
    ]
    for k in range(EACH):
        text = odd[k] if k < len(odd) else json.dumps(spoiled(rng, header, 0.08))
        path = save(tmp_path / f"{k}.npz", model | {"header": np.array(text)})
        check(worker, "inspect", path)
        check(worker, "load_trained", path)


NUMBERS = (np.nan, np.inf, -1.0, 0.0, 1e300, -1e300, 1e9, 1e-300)


def test_arrays_of_models(worker, model, tmp_path):
    rng = np.random.default_rng(SEED + 3)
    names = sorted(set(model) - {"header"})
    for k in range(EACH):
        name = names[k % len(names)]
        array, kind = model[name], k % 6
        if kind == 0:
            changed = np.full(array.shape, rng.choice(NUMBERS))
        elif kind == 1:
            changed = array.astype(float).copy()
            changed.flat[int(rng.integers(changed.size)) if changed.size else 0 :][:1] = rng.choice(
                NUMBERS
            )
        elif kind == 2:
            changed = np.zeros((0,) if array.ndim else (2, 2))
        elif kind == 3:
            changed = np.array(["a"] * 3)
        elif kind == 4:
            changed = np.broadcast_to(array, (3, *array.shape))
        else:
            changed = array.astype(complex)
        path = save(tmp_path / f"{k}.npz", model | {name: changed})
        answer = check(worker, "inspect", path)
        assert kind in (0, 1) or name not in ("weight_mean", "noise_variance") or answer["code"]
        check(worker, "load_trained", path)


def npy(shape, dtype="<f8", data=b"") -> bytes:
    header = repr({"descr": dtype, "fortran_order": False, "shape": shape}).encode()
    header += b" " * (63 - (10 + len(header)) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + data


def test_archives(worker, model, learned, tmp_path, repository):
    rng = np.random.default_rng(SEED + 4)
    content = learned.read_bytes()
    bombs = [
        npy((2**60,)), npy((2**30,)), npy((-1,)), npy((2,), "|O", b"x" * 16), npy("x"),
        npy((2**29,), "|u1", bytes(2**26)), b"\x93NUMPY\x09\x00", b"", npy((1,), "<U1000000000"),
        npy((10**6,), [("a", "<f8")]), b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535,
    ]  # fmt: skip
    for k in range(EACH):
        path = tmp_path / f"{k}.npz"
        if k < len(bombs):
            with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
                for name in ("header.npy", "weight_mean.npy", "points.npy"):
                    archive.writestr(name, bombs[k])
        else:
            path.write_bytes(mutated(rng, content))
        check(worker, "inspect", path)
        if k % 5 == 0:
            check(worker, "load_trained", path)


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
    yield (
        "x/A[1000] a\n"
        + "".join(
            f"{'=' * 80}\nMSG: x/{a}\nx/{b}[1000] a\n"
            for a, b in zip("ABCDEF", "BCDEFG", strict=True)
        )
        + "=" * 80
        + "\nMSG: x/G\nuint8 a"
    )
    yield "x/A[] a\n" + "=" * 80 + "\nMSG: x/A\n"
    yield "x/A[] a\n" + "=" * 80 + "\nMSG: x/A\nx/B b\n" + "=" * 80 + "\nMSG: x/B\n"
    yield "x/A[] a\n" + "=" * 80 + "\nMSG: x/A\nuint8[0] b\n"
    yield "x/A a\n" + "=" * 80 + "\nMSG: x/A\nx/A a"
    yield "x/A a\n" + "=" * 80 + "\nMSG: x/A\nx/B a\n" + "=" * 80 + "\nMSG: x/B\nx/A a"
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


def meshes(rng):
    triangle = np.zeros(1, [("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    triangle["v"] = np.eye(3)
    for value in (np.nan, np.inf, 1e38, 0.0):
        changed = np.repeat(triangle, 12)
        changed["v"][3] = value
        yield ".stl", bytes(80) + np.uint32(12).tobytes() + changed.tobytes()
    yield ".stl", bytes(80) + np.uint32(2**32 - 1).tobytes() + triangle.tobytes()
    yield ".stl", b"solid x\n" + b"facet normal 0 0 1\n" * 1000
    yield (
        ".ply",
        b"ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n1",
    )
    yield (
        ".ply",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 999999999\n"
        b"property float x\nproperty float y\nproperty float z\nend_header\n",
    )
    yield ".ply", b"ply\nformat ascii 1.0\nelement vertex -1\nproperty list x y z\nend_header\n"
    yield ".obj", b"v nan nan nan\n" * 9 + b"f 1 2 3\n"
    yield ".obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 999999999\nf -9 -8 -7\n"
    yield ".off", b"OFF\n999999999 999999999 0\n"
    yield ".glb", b"glTF\2\0\0\0" + bytes([255] * 12)
    yield ".gltf", b'{"asset":{"version":"2.0"},"buffers":[{"uri":"/dev/zero","byteLength":9}]}'
    yield ".xyz", b"1 2 3\n" * 3
    yield ".npz", b"PK\3\4"
    while True:
        suffix = str(rng.choice([".stl", ".ply", ".obj", ".off", ".glb", ".xyz", ".dae", ".3mf"]))
        yield (
            suffix,
            mutated(rng, bytes(80) + np.uint32(4).tobytes() + np.repeat(triangle, 4).tobytes()),
        )


def test_meshes(worker, tmp_path):
    rng = np.random.default_rng(SEED + 9)
    for k, (suffix, content) in zip(range(EACH), meshes(rng), strict=False):
        path = tmp_path / f"{k}{suffix}"
        path.write_bytes(content)
        check(worker, "warp", "cup", path, "--output", tmp_path / f"{k}.json")


def test_what_is_no_file(worker, whole, tmp_path):
    good = write_bag(tmp_path / "good", whole)
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    for number, place in enumerate(
        (
            fifo,
            Path("/dev/zero"),
            Path("/dev/full"),
            loop,
            tmp_path / ("n" * 200),
            Path("/proc/self/mem"),
            Path("/"),
            tmp_path / "\x1b[2J",
        )
    ):
        link = tmp_path / f"link{number}"
        for suffix in ("", ".npz", ".mcap", ".yaml", ".stl"):
            path = link.with_name(link.name + suffix)
            path.symlink_to(place)
            if place != Path("/"):
                check(worker, "inspect", path)
            check(worker, "train", good, "--dofs", path, "--output", tmp_path / "m.npz")
            check(worker, "load_trained", path)
        inside = tmp_path / f"bag{number}"
        inside.mkdir()
        if number % 2 == 0:
            (inside / "metadata.yaml").symlink_to(place)
            (inside / "bag_0.mcap").symlink_to(place)
        for k in range(3):
            (inside / f"again{k}").symlink_to(inside if number % 2 else tmp_path)
        check(worker, "inspect", inside)
        check(worker, "recover", inside, "--output", tmp_path / f"saved{number}")


@pytest.mark.parametrize("words", [["--json"], []])
def test_a_full_disk_is_told_in_one_line(whole, tmp_path, words):
    path = write_bag(tmp_path / "bag", whole)
    command = [sys.executable, "-m", "intent_recognition.cli.main", "inspect", str(path), *words]
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True)
    assert ended.returncode == 1
    assert ended.stderr.count("\n") == 1
    assert "No space left" in ended.stderr
