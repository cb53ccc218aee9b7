# SPDX-License-Identifier: Apache-2.0
"""The picture of docs/tutorials/cell.md: `python docs/images/cell.py` renders both arms."""

from pathlib import Path

import numpy as np
from PIL import Image
from scene import Camera

from intent_recognition.cli.demo_scene import CELL_BOXES
from intent_recognition.kinematics import Arm, parse_boxes
from sim_bridge.arm import SimulatedArm, Surroundings, find_robot
from sim_bridge.coworker import PLATE
from sim_bridge.handover import HandedThing, in_grip, with_fingers
from sim_bridge.scenarios.toolbox import HOME, HOME_HAND_M, ToolboxArm
from sim_bridge.scenarios.toolbox.transfers import THINGS

WAY_M = np.linspace(HOME_HAND_M, (0.64, -0.13, 0.33), 20)
"""Of the hand, to between the boxes."""
SHOWN = slice(150, 950), slice(100, 1100)
"""Rows and columns of the picture."""
N_COLOURS = 128


def render(name: str) -> np.ndarray:
    """An arm between the boxes, with a plate (HEIGHT, WIDTH, 3) in [0, 1]."""
    robot = with_fingers(find_robot(name))
    home = HOME if name == "lwr" else ToolboxArm(robot).home
    chain = Arm.from_urdf(robot.description, base="world", tip=robot.tip, rest=home)
    arm = SimulatedArm(chain.follow(WAY_M, home, home).positions[-1], robot=robot)
    try:
        Surroundings(arm, parse_boxes(CELL_BOXES))
        pose = arm.hand_pose()
        what = THINGS[PLATE]
        HandedThing(arm.client, what, *in_grip(what, pose.position, pose.orientation))
        return Camera().render(arm.client)[SHOWN]
    finally:
        arm.close()


def main() -> None:
    """Write cell.png."""
    both = np.concatenate([render("lwr"), render("panda")], axis=1)
    image = Image.fromarray(np.round(255 * both).astype(np.uint8)).resize((1200, 480))
    image.quantize(N_COLOURS).save(Path(__file__).with_name("cell.png"), optimize=True)


if __name__ == "__main__":
    main()
