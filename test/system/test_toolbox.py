# SPDX-License-Identifier: Apache-2.0
"""The chain from tracker to arm in one process, and real people who were not learned from."""

import numpy as np
import pytest
from system.cell import Cell, recorded

from intent_recognition.bags.reader import BagReader
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.evaluation.replaying import replay
from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.model.file import Model
from intent_recognition.nodes.conversions import stamp_ns, trajectory_arrays

FACTOR = 1.5
TOLERANCE_M = 0.05


@pytest.fixture
def cell(harness, toolbox_model):
    running = Cell(harness)
    running.start_nodes(toolbox_model, FACTOR)
    running.connect()
    return running


@pytest.mark.slow
def test_a_held_out_recording_is_recognised_and_helped(cell, repository):
    """Home and the next one: test_primitive_activation.py; a stream that stops: test_activation.py;
    all recordings: test_generate.py.
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


LEFT_OUT = ("demo_0003", "demo_0014", "demo_0022", "demo_0035")


@pytest.fixture(scope="module")
def learned(shared_data):
    """People with the YuMi arm: the folder, and a model of all but one recording of each task."""
    folder = shared_data / "hri_yumi"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    dofs = load_dofs(folder / "dofs.yaml")
    demonstrations, rejections = read_demonstrations(folder, dofs)
    assert len(demonstrations) == 28 and not rejections
    library = learn([d for d in demonstrations if d.name not in LEFT_OUT], TrainingSettings())
    return folder, Model(library, dofs)


@pytest.mark.slow
@pytest.mark.parametrize("name", LEFT_OUT)
def test_a_person_never_seen_in_training_is_recognised(learned, name):
    """By `replay`, which gives the numbers of the nodes: test_replay.py."""
    folder, model = learned
    reader = BagReader(folder / name)
    moving = [row for row in replay(reader, model) if row["probabilities"]["none"] < 1.0]
    late = [max(row["probabilities"], key=row["probabilities"].get) for row in moving]
    late = late[len(late) // 2 :]
    assert late and late.count(reader.custom_data["task"]) > 0.9 * len(late)
