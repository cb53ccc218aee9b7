# SPDX-License-Identifier: Apache-2.0
"""Start the page, or report what is missing for it."""

import sys
from collections.abc import Sequence

import intent_recognition.nodes  # noqa: F401  before all else: quiet while importing


def main(args: Sequence[str] | None = None) -> int:
    """Run the page; 1 with one line on stderr where its libraries are not installed."""
    try:
        from intent_recognition.dashboard.node import Dashboard
    except ImportError as error:
        if error.name not in ("viser", "yourdfpy"):
            raise
        sys.stderr.write(
            f"dashboard: {error.name}: expected an installed library, got none."
            " Install it with `pip install viser yourdfpy`.\n"
        )
        return 1
    from intent_recognition.nodes.runtime import run

    return run(Dashboard, args)
