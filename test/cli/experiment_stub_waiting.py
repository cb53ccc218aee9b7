# SPDX-License-Identifier: Apache-2.0
"""An experiment without an end."""

import threading


def run(settings):
    """Say so, and wait."""
    settings.progress(0.5, "waiting")
    threading.Event().wait()
