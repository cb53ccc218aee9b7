# SPDX-License-Identifier: Apache-2.0
"""Arms, objects and small texts of strangers: a hundred are each used or refused in one line."""

import os
from itertools import islice

import numpy as np
import pytest
import yaml
from hostile import descriptions_of_strangers as strange
from hostile.strangers import EACH, SEED, check, spoiled_arrays

pytestmark = pytest.mark.slow

DETECTOR = "config/deviation/lwr.yaml"
SEQUENCES = "config/examples/toolbox_sequence.yaml"
BOXES = ["crate 0.4 0.4 0.1 0.2 0.3 0.2", "box 0 0 1 1 1 1 0 0 0.6 0.8", "", " "]
VIA_POINTS = [
    {"name": "a", "task": "plate_handover", "phase": 0.6, "dofs": {"lwr_a4_joint": 1.2}, "std": 1},
    {"name": "b", "time": 0.5, "hand": [0.4, 0.1, 0.3], "std": [0.1, 0.1, 0.2]},
]


@pytest.fixture
def folder(tmp_path):
    """A folder with what hostile files refer to."""
    (tmp_path / "box.stl").write_bytes(strange.written(*strange.cup(8), ".stl"))
    (tmp_path / "broken.stl").write_bytes(bytes(80) + b"\xff" * 8)
    (tmp_path / "broken.obj").write_bytes(b"mtllib fifo.stl\nv 0 0 0\nf 1 2 99999999\n")
    (tmp_path / "broken.dae").write_text(f"{strange.LAUGHS}<COLLADA>&a12;</COLLADA>")
    (tmp_path / "own_fifo.mtl").write_text("newmtl a\nmap_Kd fifo.stl\n")
    (tmp_path / "own_zero.mtl").write_text("newmtl a\nmap_Kd /dev/zero\n")
    (tmp_path / "loop.stl").symlink_to("loop.stl")
    (tmp_path / "huge").touch()
    os.truncate(tmp_path / "huge", 2**40)
    os.mkfifo(tmp_path / "fifo.stl")
    return tmp_path


def test_arms(worker, folder):
    codes = []
    texts = islice(strange.arms(np.random.default_rng(SEED)), 0, 3 * EACH, 5)
    for k, text in enumerate(texts):
        path = folder / f"{k}.urdf"
        text = text.replace('"fifo.stl"', f'"{folder}/fifo.stl"')
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        calls = ("find_arm", "keep_clear", "simulate")
        codes.append(check(worker, calls[k % 3], path)["code"])
    assert codes[0] == 0
    assert {0, 1} == set(codes)


def test_targets(worker, folder):
    codes = []
    rng = np.random.default_rng(SEED)
    for k, (suffix, content) in enumerate(islice(strange.targets(rng), 0, 9 * EACH // 4, 8)):
        path = folder / f"{k}{suffix}"
        path.write_bytes(content)
        codes.append(check(worker, "warp", "mug", path)["code"])
    assert codes[0] == 0


def test_objects(worker, folder, repository):
    target = folder / "cup.ply"
    target.write_bytes(strange.written(*strange.cup(), ".ply"))
    with np.load(repository / "config/objects/mug.npz") as content:
        mug = {name: content[name] for name in content.files}
    codes = []
    rng = np.random.default_rng(SEED)
    for k, arrays in zip(range(EACH // 3), spoiled_arrays(rng, mug), strict=False):
        np.savez(folder / f"{k}.npz", **arrays)
        words = ("warp", folder / f"{k}.npz", target, "--grasp")
        codes.append(check(worker, *words)["code"])
    assert codes[0] == 0


@pytest.mark.parametrize("kind", ["sequences", "via_points", "boxes", "detector", "scene"])
def test_small_texts(worker, tmp_path, repository, kind, toolbox_model):
    shipped = {"sequences": SEQUENCES, "detector": DETECTOR, "scene": "config/scenes/toolbox.yaml"}
    whole = {"via_points": VIA_POINTS, "boxes": BOXES}.get(kind)
    if whole is None:
        whole = yaml.safe_load((repository / shipped[kind]).read_text())
    more = [toolbox_model] if kind == "via_points" else []
    rng = np.random.default_rng(SEED)
    for k, text in zip(range(EACH // 3), strange.texts(rng, whole, yaml.safe_dump), strict=False):
        path = tmp_path / f"{k}.yaml"
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
        check(worker, f"read_{kind}", path, *more)
