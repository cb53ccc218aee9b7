# SPDX-License-Identifier: Apache-2.0
"""The command line: `intent COMMAND`."""

import contextlib
import os
import signal
import sys

# Before numpy is loaded; see intent_recognition.nodes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
INTERRUPTED = 130
"""Exit code of an interrupted command."""


def end_quietly() -> None:
    """End at once at Ctrl-C, if this process is the command: an import has nothing to clean up."""
    if sys.argv and sys.argv[0].rsplit(os.sep, 1)[-1] == "intent":  # not where it is imported
        with contextlib.suppress(ValueError):  # in another thread than the main one
            signal.signal(signal.SIGINT, _end)


def raise_interrupts() -> None:
    """From here on Ctrl-C is a KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(*_: object) -> None:
    os._exit(INTERRUPTED)


end_quietly()
