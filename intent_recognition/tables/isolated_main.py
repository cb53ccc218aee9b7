# SPDX-License-Identifier: Apache-2.0
"""What `isolated` runs in another process: it imports nothing of ours, to begin at once."""

import runpy
import sys

import numpy as np

MOST_MEMORY = 2**32
"""Bytes of address space that a library may take. Convention: ezc3d holds four copies of values of
which 0.5 GB are read."""


def main(script: str, path: str, result: str, function: str) -> int:
    """Write what a function of a script returns as `.npz`; on failure, say why."""
    try:
        import resource  # not on every system
    except ImportError:
        pass
    else:
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    try:
        arrays = runpy.run_path(script)[function](path)
    except Exception as error:  # the libraries raise what they meet
        sys.stdout.write(str(error) or type(error).__name__)
        return 1
    np.savez(result, **arrays)
    return 0
