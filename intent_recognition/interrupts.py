# SPDX-License-Identifier: Apache-2.0
"""The executables are quiet while they import what they need.

Importing a node takes a second or two. An interrupt meanwhile would leave a traceback from the
middle of a library; here it ends the process, which has nothing to clean up yet.
"""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""What ends a command that has started others."""
SAME_S = 1.0
"""Interrupts that come within this time of another are the same [s]. Convention: a terminal sends
one, and so does what started the command."""
INTERRUPTED = 130
"""Exit code of an interrupted command; a node that was asked to end ends with 0."""


def end_node_at_interrupts() -> None:
    """From here on SIGINT and SIGTERM end the process of a node."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end_node)


def end_command_at_interrupt() -> None:
    """From here on Ctrl-C ends the process of a command."""
    signal.signal(signal.SIGINT, _end_command)


def raise_interrupts() -> None:
    """From here on Ctrl-C is a KeyboardInterrupt in the command, but while it imports more."""
    if signal.getsignal(signal.SIGINT) is _end_command:
        signal.signal(signal.SIGINT, _Interrupt())


def ignore_interrupts() -> None:
    """From here on Ctrl-C does nothing: the command is over, and only Python's own end remains."""
    if isinstance(signal.getsignal(signal.SIGINT), _Interrupt):
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def end_like_interrupted(*numbers: int) -> None:
    """From here on these signals do what Ctrl-C does, or would do where it is ignored.

    A shell starts what is to run in the background with SIGINT ignored.
    """
    present = signal.getsignal(signal.SIGINT)
    handler = present if callable(present) else _Interrupt()
    for number in numbers:
        if number != signal.SIGINT:
            signal.signal(number, handler)


@contextmanager
def uninterrupted_children() -> Iterator[None]:
    """What is started here hears no Ctrl-C, which is for this process: that ends the others.

    A handler of their own would come too late: an interrupt may meet Python while it starts.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Noted:
    """Whether a signal came that nobody has taken yet."""

    def __init__(self) -> None:
        self._came = False

    def take(self) -> bool:
        """Whether one came; it is taken by that."""
        came, self._came = self._came, False
        return came

    def note(self, *_: object) -> None:
        """Handle a signal."""
        self._came = True


@contextmanager
def noted_interrupts() -> Iterator[Noted]:
    """Here signals interrupt nothing halfway; at the end one that nobody has taken does.

    Raises:
        KeyboardInterrupt: one came.
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
