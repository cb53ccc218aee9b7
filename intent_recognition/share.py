# SPDX-License-Identifier: Apache-2.0
"""Location of shipped files (config, bags) for every way of installation."""

import os
import sys
from pathlib import Path

from intent_recognition.errors import IntentError, describe

PACKAGE = "intent_recognition"


def source_tree() -> Path | None:
    """Root of the checkout from which the package runs; None for an installed package."""
    root = Path(__file__).resolve().parents[1]
    return root if (root / "package.xml").is_file() else None


def share_path(relative: str) -> Path:
    """Path of a shipped file or folder, e.g. `share_path("bags/toolbox")`.

    Searches the source tree (checkout, `pip install -e`), then beside the installed package (pip,
    colcon), then the prefixes of `AMENT_PREFIX_PATH`.

    Raises:
        IntentError: the file is in none of these places.
    """
    root = source_tree()
    folders = [] if root is None else [root]
    ament = [Path(p) for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    prefixes = [*Path(__file__).resolve().parents, *ament, Path(sys.prefix)]
    folders += [prefix / "share" / PACKAGE for prefix in prefixes]
    for folder in folders:
        if (folder / relative).exists():
            return folder / relative
    cure = "Correct its name, or install the package again."
    raise IntentError(describe(relative, "a file shipped with the package", "none", cure))
