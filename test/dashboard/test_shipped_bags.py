# SPDX-License-Identifier: Apache-2.0
"""The recordings that the page offers unless it is given a folder."""

from intent_recognition.dashboard.node import shipped_bags
from intent_recognition.demonstrations import find_bags
from intent_recognition.share import share_path


def test_those_of_the_demo_that_were_not_learned_come_first():
    bags, tests = shipped_bags(), find_bags(share_path("bags/toolbox/test"))
    assert bags[: len(tests)] == tests
    assert sorted(bags) == sorted(find_bags(share_path("bags")))
