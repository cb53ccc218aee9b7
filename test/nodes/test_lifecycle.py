# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes that end with who started them, their lifecycle, and messages that wait."""

import os
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_msgs.msg import Header, Int64

from intent_recognition.errors import IntentError, ModelError
from intent_recognition.nodes import start
from intent_recognition.nodes.backlog import MAX_WAITING, Backlog, thin
from intent_recognition.nodes.conversions import to_stamp
from intent_recognition.nodes.lifecycle import ManagedNode
from intent_recognition.nodes.processes import NodeProcesses
from intent_recognition.nodes.start import tell_missing
from intent_recognition.registry import NODES

STARTS = """
import os, sys
from pathlib import Path
from intent_recognition.nodes.processes import NodeProcesses
with NodeProcesses(os.environ, Path("log")) as nodes:
    nodes.start("waiting", "waits", {})
    print(nodes.pid("waiting"), flush=True)
    sys.stdin.read()
"""
FIRST = ["unshare", "--pid", "--fork"]
CHECK = """
    assert os.getpid() == 1
    nodes.check()
"""
LONGEST_S = 60.0


@pytest.fixture
def environment(tmp_path, repository):
    """Where two nodes can be imported: one waits for ever, one ends at once."""
    (tmp_path / "waits.py").write_text("from signal import pause as main\n")
    (tmp_path / "dies.py").write_text("def main(): raise SystemExit('no such arm')\n")
    return {**os.environ, "PYTHONPATH": f"{tmp_path}:{repository}"}


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel ends them")
def test_killed_it_leaves_no_orphan(environment, tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", STARTS],
        cwd=tmp_path,
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    node = int(process.stdout.readline())
    os.kill(node, 0)
    process.kill()
    process.communicate(timeout=LONGEST_S)
    gone = ["timeout", str(LONGEST_S), "tail", "--pid", str(node), "-f", "/dev/null"]
    subprocess.run(gone, check=True)


@pytest.mark.skipif(
    subprocess.run(
        ["unshare", "--pid", "--fork", "true"], check=False, capture_output=True
    ).returncode,
    reason="no process is the first of a container here",
)
def test_the_first_process_of_a_container_starts_nodes_too(environment, tmp_path):
    command = [*FIRST, "--kill-child", sys.executable, "-c", STARTS + CHECK]
    subprocess.run(command, cwd=tmp_path, env=environment, input=b"", check=True)


def test_one_that_dies_is_named_with_the_end_of_its_log(environment, tmp_path):
    with NodeProcesses(environment, tmp_path / "log") as nodes:
        nodes.start("waiting", "waits", {})
        nodes.check()
        nodes.start("arm", "dies", {})
        os.waitid(os.P_PID, nodes.pid("arm"), os.WEXITED | os.WNOWAIT)
        assert nodes.running("waiting") and not nodes.running("arm")
        with pytest.raises(IntentError, match=r"node arm: .*exit code 1: no such arm"):
            nodes.check(may_end=("arm",))
        waiting = nodes.pid("waiting")
    with pytest.raises(ProcessLookupError):
        os.kill(waiting, 0)


@pytest.mark.parametrize("name", NODES)
def test_help_says_what_it_does_and_where_its_parameters_are(name, capsys):
    assert start.start(name, [name, "--help"]) == 0
    first, _, usage, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith(f"{name}: ") and first.endswith(".") and "ode" not in first.split()[1]
    assert usage.startswith(f"usage: {name} [--ros-args [-p NAME:=VALUE")
    assert "docs/reference/nodes.md" in "\n".join(rest)


@pytest.mark.parametrize("words", [["-p", "model:=M.npz"], ["--model", "M.npz"], ["M.npz"]])
def test_what_rclpy_would_ignore_is_refused(words, capsys):
    assert start.start("intent_estimator", ["intent_estimator", *words]) == 1
    assert f"expected --ros-args first, got {words[0]}. " in capsys.readouterr().err


def test_an_import_that_fails_for_another_reason_is_shown_whole():
    with pytest.raises(ImportError, match="scipy"):
        tell_missing("node", ModuleNotFoundError("No module named 'scipy'", name="scipy"))


class Managed(ManagedNode):
    """Notes its transitions, and fails where it is told to."""

    def __init__(self, fail: Exception | None = None, **kwargs):
        super().__init__("managed", **kwargs)
        self.fail, self.seen = fail, []
        self.start()

    def configure(self):
        if self.fail:
            raise self.fail
        self.seen.append("configure")

    def activate(self):
        self.seen.append("activate")
        if self.fail:
            raise self.fail

    def deactivate(self):
        self.seen.append("deactivate")


def change(harness, transition):
    request = ChangeState.Request(transition=Transition(id=transition))
    return harness.call(ChangeState, "managed/change_state", request).success


@pytest.mark.parametrize("transition", [Transition.TRANSITION_ACTIVATE, 77])
def test_managed_node_refuses_a_transition_that_does_not_begin_here(harness, transition):
    node = harness.add(Managed())
    assert not change(harness, transition)
    assert node.active
    assert change(harness, Transition.TRANSITION_DEACTIVATE)


def test_a_managed_node_that_is_destroyed_leaves_the_graph(harness):
    node = Managed()
    harness.spin_until(lambda: "managed" in harness.probe.get_node_names())
    node.destroy_node()
    harness.spin_until(lambda: "managed" not in harness.probe.get_node_names())


@pytest.mark.parametrize("error", [ModelError("no model"), ZeroDivisionError()])
def test_managed_node_survives_a_failing_transition(harness, error):
    override = [Parameter("autostart", value=False)]
    node = harness.add(Managed(fail=error, parameter_overrides=override))
    assert not change(harness, Transition.TRANSITION_CONFIGURE)
    node.fail = None
    assert change(harness, Transition.TRANSITION_CONFIGURE)
    assert change(harness, Transition.TRANSITION_ACTIVATE)
    assert node.active


@pytest.mark.parametrize(
    ("error", "again"),
    [
        (ModelError("no model"), (Transition.TRANSITION_ACTIVATE,)),
        (ZeroDivisionError(), (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)),
    ],
)
def test_an_activation_that_fails_is_undone(harness, error, again):
    node = harness.add(Managed())
    assert change(harness, Transition.TRANSITION_DEACTIVATE)
    node.fail = error
    assert not change(harness, Transition.TRANSITION_ACTIVATE)
    assert not node.active and node.seen[-2:] == ["activate", "deactivate"]
    node.fail = None
    assert all(change(harness, transition) for transition in again)
    assert node.active


@given(st.integers(1, 500), st.integers(1, 100))
def test_thinning_keeps_the_newest_and_the_order(n, most):
    kept = thin(range(n), most)
    assert len(kept) == min(n, most)
    assert kept[-1] == n - 1
    assert kept == sorted(set(kept))
    gaps = [b - a for a, b in zip([-1, *kept[:-1]], kept, strict=True)]
    assert max(gaps) - min(gaps) <= 1


def test_a_queue_that_grew_once_is_worked_off_and_one_that_goes_on_growing_is_thinned(harness):
    used, dropped = [], []
    n = 5 * MAX_WAITING
    qos = QoSProfile(depth=1000)

    def use(message: Int64) -> None:
        used.append(message.data)
        if message.data == n - 1:  # more has come meanwhile
            send(range(n, 2 * n))

    def send(numbers) -> None:
        for number in numbers:
            publisher.publish(Int64(data=number))

    Backlog(dropped.append).subscribe(harness.probe, Int64, "numbers", use, qos)
    publisher = harness.publisher(Int64, "numbers", qos)
    harness.connect(publisher)
    send(range(n))
    harness.spin_until(lambda: 2 * n - 1 in used, what="the newest")
    assert used[:n] == list(range(n))
    assert used == sorted(set(used))
    assert len(used) + sum(dropped) == 2 * n and dropped
    send([2 * n])  # and it goes on
    harness.spin_until(lambda: used[-1] == 2 * n, what="one more")


def test_topics_that_wait_together_are_used_in_the_order_of_their_stamps(harness):
    used, dropped = [], []
    qos = QoSProfile(depth=1000)
    backlog = Backlog(dropped.append)

    def use(message: Header) -> None:
        used.append(message.stamp.nanosec)

    for topic in ("a", "b", "c"):
        backlog.subscribe(harness.probe, Header, topic, use, qos)
    publishers = [harness.publisher(Header, topic, qos) for topic in ("a", "b", "c")]
    harness.connect(*publishers)
    for number in range(1, 46):  # none of the last topic: its square has no remainder of two
        publishers[(number * number) % 3].publish(Header(stamp=to_stamp(number)))
    harness.spin_until(lambda: len(used) == 45, what="all")
    assert used == list(range(1, 46)) and not dropped
    assert len(backlog.close(harness.probe)) == 3 and backlog.close(harness.probe) == []
