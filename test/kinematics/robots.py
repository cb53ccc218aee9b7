# SPDX-License-Identifier: Apache-2.0
"""Arms that the tests know: ours, and those that come with PyBullet's data."""

from pathlib import Path

import pybullet_data

from intent_recognition.share import share_path


def lwr_urdf():
    return share_path("config/robots/lwr.urdf").read_text()


DATA = Path(pybullet_data.getDataPath())
ROBOTS = {
    "lwr": lwr_urdf(),
    "panda": DATA / "franka_panda/panda.urdf",
    "iiwa": DATA / "kuka_iiwa/model.urdf",
    "xarm": DATA / "xarm/xarm6_robot.urdf",
}
"""Name to a URDF's path or text."""
