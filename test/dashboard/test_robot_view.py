# SPDX-License-Identifier: Apache-2.0
"""The robot is drawn in greys, so that colours are left for tasks."""

from intent_recognition.dashboard.robot_view import greyed
from sim_bridge.urdf import lwr_urdf


def test_materials_become_grey_and_keep_their_opacity():
    text = greyed('<color rgba="1 0.5 0 0.7"/>')
    red, green, blue, opacity = text.split('"')[1].split()
    assert red == green == blue
    assert float(opacity) == 0.7
    assert greyed('<color rgba="1 x 0"/>') == '<color rgba="1 x 0"/>'


def test_nothing_but_the_materials_changes():
    before, after = lwr_urdf(), greyed(lwr_urdf())
    assert before.count("<joint") == after.count("<joint")
    assert before.split("rgba")[0] == after.split("rgba")[0]
