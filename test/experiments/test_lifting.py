# SPDX-License-Identifier: Apache-2.0
"""Lifting: what must hold holds, and what cannot falls; and the experiment, in its quick form."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from experiments.grasps.experiment import run
from experiments.grasps.gripper import FORCE_N
from experiments.grasps.lifting import LiftingWorld
from experiments.grasps.shells import shell_pieces
from experiments.grasps.study import CARRIED, MADE, SCANNED, WARPED
from experiments.settings import Settings
from intent_recognition.objects import find_object, load_object
from intent_recognition.warping import Grasp
from sim_bridge import GRAVITY_M_S2
from sim_bridge.containers import make_container

MUG = make_container("mug", 0)


@pytest.fixture(scope="module")
def grasp():
    """The mug's."""
    return load_object(find_object("mug")).grasp


def test_pieces_are_the_solid():
    """As large as the solid, nothing inside the cavity, a handle where there is one."""
    for name in ("mug", "square_bowl"):
        container = make_container(name, 1)
        pieces = shell_pieces(container.mesh)
        volume = sum(ConvexHull(piece).volume for piece in pieces)
        assert volume == pytest.approx(container.mesh.volume, rel=0.2)
        corners = np.concatenate(pieces)
        np.testing.assert_allclose(corners.min(0), container.mesh.bounds[0], atol=0.002)
        np.testing.assert_allclose(corners.max(0), container.mesh.bounds[1], atol=0.002)
        inside = 0.9 * container.sections.inner[20:-1].reshape(-1, 2)
        levels = np.repeat(container.sections.heights_m[20:-1], container.sections.inner.shape[1])
        points = np.column_stack([inside, levels])
        for piece in pieces:
            planes = ConvexHull(piece).equations
            assert (points @ planes[:, :3].T + planes[:, 3] > -1e-9).any(1).all()


@pytest.mark.slow
def test_the_annotated_grasp_holds_and_others_do_not(grasp):
    """Moved outward, a finger comes down on the rim, or both close in the air."""
    with LiftingWorld(MUG.mesh) as world:
        lifted = world.lift(grasp)
        assert lifted.held
        assert lifted.tipped_rad < 0.1
        assert lifted.pushed_m < 1e-4
        for away_m in (0.013, 0.1):
            pose = grasp.pose.copy()
            pose[:3, 3] += away_m * grasp.closing
            assert not world.lift(Grasp(pose, grasp.width_m)).held


@pytest.mark.slow
def test_what_friction_cannot_carry_falls(grasp):
    """Two pads carry 2 mu F at most; the mug weighs more. The same twice, to the bit."""
    with LiftingWorld(MUG.mesh) as world:
        needed = world.mass_kg * GRAVITY_M_S2 / (2.0 * FORCE_N)
    with LiftingWorld(MUG.mesh, 0.8 * needed) as world:
        first = world.lift(grasp)
        assert not first.held
        assert first == world.lift(grasp)


@pytest.mark.slow
def test_a_quick_run_lifts_made_and_scanned_containers(tmp_path):
    """What the folder holds counts as scanned; what is no open container is named."""
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    bowl = make_container("round_bowl", 5)
    bowl.mesh.export(meshes / "bowl.obj")
    result = run(Settings(quick=True, bags=tmp_path))
    held = result.numbers["held"]
    assert held[MADE][WARPED] == 1.0
    assert held[MADE][CARRIED] < 1.0
    assert set(held) == {MADE, SCANNED}
    assert [finding.holds for finding in result.findings] == [True, True, True]
    assert len(result.blocks) == 1
