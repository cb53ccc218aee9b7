# SPDX-License-Identifier: Apache-2.0
"""The files for ros2_control fit the arms that they are for."""

from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from intent_recognition.kinematics import Arm


@pytest.mark.parametrize("arm", ["lwr", "panda"])
def test_hardware_and_controllers_are_of_the_arms_joints(repository, arm):
    from sim_bridge.arm import find_robot

    folder = repository / "config" / "ros2_control"
    hardware = (folder / f"{arm}.ros2_control.xml").read_text(encoding="utf-8")
    described = find_robot(arm).description.replace("</robot>", f"{hardware}</robot>")
    joints = ElementTree.fromstring(described).findall("ros2_control/joint")
    names = tuple(joint.get("name") for joint in joints)
    chain = Arm.from_urdf(described)
    assert names == chain.joint_names
    starts = [float(joint.find("state_interface/param").text) for joint in joints]
    assert np.all((starts > chain.limits.lower) & (starts < chain.limits.upper))
    text = (folder / f"{arm}_controllers.yaml").read_text(encoding="utf-8")
    controller = yaml.safe_load(text)["/**/joint_trajectory_controller"]["ros__parameters"]
    assert tuple(controller["joints"]) == names
    assert set(names) <= set(controller["constraints"])
