# SPDX-License-Identifier: Apache-2.0
"""Starting and ending nodes, and their parameters."""

import gc
import re
import signal
import sys

import pytest
from geometry_msgs.msg import PoseStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_harness import NodeProcess, node_with
from sensor_msgs.msg import JointState

from intent_recognition.errors import ArgumentError, ModelError
from intent_recognition.nodes import mocap_ingest, qos
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.lifecycle import ManagedNode
from intent_recognition.nodes.parameters import declare_one
from intent_recognition.nodes.runtime import LeftOvers, _Signals, run, when_clock_goes_back
from intent_recognition.parameter_table import ParameterSpec
from intent_recognition.registry import ANSWERS


class Quitter(Node):
    """Is done at its first timer event."""

    def __init__(self):
        super().__init__("quitter")
        self.exit_code = 3
        self.create_timer(0.001, self._quit)

    def _quit(self):
        self.done = True


def test_done_ends_the_process_with_the_nodes_exit_code(capfd):
    # other tests of the process may have left it at warnings
    assert run(Quitter, ["--ros-args", "--log-level", "info"]) == 3
    assert capfd.readouterr().err.splitlines()[0].endswith("[quitter]: ready")


def test_simulated_time_hears_of_a_node_before_its_first_message(harness):
    """Else time goes on while the node takes its first one, and what comes meanwhile is lost."""
    node = harness.add(Node("taker"))
    diagnostics = Diagnostics(node)
    poses = node.create_subscription(PoseStamped, "mocap/wrist/pose", lambda _: None, qos.SENSOR)
    diagnostics.watch(poses, "mocap/wrist/pose")
    heard = harness.said(node, ANSWERS)
    diagnostics.answer()
    assert (heard[0].header.frame_id, heard[0].name) == ("taker", ["mocap/wrist/pose"])
    assert heard[0].position.tolist() == [0.0]


@pytest.mark.parametrize(("simulated", "taken"), [(True, [0, 1, 2]), (False, [2])])
def test_only_in_simulated_time_every_one_of_messages_sent_at_once_is_taken(
    harness, simulated, taken
):
    """It waits for what is counted; in real time only the newest command matters."""
    sender = harness.publisher(JointState, "commands", qos.COMMAND)
    node = node_with(harness, use_sim_time=simulated)
    heard = []
    Diagnostics(node).subscribe(
        JointState, "commands", lambda said: heard.append(int(said.position[0])), qos.COMMAND
    )
    harness.connect(sender)
    for number in range(3):
        sender.publish(JointState(position=[float(number)]))
    assert sender.wait_for_all_acked(Duration(seconds=30))
    harness.spin_until(lambda: 2 in heard, what="the newest")
    assert heard == taken


STUCK = """
import ctypes, sys
from rclpy.node import Node
from intent_recognition.nodes import runtime

class Stuck(Node):
    def __init__(self):
        super().__init__("stuck")
        self.done = True

    def destroy_node(self):
        print("is being destroyed", flush=True)
        ctypes.PyDLL(None).sleep(600)  # a call that keeps the interpreter's lock

runtime.END_S = 0.5
sys.exit(runtime.run(Stuck, []))
"""


@pytest.mark.slow
def test_a_node_that_cannot_be_destroyed_does_not_keep_its_process():
    with NodeProcess(sys.executable, "-c", STUCK) as node:
        assert node.wait() == 1
    assert node.output == "is being destroyed\n"
    assert "Timeout" in node.errors and "in destroy_node" in node.errors


def test_start_error_is_one_line(capfd):
    def broken():
        raise ModelError("model:\n expected a file")

    assert run(broken, []) == 1
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("[FATAL]") and line.endswith("[broken]: model: expected a file")


def test_an_error_while_running_is_one_line_and_one_of_the_program_is_not_hidden(capfd):
    class Failing(Quitter):
        error: Exception = ModelError("disk full")

        def _quit(self):
            raise self.error

    assert run(Failing, []) == 1
    assert capfd.readouterr().err.splitlines()[-1].endswith("[quitter]: disk full")
    Failing.error = ZeroDivisionError()
    with pytest.raises(ZeroDivisionError):
        run(Failing, [])


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("max_speed:=-1.0", "max_speed"),
        ("max_speed:=fast", "max_speed"),
        ("bodies:=[a, a]", "bodies"),
        ("max_sped:=2.0", "a parameter of the node, got max_sped. Did you mean max_speed"),
        ("no_such:=1", "a parameter of the node, got no_such. They are .*world_frame"),
        ("--params", "--ros-args: expected -p, -r, --params-file.*--params"),
        ("ROS_DOMAIN_ID=mine", "ROS_DOMAIN_ID"),
    ],
)
def test_what_it_cannot_start_with_is_one_line(capfd, monkeypatch, override, told):
    words = ["-p", override] if ":=" in override else [override]
    if override.startswith("ROS"):
        monkeypatch.setenv(*override.split("="))
        words = []
    assert mocap_ingest.main(["mocap_ingest", "--ros-args", *words]) == 1
    (line,) = capfd.readouterr().err.splitlines()
    assert re.search(told, line)
    assert len(words) < 2 or ("[FATAL]" in line and "[mocap_ingest]" in line)


def test_a_misspelt_parameter_is_refused_before_the_node_is_configured(capfd, monkeypatch):
    begun = []

    class Managed(ManagedNode):
        def __init__(self):
            super().__init__("managed")
            self.start()

        def configure(self):
            begun.append("configured")

    words = ["managed", "--ros-args", "-p", "autostrat:=false"]
    monkeypatch.setattr("sys.argv", words)
    assert run(Managed, words) == 1
    assert begun == [] and "Did you mean autostart" in capfd.readouterr().err


def test_a_node_that_does_not_end_is_ended_by_a_later_interrupt(monkeypatch):
    now_s = iter([10.0, 10.5, 11.5])
    monkeypatch.setattr("intent_recognition.nodes.runtime.time.monotonic", lambda: next(now_s))
    signals = _Signals()
    try:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        assert signals.received
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    finally:
        signals.restore(ending=False)


def declared(node, name, default, **fields):
    return declare_one(node, name, ParameterSpec(default, "what it is", **fields))


def test_parameter_returns_default_or_override(harness):
    node = node_with(harness, rate=7, names=["a"])
    assert declared(node, "rate", 1.0, minimum=0.0) == 7.0
    assert isinstance(node.get_parameter("rate").value, float)
    assert declared(node, "count", 4, minimum=1, maximum=9) == 4
    assert declared(node, "names", []) == ["a"]
    assert declared(node, "others", []) == []
    assert declared(node, "bodies", ["wrist"]) == ["wrist"]
    kinds = [node.get_parameter(name).type_ for name in ("names", "others", "bodies")]
    assert kinds == [Parameter.Type.STRING_ARRAY] * 3


def test_integers_are_taken_for_a_list_of_floats(harness):
    node = node_with(harness, home=[1, 2], pair=[3, 4])
    assert declared(node, "home", [], kind="double_array") == [1.0, 2.0]
    assert declared(node, "pair", [0.5, 1.5]) == [3.0, 4.0]
    assert declared(node, "unset", [], kind="double_array") == []
    assert node.get_parameter("unset").type_ is Parameter.Type.DOUBLE_ARRAY


@pytest.mark.parametrize("live", [False, True])
def test_parameter_describes_itself(harness, live):
    node = node_with(harness)
    declared(node, "rate", 1.0, minimum=0.5, maximum=2.0, live=live)
    descriptor = node.describe_parameter("rate")
    assert descriptor.description == "what it is"
    assert descriptor.read_only != live and not descriptor.dynamic_typing
    assert descriptor.floating_point_range[0].from_value == 0.5
    assert descriptor.floating_point_range[0].to_value == 2.0
    assert node.set_parameters([Parameter("rate", value=1.5)])[0].successful == live
    for bad in (2.5, float("nan"), "fast", 1):
        assert not node.set_parameters([Parameter("rate", value=bad)])[0].successful


@pytest.mark.parametrize(
    ("default", "given", "said"),
    [
        (["a"], "wrist", "a list of texts, got 'wrist'. Give it:=[wrist]."),
        ([1.0], 2.0, "a list of numbers, got 2.0. Give it:=[2.0]."),
        (["a"], [1.0], "a list of texts, got [1.0]. what it is"),
        (4, 1.5, "a whole number, got 1.5. what it is"),
        (1.0, "fast", "a number, got 'fast'. what it is"),
        (True, "no", "true or false, got 'no'. what it is"),
        ("a", 3, "a text, got 3. what it is"),
    ],
)
def test_a_parameter_of_the_wrong_type_says_what_to_give(harness, default, given, said):
    with pytest.raises(ArgumentError) as error:
        declared(node_with(harness, it=given), "it", default)
    assert str(error.value) == f"parameter it: expected {said}"


@pytest.mark.parametrize("value", [0.1, float("nan"), float("inf"), [1.0], True])
def test_parameter_refuses(harness, value):
    with pytest.raises(ArgumentError, match="rate"):
        declared(node_with(harness, rate=value), "rate", 1.0, minimum=0.5, maximum=2.0)


def test_what_can_be_chosen_is_and_nothing_else(harness):
    node = node_with(harness, good="b", bad="c", use=False)
    assert declared(node, "good", "a", one_of=("a", "b")) == "b"
    assert declared(node, "use", "on", one_of=("on", "off")) == "off"  # as YAML has it
    with pytest.raises(ArgumentError, match="parameter bad: expected one of a, b, got c"):
        declared(node, "bad", "a", one_of=("a", "b"))


@pytest.mark.parametrize("back_s", [0.05, 0.2, 30.0])
def test_a_clock_that_goes_back_is_acted_on_at_once(harness, back_s):
    node = node_with(harness, use_sim_time=True)
    acted = []
    when_clock_goes_back(node, lambda: acted.append(True))
    gc.collect()
    for now_s in (100.0, 150.0, 150.0 - back_s, 200.0):
        harness.set_clock(node, round(now_s * 1e9))
    assert len(acted) == (back_s > 0.1)


@pytest.mark.parametrize(("later_s", "left"), [(0.9, True), (1.1, False)])
def test_what_goes_on_from_before_the_clock_went_back_is_left_over_for_a_second(
    monkeypatch, later_s, left
):
    now_s, left_overs = [10.0], LeftOvers()
    monkeypatch.setattr("intent_recognition.nodes.runtime.time.monotonic", lambda: now_s[0])
    left_overs.last_ns |= {"a": 50, "b": 50}
    left_overs.start_over()
    now_s[0] += later_s
    assert left_overs.include("a", 51) == left
    assert not any(left_overs.include("b", stamp_ns) for stamp_ns in (3, 51))
