# SPDX-License-Identifier: Apache-2.0
"""Boxes and fixtures about the arm stop it, and PyBullet keeps its own lines to itself."""

import subprocess
import sys

import pytest
from kinematics.robots import lwr_urdf

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import Box, hand_position
from sim_bridge.arm import NAMES, SimulatedArm, Surroundings, find_robot
from sim_bridge.arm.urdf_loading import fixtures_of

READY = find_robot("lwr").ready
GOAL = READY + [0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
WAY_S = 1.0
PLACE = hand_position(READY + 0.7 * (GOAL - READY))
CRATE = Box("crate", tuple(PLACE), (0.1, 0.04, 0.4))
TABLE = """
  <link name="table"><collision><origin xyz="{}"/><geometry><box size="0.1 0.04 0.4"/></geometry>
  </collision></link>
  <joint name="table_joint" type="fixed"><parent link="lwr_base_link"/><child link="table"/></joint>
</robot>"""


def swing(arm, steps=1500):
    """Turn the first joint, with the hand through PLACE."""

    def follow(arm):
        share = min(arm.time_s / WAY_S, 1.0)
        arm.set_reference(READY + share * (GOAL - READY))

    arm.before_step.append(follow)
    arm.step(steps)
    return arm.hand_pose().position


def side_of_crate(hand):
    """Negative before the crate, in the direction of the swing."""
    return hand[1] - PLACE[1]


def test_a_crate_stops_the_arm_and_the_touch_counts_but_not_beside_it():
    with SimulatedArm(READY) as arm:
        surroundings = Surroundings(arm, [CRATE])
        assert side_of_crate(swing(arm)) < 0.0
        assert surroundings.touches == 1  # it leans on it
        assert surroundings.last[0] in ("lwr_a6_link", "lwr_a7_link")
        assert surroundings.last[1] == "crate" and surroundings.touching() == surroundings.last
    with SimulatedArm(READY) as arm:
        surroundings = Surroundings(arm, [CRATE._replace(center=(0.0, -0.8, 0.5))])
        assert side_of_crate(swing(arm)) > 0.02
        assert surroundings.touches == 0 and surroundings.touching() is None


@pytest.mark.parametrize("overlaps", [False, True])
def test_what_the_urdf_fixes_to_its_root_stops_all_links_but_those_it_overlaps(overlaps, tmp_path):
    table = TABLE.format(" ".join(map(str, PLACE)))
    if overlaps:
        box = table[table.index("<collision>") : table.index("</link>")]
        elbow = box.replace(" ".join(map(str, PLACE)), "0.17 0 0.67")
        table = table.replace("<collision>", f"{elbow}<collision>", 1)
    (tmp_path / "cell.urdf").write_text(lwr_urdf().replace("</robot>", table))
    robot = find_robot(str(tmp_path / "cell.urdf"), tip="lwr_hand")
    with SimulatedArm(READY, robot=robot) as arm:
        surroundings = Surroundings(arm, [])
        assert -0.1 < side_of_crate(swing(arm)) < 0.0  # the elbow is free, the hand is stopped
        assert surroundings.touches >= 1 and surroundings.last[1] == "table"


def test_fixtures_are_found_in_a_default_namespace_and_broken_xml_is_refused():
    text = lwr_urdf().replace("</robot>", TABLE.format("0 0 0"))
    assert fixtures_of(text) == {"table"}
    assert fixtures_of(text.replace("<robot", "<robot xmlns='http://a.b/c'", 1)) == {"table"}
    with pytest.raises(ArgumentError, match="expected a URDF, got broken XML"):
        fixtures_of("<robot")


@pytest.mark.parametrize("name", NAMES)
def test_an_arm_alone_has_no_fixtures(name):
    assert fixtures_of(find_robot(name).urdf) == frozenset()


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
