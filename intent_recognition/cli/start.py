# SPDX-License-Identifier: Apache-2.0
"""What the executable `intent` calls: it is quiet before it imports the commands."""

from intent_recognition.interrupts import end_command_at_interrupt


def intent() -> int:
    """Run one command; returns its exit code."""
    end_command_at_interrupt()
    from intent_recognition.cli.main import main

    return main()
