# SPDX-License-Identifier: Apache-2.0
"""Finding the shipped files (config, bags) wherever the package was installed from."""

import os
import sys
from collections.abc import Mapping
from pathlib import Path

from intent_recognition.errors import IntentError, describe

PACKAGE = "intent_recognition"
FAST_DISCOVERY = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")


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


def node_environment(
    base: Mapping[str, str], domain_id: int | None = None, *, localhost: bool = True
) -> dict[str, str]:
    """Environment for node processes that find one another quickly.

    What is set in `base` already is kept, but the domain if one is given.

    Args:
        base: the environment to start from, `os.environ` as a rule.
        domain_id: ROS_DOMAIN_ID, or None to keep that of `base`.
        localhost: True if the nodes are to see no other machine.
    """
    environment = dict(base)
    environment.setdefault("AMENT_PREFIX_PATH", sys.prefix)
    for name in FAST_DISCOVERY:
        environment.setdefault(name, str(share_path("config/fastdds.xml")))
    if localhost:
        environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    if domain_id is not None:
        environment["ROS_DOMAIN_ID"] = str(domain_id)
    return environment
