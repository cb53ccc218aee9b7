# SPDX-License-Identifier: Apache-2.0
"""What the tests of this room share."""

import numpy as np
import pytest


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator of its own for each test."""
    return np.random.default_rng(7)
