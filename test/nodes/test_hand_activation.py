# SPDX-License-Identifier: Apache-2.0
"""A predicted hand on the topics: another arm moves, what it cannot reach is refused."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from activation_graph import START_NS, Graph
from joint_trajectories import build_joint_trajectory
from model_builder import true_library
from rclpy.node import Node
from std_msgs.msg import String

from intent_recognition.bags import JOINT_STATE
from intent_recognition.demonstrations import DofEntry, load_dofs
from intent_recognition.model.file import Model, save_model
from intent_recognition.nodes.anticipation import PostureInput
from intent_recognition.nodes.conversions import stamp_ns, to_joint_state, trajectory_arrays
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.recognition.start_posture import start_mean
from intent_recognition.share import share_path
from sim_bridge.arm.robots import find_robot
from sim_bridge.scenarios.toolbox import HOME_HAND_M, ToolboxArm

NAMES = [f"hand/pose.pose.position.{axis}" for axis in "xyz"]
GOAL_M = np.array([0.62, -0.03, 0.38])
TIP = "panda_grasptarget"


@pytest.fixture(scope="module")
def panda():
    return ToolboxArm(find_robot("panda"))


class HandGraph(Graph):
    """With a Panda's description, whose hand is predicted."""

    def __init__(self, harness, arm, describe=True, **others):
        own = {"home": arm.home.tolist(), "hand_link": arm.robot.tip, "n_observations": 2}
        super().__init__(harness, **own | others)
        self.arm = arm
        if describe:
            self.hear("robot_description", String(data=arm.robot.description))

    def predict(self, goal):
        s = np.linspace(0.0, 1.0, 50)
        way = (s**3 * (10 - 15 * s + 6 * s**2))[:, None]
        path = HOME_HAND_M + way * (goal - HOME_HAND_M)
        message = build_joint_trajectory(
            NAMES, 2.0 * s, path, None, np.full(path.shape, 0.01), time_ns=START_NS - 600_000_000
        )
        message.header.frame_id = "plate"
        self.hear("intent/robot_trajectory", message)

    def step(self, goal):
        self.tick()
        names = [*self.arm.robot.joint_names, "panda_finger_joint1", "panda_finger_joint2"]
        q = [*self.arm.home, 0.04, 0.04]
        state = to_joint_state(names, q, np.zeros(9), time_ns=self.now_ns)
        self.hear("joint_states", state)
        self.predict(goal)
        self.send_tasks([0.99, 0.01], names=("plate", "none"))

    def commanded(self):
        """Predict the goal until the arm is commanded; the first command."""
        for _ in range(6):
            self.step(GOAL_M)
        return self.commands[0]


def test_the_hand_of_another_arm_goes_where_it_was_predicted(harness, panda):
    graph = HandGraph(harness, panda)
    message = graph.commanded()
    assert tuple(message.joint_names) == panda.robot.joint_names
    _, q, rest = trajectory_arrays(message)
    assert stamp_ns(message) > START_NS
    np.testing.assert_allclose(q[0], panda.home, atol=1e-6)
    np.testing.assert_allclose(panda.hand(q[-1]), GOAL_M, atol=1e-3)
    limits = panda.robot.limits
    assert np.all((q > limits.lower) & (q < limits.upper))
    assert np.all(np.abs(rest["velocities"]) <= 0.9 * limits.velocity * (1 + 1e-6))


@pytest.fixture
def model(tmp_path):
    """Of a task of the hand that begins at home."""
    dofs = load_dofs(share_path("config/dofs_hand.yaml"))
    library = true_library(dofs, n_tasks=1)
    means = library.weight_mean.copy()
    shift = HOME_HAND_M - start_mean(library, 0)
    means[0, library.n_observed_weights :] += np.repeat(shift, library.basis.n_basis)
    library = replace(library, labels=("plate",), weight_mean=means)
    save_model(tmp_path / "model.npz", Model(library, dofs))
    return str(tmp_path / "model.npz")


@pytest.mark.parametrize("home_is", ["given", "the first seen", "given and configured again"])
def test_it_goes_ahead_to_home_where_a_task_begins_there(harness, panda, model, home_is):
    """Of the postures with the hand in that place it is the one that paths are drawn to."""
    home = None if home_is == "the first seen" else panda.home.tolist()
    graph = HandGraph(harness, panda, home=home, model=model)
    if "again" in home_is:
        graph.step(GOAL_M)
        for transition in ("deactivate", "cleanup", "configure", "activate"):
            getattr(graph.node, f"trigger_{transition}")()
    graph.commanded()
    assert graph.node.activation.pretrigger.is_near(panda.home, "plate")


def test_what_the_arm_cannot_reach_is_refused_and_counted(harness, panda):
    graph = HandGraph(harness, panda)
    for _ in range(4):
        graph.step(np.array([1.4, 0.0, 0.4]))
    assert graph.node.diagnostics.rejected("unreachable") >= 4
    assert graph.commands == []


def test_without_a_description_nothing_moves(harness, panda):
    graph = HandGraph(harness, panda, describe=False)
    graph.predict(GOAL_M)
    assert graph.node.diagnostics.rejected("no_robot_description") == 1
    graph.hear("robot_description", String(data="<robot"))
    assert graph.node._hand.arm is None
    assert graph.node.diagnostics.rejected("bad_robot_description") == 1


@pytest.mark.parametrize("dofs", ["dofs_hand", "dofs_two_humans"])
def test_the_estimator_hears_where_the_hand_is(harness, panda, dofs):
    """From joint_states and the description, in place of a pose that nobody publishes.

    An arm in the second person's place stands where that person's wrist would be.
    """
    taken = []
    node = harness.node(partial(Node, "listener"), hand_link=TIP)
    inputs = PostureInput(node, Diagnostics(node))
    estimator = SimpleNamespace(update_controlled=taken.append)
    inputs.open([estimator], load_dofs(share_path(f"config/{dofs}.yaml")).controlled)
    harness.hear(node, "robot_description", String(data=panda.robot.description))
    half = [*panda.robot.joint_names[:3], "finger"]
    for k, (names, q) in enumerate(
        ((panda.robot.joint_names, panda.home), (["finger"], [0.0]), (half, np.zeros(4)))
    ):
        state = to_joint_state(names, q, np.zeros(len(q)), time_ns=START_NS + k)
        harness.hear(node, "joint_states", state)
    assert inputs._diagnostics.rejected("posture_missing_dof") == 1
    (observation,) = taken
    assert (observation.stamp_ns, observation.group) == (START_NS, 0)
    np.testing.assert_allclose(observation.values, HOME_HAND_M, atol=1e-6)
    by_number = DofEntry("joint_states", JOINT_STATE, ("position[0]",), unit="rad")
    inputs._take(0, by_number, False, to_joint_state(half, np.ones(4), time_ns=START_NS + 3))
    assert taken[-1].values == [1.0]
