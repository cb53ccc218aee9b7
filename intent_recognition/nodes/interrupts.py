# SPDX-License-Identifier: Apache-2.0
"""A node is quiet from its first import on.

Importing a node takes a second or two. An interrupt meanwhile would leave a traceback from the
middle of a library; here it ends the process, which has nothing to clean up yet.
"""

import os
import signal
import sys
from contextlib import suppress

EXECUTABLES = (
    *("mocap_ingest", "intent_estimator", "primitive_activation", "bag_recorder", "bag_player"),
    *("object_warper", "task_teacher", "dashboard", "arm_sim", "lwr_sim", "coworker_sim"),
)


def end_at_interrupt() -> None:
    """End at SIGINT or SIGTERM, if this process is the executable of a node; until `run`."""
    if sys.argv and sys.argv[0].rsplit(os.sep, 1)[-1] in EXECUTABLES:
        with suppress(ValueError):  # imported in another thread than the main one
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, _end)


def _end(*_: object) -> None:
    os._exit(0)
