# SPDX-License-Identifier: Apache-2.0
"""All seven launch files under launch_testing, where that is installed."""

import sys
from pathlib import Path

import pytest
from programs import output_of

from intent_recognition.nodes.graph import GRAPHS
from intent_recognition.share import share_path

HERE = Path(__file__).parent
LONGEST_S = 900.0


def test_every_graph_has_its_arguments():
    """The file for launch_testing is parsed, as far as that is possible without it."""
    text = (HERE / "launched_graphs.py").read_text(encoding="utf-8")
    compile(text, "launched_graphs.py", "exec")
    assert all(f'"{graph}": ' in text for graph in GRAPHS)


@pytest.mark.slow
def test_launch_files_bring_their_nodes_up(toolbox_model):
    pytest.importorskip("launch_testing", reason="launch_testing is not installed")
    output_of(
        *(sys.executable, "-m", "launch_testing.launch_test", HERE / "launched_graphs.py"),
        timeout_s=LONGEST_S,
        INTENT_MODEL=str(toolbox_model),
        INTENT_BAG=str(share_path("bags/toolbox/test/plate_handover_00")),
    )
