# SPDX-License-Identifier: Apache-2.0
"""The chain from tracker to arm, all nodes in one process on simulated time."""

import numpy as np
import pytest
from system.cell import Cell, recorded

from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.nodes.conversions import stamp_ns, trajectory_arrays

pytestmark = pytest.mark.slow

FACTOR = 1.5
TOLERANCE_M = 0.05


@pytest.fixture
def cell(harness, toolbox_model):
    running = Cell(harness)
    running.start_nodes(toolbox_model, FACTOR)
    running.connect()
    return running


def test_a_held_out_recording_is_recognised_and_helped(cell, repository):
    """Home and the next one: test_primitive_activation.py; a stream that stops: test_activation.py;
    all recordings: test_coworker_hardness.py.
    """
    wrist = recorded(repository / "bags/toolbox/test/screw_handover_01")
    end_s = wrist.end_ns * 1e-9
    cell.show(wrist)
    cell.run_until(lambda: wrist.task in cell.labels(), f"{wrist.task} active")
    cell.run_to(end_s + 1.0)
    assert cell.labels() == ["", wrist.task]
    assert set(cell.leader(0.8 * end_s, end_s)) == {wrist.task}
    assert cell.hand_error_m(end_s + 1.0) < TOLERANCE_M
    first = cell.commands[0]
    assert list(first.joint_names) == list(JOINT_NAMES)
    assert stamp_ns(first) < cell.start_ns + wrist.end_ns  # before the human's end
    for message in cell.tasks:
        assert abs(sum(message.position) - 1.0) <= 1e-9
    for message in cell.predictions:
        times, _, rest = trajectory_arrays(message)
        assert np.all(np.diff(times) > 0) and {"velocities", "effort"} <= rest.keys()
    for message in cell.commands:
        assert all(len(point.effort) == 0 for point in message.points)
        assert not any(message.points[-1].velocities)
    counts = cell.ingest._diagnostics._counts + cell.estimator._diagnostics._counts
    assert not counts and not cell.activation.diagnostics._counts
