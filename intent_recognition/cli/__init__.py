# SPDX-License-Identifier: Apache-2.0
"""The command line: `intent COMMAND`."""

import os

# Before numpy is loaded; see intent_recognition.nodes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
