# SPDX-License-Identifier: Apache-2.0
"""The library in the context of a recording."""

from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration


def in_context(library: TaskLibrary, recorded: Demonstration) -> TaskLibrary:
    """The library in the context in which a recording began; as it is where none was recorded."""
    return library.given(recorded.context_values) if recorded.context else library
