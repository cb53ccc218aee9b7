# SPDX-License-Identifier: Apache-2.0
"""Entry point of the executable `intent`; handles Ctrl-C before it imports the commands."""

from intent_recognition.interrupts import end_command_at_interrupt


def intent() -> int:
    """Run one command; return its exit code."""
    end_command_at_interrupt()
    from intent_recognition.cli.main import main

    return main()
