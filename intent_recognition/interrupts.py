# SPDX-License-Identifier: Apache-2.0
"""The executables are quiet from their first import on.

Importing a node takes a second or two. An interrupt meanwhile would leave a traceback from the
middle of a library; here it ends the process, which has nothing to clean up yet.
"""

import os
import signal
import sys
from contextlib import suppress

NODES = (
    *("mocap_ingest", "intent_estimator", "primitive_activation", "bag_recorder", "bag_player"),
    *("object_warper", "task_teacher", "warped_primitive", "dashboard"),
    *("arm_sim", "lwr_sim", "coworker_sim"),
)
COMMAND = "intent"
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
    """From here on Ctrl-C is a KeyboardInterrupt in the command."""
    if signal.getsignal(signal.SIGINT) is _end_command:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end_node(*_: object) -> None:
    os._exit(0)


def _end_command(*_: object) -> None:
    os._exit(INTERRUPTED)


end_at_interrupt()
