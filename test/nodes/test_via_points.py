# SPDX-License-Identifier: Apache-2.0
"""Via points told to a running estimator: by parameter, by command, by hand of an arm."""

import argparse
from functools import partial

import numpy as np
import pytest
from estimator_graph import DOFS, Folder, Graph
from kinematics.robots import lwr_urdf
from std_msgs.msg import String

from intent_recognition.cli import via
from intent_recognition.cli.options import add_module
from intent_recognition.composing import read_via_points
from intent_recognition.errors import ArgumentError
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import trajectory_arrays
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.promp import controlled_at


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return Folder(tmp_path_factory.mktemp("via"), DOFS)


def parsed(*words):
    parser = argparse.ArgumentParser()
    add_module(parser.add_subparsers(), "via", via)
    return parser.parse_args(["via", *map(str, words)])


@pytest.mark.slow
def test_by_command_the_path_passes_until_the_point_is_removed(harness, folder):
    told = harness.collect(String, "intent/via_points", qos.LATCHED)
    graph = Graph(harness, folder)
    harness.spin_until(lambda: told, what="that there are none")
    assert told[-1].data == ""

    def run(*words):
        args = parsed(*words)
        (change,) = args.run.args
        return via.change_via_points(harness.probe, harness.executor, partial(change, args))

    library = folder.model.library
    at = controlled_at(library, 0, 1.0)
    goal = float(at.mean[3] + 3.0 * np.sqrt(at.covariance[3, 3]))
    task = library.labels[0]
    end = ("--phase", 1, "--std", 1e-4, "--task", task)
    (point,) = run("add", "end", "--dof", f"lwr_a4_joint={goal}", *end)
    assert run("list") == (point,)
    harness.spin_until(lambda: told[-1].data, what="the point")
    assert read_via_points(told[-1].data) == (point,)
    for refused, text in (
        (("add", "far", "--dof", "lwr_a4_joint=2.0", *end), "far: expected at most 6 standard"),
        (("add", "far", "--dof", "elbow=1.0", *end), "DOFs of lwr_a1_joint"),
        (("add", "far", "--hand", 0.3, 0.0, 0.5, "--phase", 0.5), "no robot_description"),
        (("remove", "far"), r"names of via points \(end\)"),
    ):
        with pytest.raises(ArgumentError, match=text):
            run(*refused)
    graph.feed(folder.observations(task=0)[:100])
    harness.spin_until(lambda: graph.robot, what="a trajectory")
    found = graph.robot[-1]
    assert found.header.frame_id == task
    assert abs(trajectory_arrays(found)[1][-1, 3] - goal) < 1e-3
    assert run("remove", "end") == ()
    harness.spin_until(lambda: not told[-1].data, what="that it is removed")
    assert graph.node.people[""].estimator.library is graph.node._model.library


def test_given_at_the_start_a_point_of_the_hand_waits_for_the_arm(harness, folder):
    told = harness.collect(String, "intent/via_points", qos.LATCHED)
    far = "[{name: far, task: task_0, phase: 0.5, hand: [3, 0, 0.5]}]"
    node = harness.node(IntentEstimatorNode, model=str(folder.path), via_points=far)
    arm = harness.publisher(String, "robot_description", qos.LATCHED)
    harness.spin_until(lambda: node.active, what="an active node")
    assert told == [] and node._diagnostics.rejected("bad_via_points") == 0
    arm.publish(String(data=lwr_urdf()))
    harness.spin_until(lambda: node._diagnostics.rejected("bad_via_points"), what="a count")
    harness.spin_until(lambda: told, what="what is in force")
    assert told[-1].data == ""
