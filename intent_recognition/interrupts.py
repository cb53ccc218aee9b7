# SPDX-License-Identifier: Apache-2.0
"""Handling of interrupts by the executables, also while they import what they need.

Importing a node takes a second or two. An interrupt meanwhile would print a traceback from inside a
library; these handlers end the process instead, which has nothing to clean up yet.
"""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a command which has started other processes."""
SAME_S = 1.0
"""Time within which interrupts count as one [s]: a terminal and a parent process both send one."""
INTERRUPTED = 130
"""Exit code of an interrupted command; an interrupted node ends with 0."""


def end_node_at_interrupts() -> None:
    """Let SIGINT and SIGTERM end the process of a node from now on; a launch file blocks SIGINT."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end_node)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def end_command_at_interrupt() -> None:
    """Let Ctrl-C end the process of a command from now on."""
    signal.signal(signal.SIGINT, _end_command)


def raise_interrupts() -> None:
    """Let Ctrl-C raise KeyboardInterrupt in the command, but end the process during imports."""
    if signal.getsignal(signal.SIGINT) is _end_command:
        signal.signal(signal.SIGINT, _Interrupt())


def ignore_interrupts() -> None:
    """Ignore Ctrl-C from now on: the command is over, and only Python's shutdown remains."""
    if isinstance(signal.getsignal(signal.SIGINT), _Interrupt):
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def end_like_interrupted(*numbers: int) -> None:
    """Let these signals do what Ctrl-C does, or would do if it were not ignored.

    A shell starts background processes with SIGINT ignored.
    """
    present = signal.getsignal(signal.SIGINT)
    handler = present if callable(present) else _Interrupt()
    for number in numbers:
        if number != signal.SIGINT:
            signal.signal(number, handler)


@contextmanager
def uninterrupted_children() -> Iterator[None]:
    """Block Ctrl-C in processes that are started in this context; this process ends them.

    Handlers in the children would come too late: an interrupt may arrive while Python starts.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Noted:
    """Remembers that a signal came, until `take` is called."""

    def __init__(self) -> None:
        self._came = False

    def take(self) -> bool:
        """Return whether a signal came, and forget it."""
        came, self._came = self._came, False
        return came

    def note(self, *_: object) -> None:
        """Remember a signal, as its handler."""
        self._came = True


@contextmanager
def noted_interrupts() -> Iterator[Noted]:
    """Defer signals in this context to its end, unless they are taken before.

    Raises:
        KeyboardInterrupt: a signal came, and was not taken.
    """
    noted = Noted()
    previous = {number: signal.signal(number, noted.note) for number in END_SIGNALS}
    try:
        yield noted
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
    if noted.take():
        raise KeyboardInterrupt


class _Interrupt:
    """Interrupts the command, unless the last signal was less than `SAME_S` ago."""

    def __init__(self) -> None:
        self._last_s = float("-inf")

    def __call__(self, _: int, frame: FrameType | None) -> None:
        if _is_importing(frame):
            _end_command()
        before_s, self._last_s = self._last_s, time.monotonic()
        if self._last_s - before_s > SAME_S:
            raise KeyboardInterrupt


def _is_importing(frame: FrameType | None) -> bool:
    """Whether a module is being imported: libraries swallow exceptions that are raised there."""
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def _end_node(*_: object) -> None:
    os._exit(0)


def _end_command(*_: object) -> None:
    os._exit(INTERRUPTED)
