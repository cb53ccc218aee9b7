# SPDX-License-Identifier: Apache-2.0
"""A folder where everything that the commands of README and docs name is there."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from docs.shown import ROOT, commands

from intent_recognition.cli import main as cli
from sim_bridge.containers.generate import make_container

MODELS = re.compile(r"\b\w+\.npz\b")
INSIDE = ("handover_csv", "demos")
"""Folders of the bench that commands name."""
POSE = "{topic: /mocap/wrist/pose, type: geometry_msgs/msg/PoseStamped"


@pytest.fixture(scope="session")
def bench(tmp_path_factory, once) -> Path:
    """The folder, with few recordings of each task and a model of them under every name."""
    folder = tmp_path_factory.mktemp("bench")
    words = {word for shown in commands() for word in shown.words}
    bags = _recordings(folder, words)
    _objects(folder)
    _handovers(folder / "handover_csv")
    _take(folder / "take.csv")
    _takes(folder)
    (folder / "config").symlink_to(ROOT / "config")
    shutil.copy(ROOT / "config" / "dofs.yaml", folder / "my_dofs.yaml")
    shutil.copy(ROOT / "config" / "dofs.yaml", folder / "panda_dofs.yaml")
    shutil.copy(ROOT / "config" / "real_arm.yaml", folder / "my_params.yaml")
    shutil.copy(ROOT / "config" / "scenes" / "toolbox.yaml", folder / "my_cell.yaml")
    model = once("learned_first", lambda there: _learn(bags, there)) / "m.npz"
    tables = (
        ("import", "handover_csv", "--map", "config/maps/baton.yaml", "--output", "out/baton"),
        ("export", "demos", "--output", "out/demos.csv"),
    )
    for words_ in tables:
        assert cli.main([str(folder / w) if "/" in w or w in INSIDE else w for w in words_]) == 0
    for name in {name for word in words for name in MODELS.findall(word)}:
        if not (folder / name).exists():
            shutil.copy(model, folder / name)
    return folder


def _learn(bags: list[Path], folder: Path) -> None:
    """As the commands of the pages do."""
    assert cli.main(["train", *map(str, bags), "--output", str(folder / "m.npz")]) == 0


def _recordings(folder: Path, words: set[str]) -> list[Path]:
    """Links to some of the shipped; those of the toolbox are returned."""
    toolbox = ROOT / "bags" / "toolbox"
    bags = sorted(bag for bag in (toolbox / "train").iterdir() if re.search(r"_0[0-2]$", bag.name))
    for target, found in (
        ("bags/toolbox/train", bags),
        ("bags/toolbox/test", sorted(toolbox.glob("test/*_00"))),
        ("demos", [bag for bag in bags if not bag.name.startswith("screw")]),
    ):
        (folder / target).mkdir(parents=True)
        for bag in found:
            (folder / target / bag.name).symlink_to(bag)
    (folder / "sessions").mkdir()
    (folder / "sessions" / "monday").symlink_to(ROOT / "bags" / "sessions" / "session_00")
    (folder / "bags" / "sessions").symlink_to(ROOT / "bags" / "sessions")
    (folder / "box.yaml").write_text("steps: [{step: plate_handover}]\n", encoding="utf-8")
    (folder / "src").mkdir()
    (folder / "src" / "intent_recognition").symlink_to(folder)
    for name in ("assembly", "pouring"):
        (folder / "bags" / name).symlink_to(ROOT / "bags" / name)
    for name in words:
        if ("give_bracket_" in name or name == "new_bag") and not name.endswith("_saved"):
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).symlink_to(toolbox / "test" / "plate_handover_00")
    return bags


def _handovers(folder: Path) -> None:
    """Recordings in the layout of the baton set: two files each, 120 Hz."""
    folder.mkdir()
    share = np.clip(np.arange(840) / 120 - 1, 0, 1)[:, None]
    way = share**3 * (10 - 15 * share + 6 * share**2)
    rng = np.random.default_rng(1)
    for number in range(6):
        goal = np.array([0.3, 0.2, 0.9]) + 0.05 * rng.normal(size=3)
        for name, home in (("baton", 0.0), ("taker", 0.6)):
            rows = home + way * (goal - home) + 1e-4 * rng.normal(size=(840, 3))
            path = folder / f"{name}_{number:03d}.csv"
            np.savetxt(path, rows, delimiter=",", header="x,y,z", comments="")


def _take(path: Path) -> None:
    """One recording with times and a body that moves, 100 Hz."""
    times_s = np.arange(300) / 100
    places = 0.1 * np.sin(times_s[:, None] + np.arange(3))
    header = "time,wrist_x,wrist_y,wrist_z"
    np.savetxt(path, np.c_[times_s, places], delimiter=",", header=header, comments="")


def _takes(folder: Path) -> None:
    """The takes of the tutorial, fewer of them, and what was imported by the suggested map."""
    script = [sys.executable, ROOT / "docs/tutorials/example_takes.py"]
    for name, number in (("takes", "2"), ("new_takes", "1")):
        subprocess.run([*script, folder / name, "--number", number], check=True)
    to_map = ("import", "takes", "--suggest", "--output", "map.yaml")
    to_bags = ("import", "takes", "--map", "map.yaml", "--output", "mine")
    for words in (to_map, to_bags):
        there = {"takes", "map.yaml", "mine"}
        assert cli.main([str(folder / word) if word in there else word for word in words]) == 0


def _objects(folder: Path) -> None:
    """Containers as meshes, one in millimetres, and as a cloud without normals."""
    mesh = make_container("round_bowl", 2).mesh
    mesh.export(folder / "bowl.obj")
    mesh.export(folder / "cup.ply")
    in_millimetres = mesh.copy()
    in_millimetres.apply_scale(1000.0)
    in_millimetres.export(folder / "cup.stl")
    points, _ = trimesh.sample.sample_surface(mesh, 4000, seed=np.random.default_rng(1))
    trimesh.PointCloud(points).export(folder / "seen.ply")
