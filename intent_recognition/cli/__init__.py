# SPDX-License-Identifier: Apache-2.0
"""The command line: `intent COMMAND`.

Each command has a file of its name; shared parts lie beside them.

Expected failures are `IntentError`: `main` prints one in one line, and ends with exit code 1.
"""

import os

# Must be set before numpy is imported; see intent_recognition.nodes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
