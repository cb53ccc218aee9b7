# SPDX-License-Identifier: Apache-2.0
"""An experiment that finds no recordings."""

from intent_recognition.errors import BagError


def run(settings):
    """Break off."""
    raise BagError("no recordings in stub")
