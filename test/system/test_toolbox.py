# SPDX-License-Identifier: Apache-2.0
"""The chain from tracker to arm, all nodes in one process on simulated time."""

from itertools import pairwise

import numpy as np
import pytest
from simulation import minimum_jerk
from system.cell import Cell, Wrist, recorded

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


def unknown_wrist(start: np.ndarray, seed: int) -> Wrist:
    """A smooth way through three random places to the side of and above the work cell."""
    rng = np.random.default_rng(seed)
    corners = [start, *(start + rng.uniform((0.1, 0.2, 0.2), (0.5, 0.6, 0.6), (3, 3)))]
    legs = [np.repeat(start[None], 80, axis=0)]
    for a, b in pairwise(corners):
        legs.append(a + minimum_jerk(np.linspace(0.0, 1.0, 90))[:, None] * (b - a))
    positions = np.vstack([*legs, np.repeat(corners[-1][None], 100, axis=0)])
    noise = 0.001 * rng.normal(size=positions.shape)
    return Wrist(np.arange(len(positions)) * 10_000_000, positions + noise)


def test_an_unknown_movement_activates_nothing(cell, repository):
    start = recorded(repository / "bags/toolbox/test/plate_handover_00").positions[0]
    wrist = unknown_wrist(start, 1)
    cell.show(wrist)
    cell.run_to(wrist.times_ns[-1] * 1e-9)
    assert cell.labels() == [""] and not cell.commands
    assert set(cell.leader(1.5, 3.5)) == {"none"}
    moving = [message for message in cell.tasks if any(message.effort)]
    assert len(moving) > 150  # it was seen as a movement, and still as none of the tasks
