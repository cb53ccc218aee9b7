# SPDX-License-Identifier: Apache-2.0
"""PyBullet's own lines about its build and its threads stay away from users and from JSON."""

import subprocess
import sys

import pytest

WORLDS = """
from sim_bridge.arm import SimulatedArm, find_robot
from sim_bridge.physics import end_world, start_world
with SimulatedArm(find_robot("lwr").ready):
    client = start_world()
end_world(client)
end_world(client)
print("ours")
"""


@pytest.mark.slow
def test_a_process_with_physics_writes_only_what_it_has_to_say(repository):
    command = [sys.executable, "-c", WORLDS]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=repository)
    assert (done.stdout, done.stderr) == ("ours\n", "")
