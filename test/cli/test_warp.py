# SPDX-License-Identifier: Apache-2.0
"""`intent warp` on meshes whose truth is known."""

import json

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from intent_recognition.cli.main import main
from sim_bridge.containers.generate import make_container


@pytest.fixture
def bowl(tmp_path):
    """A bowl and the file of its mesh."""
    container = make_container("round_bowl", 2)
    path = tmp_path / "bowl.stl"
    container.mesh.export(path)
    return container, path


@pytest.mark.slow
def test_json_is_near_the_truth(bowl, capsys):
    """Metres, cubic metres and radians; both mappings."""
    container, path = bowl
    for options in (["--grasp"], ["--grasp", "--mapping", "point", "--neighbours", "3"]):
        assert main(["warp", "mug", str(path), "--json", "--toward", "1", "0", "0", *options]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["volume_m3"] == pytest.approx(container.inner_volume_m3, rel=0.05)
        assert found["opening_radius_m"] == pytest.approx(container.opening_radius_m, rel=0.02)
        assert found["tilt_reference_rad"] == pytest.approx(container.tilt_reference_rad, abs=0.04)
        np.testing.assert_allclose(found["up"], [0.0, 0.0, 1.0], atol=0.03)
        assert not found["has_handle"]
        grasp = found["grasp"]
        turn = Rotation.from_quat(grasp["orientation"]).as_matrix()
        np.testing.assert_allclose(turn[:, 1:].T, [grasp["closing"], grasp["approach"]])
        distance = np.linalg.norm(grasp["position"][:2])
        assert distance == pytest.approx(container.opening_radius_m, rel=0.06)


@pytest.mark.slow
def test_a_table_and_a_report(bowl, tmp_path, capsys):
    """The page holds both figures and needs no network."""
    report = tmp_path / "page.html"
    assert main(["warp", "mug", str(bowl[1]), "--grasp", "--report", str(report)]) == 0
    shown = capsys.readouterr().out
    assert "grasp: width" in shown
    assert "tilt that leaves half" in shown
    assert str(report.name) in shown
    page = report.read_text(encoding="utf-8")
    assert page.count("<img") == 2
    assert "http://" not in page.replace("http://www.w3.org", "")


@pytest.mark.parametrize(
    "option",
    ["--points=0", "--points=-5", "--neighbours=0", "--seed=-1", "--scale=0", "--scale=inf"],
)
def test_a_number_that_cannot_be_is_refused_and_no_fault_of_the_mesh(option, refused):
    said = refused("warp", "mug", "bowl.stl", option)
    assert f"argument {option.partition('=')[0]}: expected" in said


@pytest.mark.slow
def test_failures_are_one_line(bowl, tmp_path, capsys):
    """Source, target, scale and a closed top."""
    closed = tmp_path / "closed.ply"
    trimesh.creation.cylinder(radius=0.04, height=0.1).export(closed)
    for arguments, reason in (
        (["bucket", str(bowl[1])], "one of mug"),
        (["mug", str(tmp_path / "none.obj")], "none.obj"),
        (["mug", str(bowl[1]), "--scale", "1000"], "millimetres"),
        (["mug", str(closed)], "closed on top"),
    ):
        assert main(["warp", *arguments]) == 1
        error = capsys.readouterr().err
        assert reason in error
        assert error.count("\n") == 1
