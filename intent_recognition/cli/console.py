# SPDX-License-Identifier: Apache-2.0
"""The console all commands print to."""

import sys

from rich.console import Console

WIDTH_OF_A_PIPE = 140
"""Columns where the output is no terminal, so that tables are not cut off."""


def make_console() -> Console:
    """A console as wide as the terminal, or wide enough for every table."""
    return Console(width=None if sys.stdout.isatty() else WIDTH_OF_A_PIPE)
