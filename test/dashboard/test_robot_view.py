# SPDX-License-Identifier: Apache-2.0
"""Where the drawn robot and hand path are, beside yourdfpy's own forward kinematics."""

import io

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

yourdfpy = pytest.importorskip("yourdfpy")
pytest.importorskip("viser")

from intent_recognition.dashboard.robot_view import chain_of, joint_values, load_urdf  # noqa: E402
from intent_recognition.kinematics.links import joint_poses  # noqa: E402
from sim_bridge.arm import describe_robot  # noqa: E402

FINGERS = """<robot name="fingers">
  <link name="base"/><link name="rail"/><link name="left"/><link name="tip"/><link name="right"/>
  <joint name="along" type="prismatic"><parent link="base"/><child link="rail"/>
    <origin xyz="0.1 0 0.2" rpy="0 0.3 0"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="open" type="revolute"><parent link="rail"/><child link="left"/>
    <origin xyz="0 0 0.1" rpy="0.5 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="bend" type="revolute"><parent link="left"/><child link="tip"/>
    <origin xyz="0 0.2 0"/><axis xyz="1 0 0"/><mimic joint="open" multiplier="-0.5" offset="0.1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="held" type="fixed"><parent link="rail"/><child link="right"/></joint>
</robot>"""


@pytest.mark.parametrize("description", [describe_robot(), FINGERS], ids=["lwr", "fingers"])
def test_each_joint_is_where_yourdfpy_has_it(description):
    urdf = yourdfpy.URDF.load(io.StringIO(description), load_meshes=False)
    names, joints = urdf.actuated_joint_names, tuple(urdf.joint_map.values())
    q = np.random.default_rng(4).uniform(-0.8, 0.8, size=len(names))
    wxyz, positions = joint_poses(chain_of(joints), joint_values(joints, names, q[None])[0])
    urdf.update_cfg(q)
    for joint, turn, position in zip(joints, wxyz, positions, strict=True):
        expected = urdf.get_transform(joint.child, joint.parent)
        turned = Rotation.from_quat(np.roll(turn, -1)).as_matrix()
        np.testing.assert_allclose(turned, expected[:3, :3], atol=1e-9)
        np.testing.assert_allclose(position, expected[:3, 3], atol=1e-9)


def test_what_has_a_colour_is_not_taken_for_metal():
    """That would be black without the light of an environment; the colour stays."""
    description = describe_robot()
    before = yourdfpy.URDF.load(io.StringIO(description)).scene.geometry
    for name, shape in load_urdf(description).scene.geometry.items():
        material = shape.visual.material
        assert material.metallicFactor == 0.0
        np.testing.assert_array_equal(material.main_color, before[name].visual.main_color)
