# SPDX-License-Identifier: Apache-2.0
"""What tests of parts of the page have in common."""

import pytest
import viser
from dashboard.browser import free_port


@pytest.fixture
def server():
    """An empty page."""
    made = viser.ViserServer(host="127.0.0.1", port=free_port(), verbose=False)
    yield made
    made.stop()
