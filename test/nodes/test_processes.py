# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes: they end with who started them, and explain themselves."""

import os
import subprocess
import sys

import pytest

from intent_recognition.errors import IntentError
from intent_recognition.nodes import start
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
            nodes.check()
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


def test_an_import_that_fails_for_another_reason_is_shown_whole():
    with pytest.raises(ImportError, match="scipy"):
        tell_missing("node", ModuleNotFoundError("No module named 'scipy'", name="scipy"))


def test_there_is_no_executable_but_the_nodes():
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        start.nonsense  # noqa: B018
