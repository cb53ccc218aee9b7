# SPDX-License-Identifier: Apache-2.0
"""Writes the pages that come from the code: `python docs/tools/write_reference.py [FOLDER]`."""

import os
import sys
from pathlib import Path

TOOLS = Path(__file__).resolve().parent
REFERENCE = Path(sys.argv[1]) if len(sys.argv) > 1 else TOOLS.parent / "reference"
sys.path.insert(0, str(TOOLS))
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)


def main() -> None:
    """Write all of them."""
    from commands_page import commands_page
    from launch_page import launch_page
    from nodes_page import nodes_page

    for page in (commands_page, launch_page, nodes_page):
        name = page.__name__.removesuffix("_page")
        (REFERENCE / f"{name}.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
