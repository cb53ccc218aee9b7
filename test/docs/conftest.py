# SPDX-License-Identifier: Apache-2.0
"""A folder where everything that the commands of README and docs name is there."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from docs.shown import ROOT, commands

from intent_recognition.cli import main as cli
from sim_bridge.containers.generate import make_container

MODELS = re.compile(r"\b\w+\.npz\b")
POSE = "{topic: /mocap/wrist/pose, type: geometry_msgs/msg/PoseStamped"


@pytest.fixture(scope="session")
def bench(tmp_path_factory) -> Path:
    """The folder, with few recordings of each task and a model of them under every name."""
    folder = tmp_path_factory.mktemp("bench")
    words = {word for shown in commands() for word in shown.words}
    bags = _recordings(folder, words)
    _objects(folder)
    (folder / "config").symlink_to(ROOT / "config")
    shutil.copy(ROOT / "config" / "dofs.yaml", folder / "my_dofs.yaml")
    shutil.copy(ROOT / "config" / "real_arm.yaml", folder / "my_params.yaml")
    model = folder / "learned_first.npz"
    assert cli.main(["train", *map(str, bags), "--output", str(model)]) == 0
    for name in {name for word in words for name in MODELS.findall(word)}:
        if not (folder / name).exists():
            shutil.copy(model, folder / name)
    return folder


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
    (folder / "src").mkdir()
    (folder / "src" / "intent_recognition").symlink_to(folder)
    (folder / "bags" / "pouring").symlink_to(ROOT / "bags" / "pouring")
    for name in words:
        if ("give_bracket_" in name or name == "new_bag") and not name.endswith("_saved"):
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).symlink_to(toolbox / "test" / "plate_handover_00")
    return bags


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
