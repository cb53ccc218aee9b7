# SPDX-License-Identifier: Apache-2.0
"""Script that `isolated` runs in another process; it starts fast without our own imports."""

import runpy
import sys

import numpy as np

MOST_MEMORY = 2**32
"""Address space that a library may use [bytes]; ezc3d holds four copies of the values, of which
0.5 GB are read."""


def main(script: str, path: str, result: str, function: str) -> int:
    """Write the arrays that a function of a script returns as `.npz`; print errors to stdout."""
    try:
        import resource  # does not exist on every system
    except ImportError:
        pass
    else:
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    try:
        arrays = runpy.run_path(script)[function](path)
    except Exception as error:  # the libraries may raise anything
        sys.stdout.write(str(error) or type(error).__name__)
        return 1
    np.savez(result, **arrays)
    return 0
