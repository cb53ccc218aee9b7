# SPDX-License-Identifier: Apache-2.0
"""The command line: `intent COMMAND`.

A file for each command, by its name; what several share lies beside them.

What a command raises on purpose is an `IntentError`: `main` prints it in one line, and ends with 1.
"""

import os

# Before numpy is loaded; see intent_recognition.nodes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
