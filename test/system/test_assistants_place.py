# SPDX-License-Identifier: Apache-2.0
"""Learned from two people: an arm takes the second one's place in the graph."""

import numpy as np
import pytest
from system.cell import Cell, Wrist

from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.learning import TrainingSettings, learn
from intent_recognition.model import Model, save_model
from intent_recognition.nodes.conversions import joint_values
from intent_recognition.recognition.start_posture import POSTURE_USED
from intent_recognition.share import share_path
from sim_bridge.arm import find_robot
from sim_bridge.scenarios.assembly.live import in_assistants_place
from sim_bridge.scenarios.assembly.session import SESSIONS, plan_session
from sim_bridge.scenarios.assembly.styles import FASTENING, HAND_OVER
from sim_bridge.scenarios.toolbox import ToolboxArm

pytestmark = pytest.mark.slow

ROBOT = "panda"
SEED, INDEX = 7, SESSIONS
NEAR_M = 0.06


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    """What 40 of the shipped demonstrations teach, wrist to wrist."""
    dofs = load_dofs(share_path("config/dofs_two_humans.yaml"))
    demonstrations, _ = read_demonstrations(share_path("bags/assembly/session_00"), dofs)
    path = tmp_path_factory.mktemp("two") / "humans.npz"
    save_model(path, Model(learn(demonstrations, TrainingSettings()), dofs))
    return path


@pytest.mark.parametrize("task", (HAND_OVER, FASTENING))
def test_the_hand_comes_to_where_the_second_wrist_would_be(harness, model, task):
    session = plan_session(SEED, INDEX, [task], hold_s=1.5)
    (shown,), worker = session.interactions, session.worker
    seen = worker.visible
    times_ns = np.round(worker.times_s[seen] * 1e9).astype(np.int64)
    cell = Cell(harness)
    own = in_assistants_place(ROBOT)
    cell.start_nodes(model, factor=1.5, robot=ROBOT, own=own, return_home=False)
    cell.connect()
    cell.show(Wrist(times_ns, worker.positions_m[seen], task))
    cell.run_until(lambda: task in cell.labels(), f"{task} active")
    cell.run_to(shown.end_s + 1.0)
    arm = ToolboxArm(find_robot(ROBOT))
    names = arm.robot.joint_names
    hand = arm.hand(np.array([joint_values(message, names) for message in cell.states]))
    wrist = session.assistant.true_positions_m
    off_the_way = [np.linalg.norm(wrist - place, axis=1).min() for place in hand]
    assert cell.labels() == ["", task]
    assert np.linalg.norm(hand[-1] - shown.assistant[-1][1].goal_m) < NEAR_M
    assert max(off_the_way) < NEAR_M
    assert cell.estimator._diagnostics._values["start posture"] == POSTURE_USED
