# SPDX-License-Identifier: Apache-2.0
"""The chain with every node in its own process, as it is used."""

import os
import signal
import uuid
from contextlib import ExitStack
from pathlib import Path

import pytest
from ros_harness import NodeProcess
from system.cell import Cell, recorded

from intent_recognition.nodes.processes import node_environment

pytestmark = pytest.mark.slow

MARK = "INTENT_RECOGNITION_TEST_MARK"
NODES = {
    "intent_recognition.nodes.mocap_ingest": ("use_sim_time:=true",),
    "intent_recognition.nodes.intent_estimator": ("use_sim_time:=true", "model:={model}"),
    "intent_recognition.nodes.primitive_activation": (
        "use_sim_time:=true",
        "model:={model}",
        "hold_time:=3.0",
    ),
    "sim_bridge.nodes.lwr_sim": ("publish_clock:=true",),
}


def parameters(values: tuple[str, ...], **names) -> list[str]:
    """The values as ROS arguments."""
    pairs = (("-p", value.format(**names)) for value in values)
    return ["--ros-args", *(word for pair in pairs for word in pair)]


def processes_marked(mark: str) -> list[str]:
    """Command lines of all processes whose environment holds the mark."""
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit() or int(folder.name) == os.getpid():
            continue
        try:
            environment = (folder / "environ").read_bytes()
            command = (folder / "cmdline").read_bytes()
        except OSError:  # it ended meanwhile, or is another user's
            continue
        if f"{MARK}={mark}".encode() in environment.split(b"\0") and command:
            found.append(command.replace(b"\0", b" ").decode(errors="replace"))
    return found


@pytest.fixture
def mark():
    """A word in the environment by which all processes of one test are known."""
    return uuid.uuid4().hex


def test_separate_processes_do_the_work_and_end_cleanly(harness, repository, toolbox_model, mark):
    environment = node_environment({**os.environ, MARK: mark})
    wrist = recorded(repository / "bags/toolbox/test/plate_handover_03")
    end_s = wrist.end_ns * 1e-9
    cell = Cell(harness)
    with ExitStack() as stack:
        nodes = [
            stack.enter_context(
                NodeProcess(
                    module, *parameters(values, model=toolbox_model), environment=environment
                )
            )
            for module, values in NODES.items()
        ]
        cell.connect()
        assert len(processes_marked(mark)) == len(nodes)
        cell.show(wrist)
        cell.run_until(lambda: wrist.task in cell.labels(), "the task active")
        cell.run_to(end_s + 1.0)
        assert cell.labels() == ["", wrist.task]
        assert set(cell.leader(0.8 * end_s, end_s)) == {wrist.task}
        assert cell.hand_error_m(end_s + 1.0) < 0.05
        assert all(node.process.poll() is None for node in nodes)
        for node in nodes:
            node.process.send_signal(signal.SIGINT)
        for node in nodes:
            assert node.wait() == 0, node.errors
    assert not any("Traceback" in node.errors for node in nodes)
    assert processes_marked(mark) == []
