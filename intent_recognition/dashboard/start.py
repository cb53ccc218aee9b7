# SPDX-License-Identifier: Apache-2.0
"""Start the page, or report what is missing for it."""

from collections.abc import Sequence

from intent_recognition.nodes.start import explained, tell_missing


def main(args: Sequence[str] | None = None) -> int:
    """Run the page; 1 with one line on stderr where its libraries, or ROS 2, are not installed."""
    try:
        from intent_recognition.dashboard.node import Dashboard
    except ImportError as error:
        tell_missing("dashboard", error)
        return 1
    from intent_recognition.dashboard import node
    from intent_recognition.nodes.runtime import run

    if explained("dashboard", node.__doc__ or "", args):
        return 0

    return run(Dashboard, args)
