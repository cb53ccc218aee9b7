# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C while an executable imports, joins the graph and runs: a clean end, no traceback.

`python -m benchmarks.interrupts` does the same 20 times for each executable, by the clock.
"""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from benchmarks.interrupts import commands

pytestmark = pytest.mark.slow
LONGEST_S = 90.0
LOADED = {
    "imports numpy": "_multiarray_umath",
    "imports rclpy": "_rclpy_pybind11",
    "joins the graph": "rmw_fastrtps_cpp",
}
"""Libraries that are mapped when a process gets so far."""


def start(command, tmp_path):
    """The process, with what it says in a file."""
    said = tmp_path / "said"
    with said.open("w") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, start_new_session=True)
    return process, said


def wait_for(process, what, said):
    """Until the process has come to an instant."""
    maps, end_s = Path(f"/proc/{process.pid}/maps"), time.monotonic() + LONGEST_S
    while process.poll() is None:
        text = maps.read_text() if what in LOADED else said.read_text()
        if LOADED.get(what, what) in text:
            return
        assert time.monotonic() < end_s, f"never {what}: {said.read_text()}"
        with suppress(subprocess.TimeoutExpired):
            process.wait(0.01)
    pytest.fail(f"ended before {what}: {said.read_text()}")


@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
@pytest.mark.parametrize(
    ("name", "instant"),
    [
        ("mocap_ingest", "imports rclpy"),
        ("primitive_activation", "joins the graph"),
        ("coworker_sim", "ready"),
    ],
)
def test_a_node_that_is_interrupted_ends_with_0(name, instant, tmp_path):
    """Other nodes that are ready: `test/docs/test_run.py`."""
    command, expected = commands()[name]
    process, said = start(command, tmp_path)
    wait_for(process, instant, said)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(LONGEST_S) == expected
    assert "Traceback" not in said.read_text()


@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
def test_a_demo_that_is_interrupted_while_it_imports_ends_with_130(tmp_path):
    """While it runs: `test_demo.py`."""
    command, expected = commands()["intent demo"]
    process, said = start(command, tmp_path)
    wait_for(process, "imports numpy", said)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(LONGEST_S) == expected
    assert "Traceback" not in said.read_text()
