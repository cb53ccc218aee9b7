# SPDX-License-Identifier: Apache-2.0
"""Read files in a separate process, with libraries that a malformed file may crash.

For 5 % of 600 files with random errors in their header, ezc3d 1.7.2 ended in a segmentation fault;
for others it allocated memory without bound.
"""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numpy.typing import NDArray

from intent_recognition.errors import BagError, one_line, printable
from intent_recognition.untrusted import UntrustedError, read_arrays

HERE = Path(__file__).parent
BOOT = "import runpy, sys; sys.exit(runpy.run_path(sys.argv[1])['main'](*sys.argv[2:]))"


def read_isolated(
    script: str, path: Path, kind: str, functions: tuple[str, ...] = ("read",)
) -> dict[str, NDArray[Any]]:
    """Read a file with the first of `functions` of a script that can, each in another process."""
    reasons = []
    for function in functions:
        with TemporaryDirectory(prefix="intent_read_") as folder:
            result = Path(folder) / "arrays.npz"
            arguments = (HERE / "isolated_main.py", HERE / script, path.resolve(), result, function)
            command = [sys.executable, "-c", BOOT, *map(str, arguments)]
            try:
                # ezc3d takes 60 s for an hour of 60 markers.
                done = subprocess.run(
                    command, capture_output=True, timeout=300.0, check=False, cwd=folder
                )
                if done.returncode == 0:
                    return read_arrays(result)
                said = " ".join(done.stdout.decode(errors="replace").split())
                why = printable(said) or f"a file that ends the library with {done.returncode}"
            except (subprocess.TimeoutExpired, UntrustedError, OSError) as error:
                why = one_line(error)
        reasons.append(f"{function} says: {why}" if functions[1:] else why)
    cure = "Check it with the program that wrote it."
    raise BagError.about(str(path), kind, "; ".join(reasons), cure)
