# SPDX-License-Identifier: Apache-2.0
"""The demo as a user runs it: real processes, a short session, and every way out."""

import argparse
import io
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

from intent_recognition.cli import demo
from intent_recognition.cli.demo_scene import make_scene
from intent_recognition.model.file import load_trained

pytestmark = pytest.mark.slow

START_S, END_S = 120.0, 600.0


def command(output: Path, *arguments: str) -> list[str]:
    return [
        *(sys.executable, "-m", "intent_recognition.cli.main", "demo", "--headless"),
        *("--output", str(output), *arguments),
    ]


def children(pid: int) -> list[int]:
    """Process ids of the nodes a demo has started."""
    listed = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False
    )
    return [int(line) for line in listed.stdout.split()]


def alive(pid: int) -> bool:
    status = Path(f"/proc/{pid}/status")
    try:
        return "State:\tZ" not in status.read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.fixture
def running_demo(tmp_path, toolbox_model):
    """A demo in the middle of its session, with the pids of its nodes."""
    process = subprocess.Popen(
        command(tmp_path / "out", "--model", str(toolbox_model), "--interactions", "3"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    line = process.stdout.readline()
    assert "interactions begin" in line, line + process.stderr.read()
    nodes = children(process.pid)
    yield process, nodes
    if process.poll() is None:
        process.kill()
    process.communicate()


def test_recognises_and_helps(tmp_path, toolbox_model):
    result = subprocess.run(
        command(
            tmp_path / "out",
            *("--model", str(toolbox_model), "--task-list", "plate_handover,hold_screwdriver"),
            *("--json", str(tmp_path / "numbers.json"), "--record", str(tmp_path / "bag")),
        ),
        capture_output=True,
        text=True,
        timeout=END_S,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    last = result.stdout.strip().splitlines()[-1]
    assert last.startswith("summary: recognised 2/2, decided before the end 2/2, hand error ")
    numbers = json.loads((tmp_path / "numbers.json").read_text(encoding="utf-8"))
    for interaction in numbers["interactions"]:
        assert interaction["recognised"] == interaction["task"]
        assert interaction["hand_error_m"] < 0.06
        assert interaction["observations"] > 5
    page = (tmp_path / "out/report.html").read_text(encoding="utf-8")
    assert "plate_handover" in page
    assert any((tmp_path / "bag").glob("*.mcap"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_it_stops_every_process(running_demo, number):
    process, nodes = running_demo
    assert len(nodes) >= 5
    process.send_signal(number)
    _, errors = process.communicate(timeout=START_S)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert [pid for pid in nodes if alive(pid)] == []


def test_a_node_that_dies_ends_the_demo_with_its_name(running_demo):
    process, nodes = running_demo
    os.kill(nodes[0], signal.SIGKILL)
    _, errors = process.communicate(timeout=START_S)
    assert process.returncode == 1
    assert "intent demo: node " in errors
    assert "Traceback" not in errors
    assert [pid for pid in nodes if alive(pid)] == []


def test_killed_it_leaves_no_orphan(running_demo):
    process, nodes = running_demo
    process.kill()
    process.wait(timeout=START_S)
    for pid in nodes:
        gone = ["timeout", str(START_S), "tail", "--pid", str(pid), "-f", "/dev/null"]
        subprocess.run(gone, check=True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--task-list", "juggling"), "task_list: expected labels"),
        (("--model", "/nowhere.npz"), "/nowhere.npz: expected a model file"),
        (("--output", "/dev/null/out"), "--output: expected a folder that can be made"),
        (("--dashboard", "--port", "0"), "--port: expected 1 to 65535, got 0"),
        (("--scenario", "assembly", "--changes", "1"), "--changes: expected 0 in the assembly"),
        (("--arm", "lwr,panda"), "--arm: expected one arm with --model"),
        (("--rate", "0"), "--rate: expected 0.01 to 50, got 0"),
    ],
)
def test_bad_options_are_one_line(tmp_path, toolbox_model, arguments, message):
    if "--model" not in arguments:
        arguments = (*arguments, "--model", str(toolbox_model))
    result = run(command(tmp_path / "out", "--interactions", "1", *arguments))
    assert result.returncode == (2 if "usage" in result.stderr else 1)
    last = result.stderr.strip().splitlines()[-1]
    assert message in last.replace("argument ", "")
    assert result.returncode == 2 or last == result.stderr.strip()


def test_a_port_in_use_is_told_before_the_training(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        result = run(command(tmp_path / "out", "--dashboard", "--port", port))
    assert result.returncode == 1
    assert result.stderr.strip().startswith(f"intent demo: --port: expected a free one, got {port}")
    assert not result.stdout


def test_its_model_can_be_added_to(tmp_path):
    options = {"scenario": "toolbox", "arm": "lwr", "task_list": "habit", "seed": 1, "changes": 0}
    scene = make_scene(argparse.Namespace(interactions=1, **options))
    path = demo._train(tmp_path / "model.npz", Console(file=io.StringIO()), scene)
    model, trained = load_trained(path)
    assert model.library.transition_prior is not None
    assert trained


def run(command):
    return subprocess.run(command, capture_output=True, text=True, timeout=START_S, check=False)
