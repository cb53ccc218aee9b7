# SPDX-License-Identifier: Apache-2.0
"""What the processes of `pytest -n` leave behind."""

import os
import signal
import subprocess
from types import SimpleNamespace

import pytest

pytest.importorskip("xdist")

DIED, ANOTHER = "gw98", "gw99"
RUN = "the run of this test"
DEADLINE_S = 60.0


@pytest.fixture
def started():
    """A process of each worker."""
    processes = {
        worker: subprocess.Popen(
            ["sleep", "600"],
            env=os.environ | {"PYTEST_XDIST_TESTRUNUID": RUN, "PYTEST_XDIST_WORKER": worker},
        )
        for worker in (DIED, ANOTHER)
    }
    yield processes
    for process in processes.values():
        process.kill()
        process.wait()


@pytest.mark.parametrize(
    ("error", "ended"), [(None, set()), ("Not properly terminated", {DIED})], ids=["well", "died"]
)
def test_what_a_worker_had_started_ends_if_it_died(error, ended, started, request, repository):
    conftest = request.config.pluginmanager.get_plugin(str(repository / "test/conftest.py"))
    gateway = SimpleNamespace(id=DIED)
    node = SimpleNamespace(gateway=gateway, workerinput={"testrunuid": RUN})
    conftest.pytest_testnodedown(node, error)
    for worker in ended:
        assert started[worker].wait(DEADLINE_S) == -signal.SIGKILL
    assert all(started[worker].poll() is None for worker in started.keys() - ended)
