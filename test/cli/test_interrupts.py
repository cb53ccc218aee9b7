# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C in a command and in an executable: at once while it imports, once where two come."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from programs import python_says

from benchmarks.interrupts import commands
from intent_recognition import interrupts

SWALLOWS = """
import os, signal
try:
    os.kill(os.getpid(), signal.SIGINT)
except BaseException:
    pass
"""


def test_two_interrupts_within_milliseconds_are_one(monkeypatch):
    now_s = iter([5.0, 5.003, 7.0])
    monkeypatch.setattr(interrupts.time, "monotonic", lambda: next(now_s))
    interrupt = interrupts._Interrupt()
    with pytest.raises(KeyboardInterrupt):
        interrupt(2, None)
    interrupt(2, None)
    with pytest.raises(KeyboardInterrupt):
        interrupt(2, None)


@pytest.mark.parametrize("number", interrupts.END_SIGNALS)
def test_a_signal_that_nobody_has_taken_interrupts_afterwards(number):
    handler, steps = signal.getsignal(number), []
    with pytest.raises(KeyboardInterrupt), interrupts.noted_interrupts():
        signal.raise_signal(number)
        signal.raise_signal(number)
        steps.append("done")
    assert steps == ["done"]
    with interrupts.noted_interrupts() as noted:
        signal.raise_signal(number)
        assert [noted.take(), noted.take()] == [True, False]
    assert signal.getsignal(number) is handler


IN_COMMANDS = "i.raise_interrupts()"
IN_THE_DEMO = "i.raise_interrupts(); i.end_like_interrupted(*i.END_SIGNALS)"


@pytest.mark.parametrize(
    ("number", "prepared"),
    [("SIGINT", IN_COMMANDS), ("SIGINT", IN_THE_DEMO), ("SIGTERM", IN_THE_DEMO)],
)
def test_a_library_that_swallows_a_signal_while_it_loads_does_not_keep_the_command(
    tmp_path, number, prepared
):
    (tmp_path / "swallows.py").write_text(SWALLOWS.replace("SIGINT", number))
    code = (
        "import sys; from intent_recognition import interrupts as i\n"
        f"i.end_command_at_interrupt(); {prepared}\n"
        f"sys.path.append({str(tmp_path)!r})\n"
        "import swallows; print('went on')"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (interrupts.INTERRUPTED, "", "")


@pytest.mark.parametrize("present", [signal.SIG_IGN, signal.default_int_handler])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_what_runs_in_the_background_can_be_ended(present, number):
    before = {each: signal.getsignal(each) for each in interrupts.END_SIGNALS}
    try:
        signal.signal(signal.SIGINT, present)
        interrupts.end_like_interrupted(*interrupts.END_SIGNALS)
        assert signal.getsignal(signal.SIGINT) is present
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
    finally:
        for changed, handler in before.items():
            signal.signal(changed, handler)


def test_processes_started_for_work_hear_no_ctrl_c():
    code = "import signal; signal.raise_signal(signal.SIGINT); print('goes on')"
    with interrupts.uninterrupted_children():
        child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (child.returncode, child.stdout, child.stderr) == (0, "goes on\n", "")
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == set()


@pytest.mark.slow
def test_an_interrupt_that_comes_when_a_command_is_over_leaves_its_exit_code():
    """Python gives signals back to the system while it ends, which would end it by them."""
    code = (
        "import atexit, os, signal, sys; sys.argv = ['intent', 'inspect', '/no/such/bag']\n"
        "atexit.register(lambda: os.kill(os.getpid(), signal.SIGINT))\n"
        "from intent_recognition.cli.main import main\n"
        "sys.exit(main())"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == 1
    assert ended.stderr.count("\n") == 1


def test_hardly_anything_is_imported_before_interrupts_are_handled():
    code = (
        "import sys, intent_recognition.cli.start, intent_recognition.nodes.start\n"
        "print(*sorted(name for name in sys.modules if name.startswith('intent_recognition')))"
    )
    ours = "", ".cli", ".cli.start", ".interrupts", ".nodes", ".nodes.start"
    assert python_says(code).split() == [f"intent_recognition{name}" for name in ours]


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


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
@pytest.mark.parametrize(
    ("name", "instant"),
    [
        ("mocap_ingest", "imports rclpy"),
        ("primitive_activation", "joins the graph"),
        ("coworker_sim", "ready"),
        ("intent demo", "imports numpy"),
    ],
)
def test_what_is_interrupted_ends_as_it_should(name, instant, tmp_path):
    """Other nodes that are ready: `test/docs/test_run.py`; a demo that runs: `test_demo.py`."""
    command, expected = commands()[name]
    process, said = start(command, tmp_path)
    wait_for(process, instant, said)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(LONGEST_S) == expected
    assert "Traceback" not in said.read_text()
