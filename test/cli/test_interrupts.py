# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C in a command: at once while it imports, once where two come within milliseconds."""

import subprocess
import sys

import pytest

from intent_recognition import interrupts

SWALLOWS = """
import os, signal
try:
    os.kill(os.getpid(), signal.SIGINT)
except BaseException:
    pass
"""


def test_a_library_that_swallows_an_interrupt_while_it_loads_does_not_keep_the_command(tmp_path):
    (tmp_path / "swallows.py").write_text(SWALLOWS)
    code = (
        "import sys; sys.argv[0] = 'intent'\n"
        "from intent_recognition.interrupts import raise_interrupts\n"
        f"raise_interrupts(); sys.path.append({str(tmp_path)!r})\n"
        "import swallows; print('went on')"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (interrupts.INTERRUPTED, "", "")


def test_two_interrupts_within_milliseconds_are_one(monkeypatch):
    now_s = iter([5.0, 5.003, 7.0])
    monkeypatch.setattr(interrupts.time, "monotonic", lambda: next(now_s))
    interrupt = interrupts._Interrupt()
    with pytest.raises(KeyboardInterrupt):
        interrupt(2, None)
    interrupt(2, None)
    with pytest.raises(KeyboardInterrupt):
        interrupt(2, None)
