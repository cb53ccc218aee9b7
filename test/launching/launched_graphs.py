# SPDX-License-Identifier: Apache-2.0
"""For launch_testing: each launch file brings its nodes up, and all end with 0 on an interrupt.

`test_launch_files.py` beside it runs this file, with a model in INTENT_MODEL and a bag in
INTENT_BAG.
"""

import os
import unittest

import launch_testing
import launch_testing.actions
import launch_testing.asserts
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

from intent_recognition.nodes.graph import resolve
from intent_recognition.share import share_path

READY_S = 90.0
MODEL = {"model": os.environ.get("INTENT_MODEL", "")}
GIVEN = {
    "assembly": MODEL,
    "demo": MODEL,
    "intent": MODEL,
    "pouring": {},
    "real": {**MODEL, "activate": "true"},
    "replay": {**MODEL, "bag": os.environ.get("INTENT_BAG", "")},
    "sim": {},
}
"""Arguments of each launch file."""


@launch_testing.parametrize("graph", sorted(GIVEN))
def generate_test_description(graph):
    """The launch file, and the tests as soon as it is included."""
    source = PythonLaunchDescriptionSource(str(share_path(f"launch/{graph}.launch.py")))
    included = IncludeLaunchDescription(source, launch_arguments=GIVEN[graph].items())
    return LaunchDescription([included, launch_testing.actions.ReadyToTest()])


class TestWhileItRuns(unittest.TestCase):
    """Of the nodes of this package; others log what they like."""

    def test_every_node_is_ready(self, proc_output, graph):
        """Each logs `ready` under its name."""
        for call in resolve(graph, GIVEN[graph]):
            if call.module:
                proc_output.assertWaitFor(f"[{call.name}]: ready", timeout=READY_S, stream="stderr")


@launch_testing.post_shutdown_test()
class TestAfterShutdown(unittest.TestCase):
    """Of all processes."""

    def test_all_ended_with_0(self, proc_info):
        """An interrupt ends each node well."""
        launch_testing.asserts.assertExitCodes(proc_info)
