# SPDX-License-Identifier: Apache-2.0
"""Nodes as child processes end with the one that started them, and one that dies is named."""

import os
import subprocess
import sys

import pytest

from intent_recognition.errors import IntentError
from intent_recognition.nodes.processes import NodeProcesses

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
            nodes.check()
        waiting = nodes.pid("waiting")
    with pytest.raises(ProcessLookupError):
        os.kill(waiting, 0)
