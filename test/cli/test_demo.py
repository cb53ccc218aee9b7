# SPDX-License-Identifier: Apache-2.0
"""The demo as a user runs it: real processes, and every way out; a session: test_demo_arms.py."""

import os
import signal
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from intent_recognition.cli.main import main
from intent_recognition.interrupts import END_SIGNALS
from intent_recognition.model import Model, load_model, save_model

pytestmark = pytest.mark.slow

START_S = 120.0
POURING = ("--scenario", "pouring")
DEMO = (sys.executable, "-m", "intent_recognition.cli.main")


def children(pid: int) -> list[int]:
    """Process ids of the nodes a demo has started."""
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii")
    return [int(child) for child in listed.split()]


def alive(pid: int) -> bool:
    status = Path(f"/proc/{pid}/status")
    try:
        return "State:\tZ" not in status.read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.fixture
def run(tmp_path, capsys):
    """Run a demo that ends before it begins, in this process; its exit code and output."""
    before = [(number, signal.getsignal(number)) for number in END_SIGNALS]

    def start(*arguments: str) -> tuple[int, str, str]:
        try:
            code = main(["demo", "--headless", "--output", str(tmp_path / "out"), *arguments])
        except SystemExit as ended:
            code = ended.code
        return code, *capsys.readouterr()

    yield start
    for number, handler in before:
        signal.signal(number, handler)


def test_ended_it_stops_every_process(tmp_path, toolbox_model):
    """As by Ctrl-C: test_interrupts.py; killed: test_lifecycle.py; a node: test_demo_session.py."""
    output = ("--output", str(tmp_path / "out"), "--model", str(toolbox_model))
    process = subprocess.Popen(
        [*DEMO, "demo", "--headless", *output, "--interactions", "3"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        line = process.stdout.readline()
        assert "session begins" in line, line + process.stderr.read()
        nodes = children(process.pid)
        assert len(nodes) >= 5
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=START_S)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert [pid for pid in nodes if alive(pid)] == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--task-list", "juggling"), "task_list: expected labels"),
        (("--model", "/nowhere.npz"), "/nowhere.npz: expected a model file"),
        (("--output", "/dev/null/out"), "--output: expected a folder that can be made"),
        (("--dashboard", "--port", "0"), "--port: expected 1 to 65535, got 0"),
        (("--scenario", "assembly", "--changes", "1"), "--changes: expected 0 with --scenario"),
        (("--scenario", "cell", "--transfers"), "--transfers: expected no such option with"),
        (("--arm", "lwr,panda"), "--model: expected no such option with several arms"),
        (("--rate", "0"), "--rate: expected 0.01 to 50, got 0"),
        (("--recordings", "bags"), "intent train RECORDINGS"),
        (("--pour", "-1"), "Add --scenario pouring"),
        (("--pair", "tea_cup,paper_cup"), "Add --scenario pouring"),
        ((*POURING, "--record", "bag"), "--record"),
        ((*POURING, "--arm", "panda"), "--arm"),
        ((*POURING, "--pair", "mug"), "--pair"),
        ((*POURING, "--pour", "much"), "pour"),
        ((*POURING, "--model", "no.npz"), "no.npz"),
    ],
)
def test_bad_options_are_one_line(run, toolbox_model, arguments, message, tmp_path):
    if not {"--model", "--recordings", "pouring"} & {*arguments}:
        arguments = (*arguments, "--model", str(toolbox_model))
    code, _, errors = run("--interactions", "1", *arguments)
    assert code == (2 if "usage" in errors else 1)
    last = errors.strip().splitlines()[-1]
    assert message in last.replace("argument ", "")
    assert code == 2 or last == errors.strip()
    assert "pouring" not in arguments or not list(tmp_path.iterdir())


def test_a_model_of_another_scenario_is_refused(run, toolbox_model, tmp_path):
    model = load_model(toolbox_model)
    (wrist,) = model.dofs.observed
    (joints,) = model.dofs.controlled
    path = tmp_path / "other.npz"
    wand, q = replace(wrist, topic="mocap/wand/pose"), tuple("q" + j for j in joints.joints)
    for other, said in (
        ({"observed": (wand,)}, "observes mocap/wrist/pose, got mocap/wand/pose"),
        ({"controlled": (replace(joints, joints=q),)}, "controls lwr_a1_joint, lwr_a2_joint, "),
    ):
        save_model(path, Model(model.library, replace(model.dofs, **other)))
        code, printed, errors = run("--interactions", "1", "--model", str(path))
        assert code == 1 and not printed
        assert f"expected a model that {said}" in errors


def test_a_port_in_use_is_told_before_the_training(run):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        code, printed, errors = run("--dashboard", "--port", port)
    assert code == 1
    assert errors.strip().startswith(f"intent demo: --port: expected a free port, got {port}")
    assert not printed


def test_sequences_that_are_no_text_are_told_before_anything_starts(tmp_path, capsys):
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "latin").write_bytes(b"\xff")
    for name in ("fifo", "latin", "absent"):
        words = ("--output", str(tmp_path / "out"), "--sequences", str(tmp_path / name))
        assert main(["demo", *words]) == 1
        said = f"intent demo: --sequences {tmp_path / name}: expected"
        assert capsys.readouterr().err.startswith(said)
