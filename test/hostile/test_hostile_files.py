# SPDX-License-Identifier: Apache-2.0
"""Tables, maps, meshes and other files of strangers: read or refused in one line, 1 GB and 20 s."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from hostile.strangers import EACH, SEED, YAMLS, check, mutated, spoiled, write_bag

pytestmark = pytest.mark.slow


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
    tables += [",".join(f"c{k}" for k in range(100_000)), "t,x,y,z,q\n" + "\n" * 3_000_000]
    tables += ["t,x,y,z,q\n" + "1,1,1,1,1\n" * 2_100_000]
    for k in range(len(maps) + len(tables)):
        told = maps[k] if k < len(maps) else content
        (tmp_path / "map.yaml").write_text(yaml.safe_dump(told))
        (tmp_path / "t.csv").write_text(rows if k < len(maps) else tables[k - len(maps)])
        words = ("--map", tmp_path / "map.yaml", "--output", tmp_path / f"o{k}")
        answer = check(worker, "import", tmp_path / "t.csv", *words)
        assert answer["code"] == 1 and answer["megabytes"] < 250.0


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


def test_what_is_no_file(worker, whole, tmp_path):
    good = write_bag(tmp_path / "good", whole)
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    odd = (Path(name) for name in ("/dev/zero", "/dev/full", "/proc/self/mem", "/"))
    for number, place in enumerate(
        (fifo, loop, *odd, tmp_path / ("n" * 200), tmp_path / "\x1b[2J")
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
