# SPDX-License-Identifier: Apache-2.0
"""What simulated humans do, and what is learned from recordings of it."""

import pytest
from online_stream import humans, learned

from intent_recognition.promp import TaskLibrary


@pytest.fixture(scope="session")
def truth() -> TaskLibrary:
    """What the simulated humans do."""
    return humans()


@pytest.fixture(scope="session")
def library(truth) -> TaskLibrary:
    """Learned from recordings, cut where the online detector would cut them."""
    return learned(truth)
