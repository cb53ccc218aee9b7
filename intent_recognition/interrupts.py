# SPDX-License-Identifier: Apache-2.0
"""The executables are quiet from their first import on.

Importing a node takes a second or two. An interrupt meanwhile would leave a traceback from the
middle of a library; here it ends the process, which has nothing to clean up yet.
"""

import os
import signal
import sys
import time
from contextlib import suppress
from types import FrameType

NODES = (
    *("mocap_ingest", "intent_estimator", "primitive_activation", "bag_recorder", "bag_player"),
    *("object_warper", "task_teacher", "warped_primitive", "dashboard"),
    *("arm_sim", "lwr_sim", "coworker_sim"),
)
COMMAND = "intent"
SAME_S = 1.0
"""Interrupts that come within this time of another are the same [s]: a terminal sends one, and so
does what started the command. Convention."""
INTERRUPTED = 130
"""Exit code of an interrupted command; a node that was asked to end ends with 0."""


def end_at_interrupt() -> None:
    """End at SIGINT, a node also at SIGTERM, if this process is an executable of the package."""
    name = sys.argv[0].rsplit(os.sep, 1)[-1] if sys.argv else ""
    with suppress(ValueError):  # imported in another thread than the main one
        if name in NODES:
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, _end_node)
        elif name == COMMAND:
            signal.signal(signal.SIGINT, _end_command)


def raise_interrupts() -> None:
    """From here on Ctrl-C is a KeyboardInterrupt in the command, but while it imports more."""
    if signal.getsignal(signal.SIGINT) is _end_command:
        signal.signal(signal.SIGINT, _Interrupt())


class _Interrupt:
    """Interrupts the command; one within `SAME_S` of the one before is the same."""

    def __init__(self) -> None:
        self._last_s = float("-inf")

    def __call__(self, _: int, frame: FrameType | None) -> None:
        if _is_importing(frame):
            _end_command()
        before_s, self._last_s = self._last_s, time.monotonic()
        if self._last_s - before_s > SAME_S:
            raise KeyboardInterrupt


def _is_importing(frame: FrameType | None) -> bool:
    """Whether a module is being loaded: libraries swallow what is raised there."""
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def _end_node(*_: object) -> None:
    os._exit(0)


def _end_command(*_: object) -> None:
    os._exit(INTERRUPTED)


end_at_interrupt()
