# SPDX-License-Identifier: Apache-2.0
"""Models, skills and folders of tasks of strangers: read or refused in one line, 1 GB and 20 s."""

import json
import os
import zipfile

import numpy as np
import pytest
from hostile.strangers import EACH, SEED, check, mutated, save, spoiled, spoiled_arrays

pytestmark = pytest.mark.slow

REQUIRED = ("weight_mean", "noise_variance")
"""Arrays of numbers without which there is no model."""


@pytest.fixture(scope="module")
def model(learned):
    with np.load(learned) as content:
        return {name: content[name] for name in content.files}


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
    codes = []
    for k, arrays in zip(range(6 * len(skill)), spoiled_arrays(rng, skill), strict=False):
        path = save(tmp_path / f"{k}.npz", arrays)
        codes.append(check(worker, "load_pouring_skill", path)["code"])
    assert codes[0] == 0 and 1 in codes


def test_headers_of_models(worker, model, tmp_path):
    rng = np.random.default_rng(SEED + 2)
    header = json.loads(str(model["header"]))
    odd = ["[" * 100_000, '{"a":' * 50_000, "", "null", "[]", "1" * 10_000, "\x1b", "NaN"]
    labels = ([], "ab", [1], ["none"], ["a"] * 3, [["a"]], ["\x1b[2J", "b", "c"])
    labels += (["x" * 500, "b", "c"],)
    odd += [json.dumps(header | {"labels": one}) for one in labels]
    odd += [
        json.dumps(header | {"basis": basis})
        for basis in (None, {}, {"n_basis": 10**9}, {"n_basis": -1}, {"n_basis": "7"})
    ]
    for k in range(EACH):
        text = odd[k] if k < len(odd) else json.dumps(spoiled(rng, header, 0.08))
        path = save(tmp_path / f"{k}.npz", model | {"header": np.array(text)})
        check(worker, "inspect", path)
        check(worker, "load_trained", path)


def test_arrays_of_models(worker, model, tmp_path):
    rng = np.random.default_rng(SEED + 3)
    codes = []
    for k, arrays in zip(range(EACH), spoiled_arrays(rng, model, ["header"]), strict=False):
        path = save(tmp_path / f"{k}.npz", arrays)
        codes.append(check(worker, "inspect", path)["code"])
        check(worker, "load_trained", path)
        for found, whole in ((arrays.get(name), model[name]) for name in REQUIRED):
            is_sound = (
                found is not None and found.dtype.kind in "fiu" and found.shape == whole.shape
            )
            assert is_sound or codes[-1]
    assert codes[0] == 0 and 1 in codes


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
