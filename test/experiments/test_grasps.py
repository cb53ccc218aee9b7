# SPDX-License-Identifier: Apache-2.0
"""The experiment on grasps, in its quick form."""

import pytest

from experiments.grasps.experiment import run
from experiments.grasps.study import CARRIED, MADE, SCANNED, WARPED
from experiments.settings import Settings
from sim_bridge.containers import make_container


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
    assert len(result.blocks) == 3
