# SPDX-License-Identifier: Apache-2.0
"""The process that runs commands on hostile files."""

import pytest
from hostile.strangers import Worker


@pytest.fixture(scope="session")
def worker():
    worker = Worker()
    yield worker
    worker.close()


@pytest.fixture(scope="session")
def whole(repository):
    """A shipped bag, as bytes and metadata."""
    path = next(iter(sorted((repository / "bags/toolbox/train").iterdir())))
    mcap = next(path.glob("*.mcap"))
    return mcap.name, mcap.read_bytes(), (path / "metadata.yaml").read_text()


@pytest.fixture(scope="session")
def learned(worker, repository, tmp_path_factory):
    """A model with its statistics, of a few recordings."""
    path = tmp_path_factory.mktemp("learned") / "m.npz"
    found = sorted((repository / "bags/toolbox/train").iterdir())
    few = [folder for folder in found if folder.name.endswith(("_00", "_01", "_02"))]
    assert worker.run("train", *few, "--basis", 8, "--output", path)["code"] == 0
    return path
