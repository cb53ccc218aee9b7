# SPDX-License-Identifier: Apache-2.0
"""The process that runs commands on hostile files."""

import pytest
from hostile.strangers import Worker


@pytest.fixture(scope="session")
def worker():
    worker = Worker()
    yield worker
    worker.close()
