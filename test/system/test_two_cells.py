# SPDX-License-Identifier: Apache-2.0
"""Two robots with two coworkers, in two namespaces of one graph: nothing passes between them."""

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from system.cell import UPRIGHT, recorded
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_pose, to_stamp
from intent_recognition.nodes.graph import resolve
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from sim_bridge.scenarios.toolbox.scene import HOME

pytestmark = pytest.mark.slow

KINDS = {
    "mocap_ingest": MocapIngest,
    "intent_estimator": IntentEstimatorNode,
    "primitive_activation": PrimitiveActivation,
}
START_NS = 5_000_000_000
STEP_NS = 20_000_000
DONE = {"a": "plate_handover_03", "b": "screw_handover_03"}


class Cell:
    """The recognition side in one namespace, its coworker, and an arm that stands still."""

    def __init__(self, harness, space, model, wrist):
        self.harness, self.wrist = harness, wrist
        given = {"model": str(model), "namespace": space, "use_sim_time": True}
        self.nodes = {call.name: self._start(call) for call in resolve("intent", given)}
        self.tasks = harness.collect(JointState, f"/{space}/intent/tasks", qos.STATE)
        self.active = harness.collect(String, f"/{space}/intent/active_task", qos.LATCHED)
        topic = f"/{space}/joint_trajectory"
        self.commands = harness.collect(JointTrajectory, topic, qos.COMMAND)
        self.poses = harness.publisher(PoseStamped, f"/{space}/mocap/wrist/pose", qos.SENSOR)
        self.states = harness.publisher(JointState, f"/{space}/joint_states", qos.STATE)

    def _start(self, call):
        rules = [word for rule in call.remappings for word in ("-r", ":=".join(rule))]
        overrides = [Parameter(name, value=value) for name, value in call.parameters.items()]
        node = KINDS[call.name](
            namespace=call.namespace,
            parameter_overrides=overrides,
            cli_args=["--ros-args", *rules] if rules else [],
        )
        return self.harness.add(node)

    def connect(self):
        ingest, estimator = self.nodes["mocap_ingest"], self.nodes["intent_estimator"]
        self.harness.connect(
            self.poses, *ingest._outputs.values(), estimator.people[""].output.trajectory
        )
        self.harness.connect(self.states, estimator.people[""].output.tasks, subscribers=2)
        self.harness.spin_until(lambda: self.active, what="the activation")

    def show(self, k, now_ns):
        """The coworker's next position, if there is one, and the arm's."""
        state = JointState(name=list(JOINT_NAMES), position=HOME.tolist(), velocity=[0.0] * 7)
        state.header.stamp = to_stamp(now_ns)
        self.states.publish(state)
        pose = PoseStamped(pose=to_pose(self.wrist.positions[k], UPRIGHT))
        pose.header.stamp, pose.header.frame_id = to_stamp(now_ns), "world"
        self.poses.publish(pose)

    def handled(self):
        """Poses that were used, or refused."""
        ingest, estimator = self.nodes["mocap_ingest"], self.nodes["intent_estimator"]
        return len(self.tasks) + sum(
            node._diagnostics._counts[reason]
            for node in (ingest, estimator)
            for reason in ("jump", "stamp_not_increasing")
        )

    def leaders(self):
        """Most probable label of each observation in a movement."""
        found = [m.name[int(np.argmax(m.position))] for m in self.tasks]
        return [label for label in found if label != "none"]


def test_two_cells_do_not_hear_one_another(harness, repository, toolbox_model):
    bags = repository / "bags/toolbox/test"
    wrists = {space: recorded(bags / name, hold_s=0.0) for space, name in DONE.items()}
    cells = {s: Cell(harness, s, toolbox_model, wrist) for s, wrist in wrists.items()}
    clock = harness.publisher(Clock, "/clock", qos.STATE)
    harness.connect(clock, subscribers=6)
    for cell in cells.values():
        cell.connect()
    n = min(len(wrist.times_ns) for wrist in wrists.values()) // 2
    for k in range(n):
        now_ns = START_NS + k * STEP_NS
        clock.publish(Clock(clock=to_stamp(now_ns)))
        nodes = [node for cell in cells.values() for node in cell.nodes.values()]
        harness.spin_until(
            lambda at=now_ns, all_=nodes: all(
                node.get_clock().now().nanoseconds == at for node in all_
            ),
            what="the clock",
        )
        for cell in cells.values():
            cell.show(2 * k, now_ns)
        harness.spin_until(lambda k=k: all(c.handled() > k for c in cells.values()), what=str(k))
    for space, cell in cells.items():
        own = DONE[space].removesuffix("_03")
        assert cell.handled() == n
        assert cell.leaders()[-1] == own
        assert next(message.data for message in cell.active if message.data) == own
        assert cell.commands
        mine = {name for node in cell.nodes.values() for name in topics(node)}
        assert all(name.startswith(f"/{space}/") for name in mine)


def topics(node):
    absolute = {"/clock", "/diagnostics", "/rosout", "/parameter_events"}
    return {e.topic_name for e in (*node.publishers, *node.subscriptions)} - absolute


def test_parameters_files_names_and_remaps_come_from_the_command_line(harness, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "/**/primitive_activation:\n  ros__parameters: {threshold: 0.8, timeout: 0.4}\n"
        "/b/primitive_activation:\n  ros__parameters: {hold_time: 3}\n",
        encoding="utf-8",
    )
    words = ["--params-file", str(file), "-p", "timeout:=0.3", "-r", "__ns:=/b"]
    words += ["-r", "joint_trajectory:=/controller/joint_trajectory", "-r", "joint_states:=arm"]
    node = harness.add(PrimitiveActivation(cli_args=["--ros-args", *words]))
    values = {name: node.get_parameter(name).value for name in ("threshold", "timeout")}
    assert values == {"threshold": 0.8, "timeout": 0.3}
    assert node.get_parameter("hold_time").value == pytest.approx(3.0)
    assert node.get_fully_qualified_name() == "/b/primitive_activation"
    names = topics(node)
    assert {"/controller/joint_trajectory", "/b/arm", "/b/intent/tasks"} <= names
    assert "/b/joint_states" not in names
