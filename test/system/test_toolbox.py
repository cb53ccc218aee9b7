# SPDX-License-Identifier: Apache-2.0
"""The chain from tracker to arm, all nodes in one process on simulated time."""

from itertools import pairwise

import numpy as np
import pytest
from simulation import minimum_jerk
from system.cell import Cell, Wrist, path_distance, recorded, without

from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.nodes.conversions import joint_values, stamp_ns, trajectory_arrays

pytestmark = pytest.mark.slow

FACTOR = 1.5
TOLERANCE_M = 0.05


@pytest.fixture
def cell(harness, toolbox_model):
    running = Cell(harness)
    running.start_nodes(toolbox_model, factor=FACTOR, hold_time=3.0)
    running.connect()
    return running


def check_interaction(cell: Cell, wrist: Wrist) -> None:
    """Show the wrist; the right task is executed and the hand arrives."""
    end_s = wrist.end_ns * 1e-9
    known, sent = len(cell.active), len(cell.commands)
    cell.show(wrist)
    cell.run_until(lambda: wrist.task in cell.labels()[known:], f"{wrist.task} active")
    cell.run_to(end_s + 1.0)
    assert cell.labels()[known:] == [wrist.task]
    assert set(cell.leader(0.8 * end_s, end_s)) == {wrist.task}
    assert cell.hand_error_m(end_s + 1.0) < TOLERANCE_M
    first = cell.commands[sent]
    assert list(first.joint_names) == list(JOINT_NAMES)
    assert stamp_ns(first) < cell.start_ns + wrist.end_ns  # before the human's end


def test_a_held_out_recording_is_recognised_and_helped(cell, repository):
    """The other two tasks: below."""
    wrist = recorded(repository / "bags/toolbox/test/screw_handover_01")
    check_interaction(cell, wrist)
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


def way_back(wrist: Wrist, start: np.ndarray) -> Wrist:
    """From where a wrist ended to a new start, in 1.5 s, and 1 s of rest there."""
    share = minimum_jerk(np.linspace(0.0, 1.0, 150))[:, None]
    way = wrist.positions[-1] + share * (start - wrist.positions[-1])
    way = np.vstack([way, np.repeat(start[None], 100, axis=0)])
    return Wrist(np.arange(len(way)) * 10_000_000, way)


def test_an_interaction_ends_at_home_and_the_next_one_begins(cell, repository):
    bags = repository / "bags/toolbox/test"
    first = recorded(bags / "plate_handover_01", hold_s=1.0)
    second = recorded(bags / "hold_screwdriver_00")
    check_interaction(cell, first)
    cell.run_to(first.times_ns[-1] * 1e-9)
    cell.show(way_back(first, second.positions[0]))
    cell.run_until(lambda: cell.labels()[-1] == "", "home")
    cell.run_until(cell.shown, "back at the start")
    assert cell.labels() == ["", first.task, ""]  # the way back is none of the tasks
    home, now = (
        joint_values(cell.states[0], JOINT_NAMES),
        joint_values(cell.states[-1], JOINT_NAMES),
    )
    np.testing.assert_allclose(now, home, atol=0.02)
    check_interaction(cell, second)


def test_occlusion_in_mid_movement(cell, repository):
    wrist = recorded(repository / "bags/toolbox/test/hold_screwdriver_01")
    middle_s = (0.55 * wrist.onset_ns + 0.45 * wrist.end_ns) * 1e-9
    check_interaction(cell, without(wrist, middle_s, middle_s + 0.35))


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


def test_a_stream_that_stops_stops_the_arm_on_its_path(cell, repository):
    wrist = recorded(repository / "bags/toolbox/test/plate_handover_02")
    cell.show(wrist)
    home = joint_values(cell.states[0], JOINT_NAMES)
    cell.run_until(
        lambda: np.abs(joint_values(cell.states[-1], JOINT_NAMES) - home).max() > 0.05,
        "the arm to move",
    )
    cell.wrist = None  # the tracker falls silent
    cell.run_until(lambda: stamp_ns(cell.tasks[-1]) < cell.now_ns - 300_000_000, "silence")
    silent_ns = stamp_ns(cell.tasks[-1])
    planned = trajectory_arrays(cell.commands[-1])[1]
    before = len(cell.commands)
    activation = cell.activation.activation
    cell.run_until(lambda: activation.mode.value == "stopped", "the stop")
    assert activation.stop_reason == "stream_stopped"
    cell.run_until(lambda: len(cell.commands) > before, "its command")
    stop = cell.commands[before]
    times, positions, rest = trajectory_arrays(stop)
    assert 0.5 <= (stamp_ns(stop) - silent_ns) * 1e-9 < 0.75  # timeout, and a little to switch
    assert not np.any(rest["velocities"][-1])
    assert max(path_distance(q, planned) for q in positions) < 0.02
    rest_ns = stamp_ns(stop) + round((times[-1] + 0.3) * 1e9)
    cell.run_until(lambda: stamp_ns(cell.states[-1]) >= rest_ns, "rest")
    stopped = next(m for m in cell.states if stamp_ns(m) >= rest_ns)
    assert np.abs(stopped.velocity).max() < 0.02
    np.testing.assert_allclose(joint_values(stopped, JOINT_NAMES), positions[-1], atol=0.03)
    cell.run_until(lambda: cell.said("primitive_activation", "stream_stopped"), "diagnostics")
    cell.run_until(lambda: cell.said("intent_estimator", "human stream stopped"), "diagnostics")
