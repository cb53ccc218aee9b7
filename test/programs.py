# SPDX-License-Identifier: Apache-2.0
"""Programs that are run to their end."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def output_of(
    *command: object, cwd: Path = ROOT, timeout_s: float | None = None, **environment: str
) -> str:
    """What a program prints that ends well; both its streams are the message of a failure."""
    run = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env=os.environ | environment,
        timeout=timeout_s,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


def python_says(code: str) -> str:
    """What a fresh Python prints that runs the code in the checkout."""
    return output_of(sys.executable, "-c", code)
