# SPDX-License-Identifier: Apache-2.0
"""The shipped files (config, bags), wherever the package was installed."""

import os
import sys
from pathlib import Path

from intent_recognition.errors import IntentError, describe

PACKAGE = "intent_recognition"


def share_path(relative: str) -> Path:
    """Path of a shipped file or folder, e.g. `share_path("bags/toolbox")`.

    Looked for in the source tree (checkout, `pip install -e`), beside the installed package
    (pip, colcon) and in the prefixes of `AMENT_PREFIX_PATH`, in this order.

    Raises:
        IntentError: it is in none of these places.
    """
    package = Path(__file__).resolve().parent
    if (package.parent / "package.xml").is_file():
        folders = [package.parent]
    else:
        folders = []
    ament = [Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    prefixes = [*package.parents, *ament, Path(sys.prefix)]
    folders += [prefix / "share" / PACKAGE for prefix in prefixes]
    for folder in folders:
        if (folder / relative).exists():
            return folder / relative
    raise IntentError(
        describe(relative, "a file shipped with the package", "none", "Install the package again.")
    )
