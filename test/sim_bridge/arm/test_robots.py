# SPDX-License-Identifier: Apache-2.0
"""Four arms and a user's: loaded, held, followed, guided and kept inside their limits."""

import xml.etree.ElementTree as ET
from functools import cache

import numpy as np
import pytest
from kinematics.trees import INERTIAL, row, urdf

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import Arm
from sim_bridge.arm import NAMES, SimulatedArm, find_robot
from sim_bridge.arm.urdf import add_rotors, find_meshes

ONE = """<robot name="one">
<link name="base"/>
<link name="arm"><inertial><origin rpy="0 0 1.5707963267948966"/><mass value="2"/>
  <inertia ixx="0.3" iyy="0.2" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="1 0 0"/>
  <limit lower="-1" upper="2" velocity="1" effort="50"/></joint></robot>"""
MESH = '<mesh filename="package://x/y.stl"/>'


@cache
def robot_of(name):
    return find_robot(name)


@pytest.fixture(scope="module", params=NAMES)
def loaded(request):
    with SimulatedArm(robot=robot_of(request.param)) as made:
        yield made


@pytest.fixture
def arm(loaded):
    loaded.set_gravity_compensation(False)
    loaded.set_payload(0.0)
    loaded.reset()
    return loaded


def test_the_hand_is_where_its_urdf_says(arm):
    """PyBullet beside pinocchio, in the world, with the base where it stands."""
    robot = arm.robot
    chain = Arm.from_urdf(robot.description, base="world", tip=robot.tip)
    assert chain.joint_names == robot.joint_names
    assert chain.limits.upper.tolist() == robot.limits.upper.tolist()
    rng = np.random.default_rng(0)
    for _ in range(3):
        q = robot.ready + rng.uniform(-0.15, 0.15, robot.n_joints)
        arm.reset(np.clip(q, robot.limits.lower, robot.limits.upper))
        q = arm.state().q
        np.testing.assert_allclose(
            chain.forward_kinematics(q)[:3, 3], arm.hand_pose().position, atol=1e-6
        )


def test_it_holds_still_with_its_fingers_and_floats_in_gravity_compensation(arm):
    panda = arm.robot is robot_of("panda")
    assert arm.others.names == ("panda_finger_joint1", "panda_finger_joint2") * panda
    np.testing.assert_allclose(arm.others.positions(), [0.04, 0.04] * panda, atol=1e-6)
    arm.step(500)
    np.testing.assert_allclose(arm.others.positions(), [0.04, 0.04] * panda, atol=2e-3)
    np.testing.assert_allclose(arm.state().q, arm.robot.ready, atol=1e-3)
    arm.step(500)
    np.testing.assert_allclose(arm.state().q, arm.robot.ready, atol=1e-9)
    arm.set_gravity_compensation(True)
    arm.step(500)
    np.testing.assert_allclose(arm.state().q, arm.robot.ready, atol=1e-9)


def test_it_follows_and_carries_a_payload(arm):
    start = arm.state().q
    for k in range(1000):
        angle = 2.0 * k * 1e-3
        arm.set_reference(
            start + 0.2 * (1 - np.cos(angle)),
            np.full(len(start), 0.4 * np.sin(angle)),
            np.full(len(start), 0.8 * np.cos(angle)),
        )
        arm.step()
    assert np.abs(arm.state().q - arm.reference.position).max() < 2e-3
    assert arm.saturated_steps == 0
    before, centre_m = arm.state().torque, np.array([0.1, 0.0, 0.2])
    arm.set_payload(1.0, tuple(centre_m))
    arm.step()
    model, q = Arm.from_urdf(arm.robot.urdf, tip=arm.robot.tip), arm.state().q
    jacobian, lever = model.jacobian(q), model.forward_kinematics(q)[:3, :3] @ centre_m
    lift = 9.81 * (jacobian[2] + np.cross(jacobian[3:].T, lever)[:, 2])
    np.testing.assert_allclose(arm.state().torque - before, lift, atol=0.1)


def test_a_push_does_not_take_it_beyond_its_limits(arm):
    arm.set_gravity_compensation(True)
    for _ in range(1500):
        arm.apply_force(np.array([10.0, -20.0, -20.0]))
        arm.step()
    q, limits = arm.state().q, arm.robot.limits
    assert np.all((q > limits.lower - 0.06) & (q < limits.upper + 0.06))


def test_a_description_begins_at_the_world_and_finds_its_meshes(arm):
    root = ET.fromstring(arm.robot.description)
    children = {joint.find("child").get("link") for joint in root.findall("joint")}
    (first,) = [link for link in root.findall("link") if link.get("name") not in children]
    assert first.get("name") == "world" and first.find("inertial") is None
    assert all(mesh.get("filename").startswith("file:///") for mesh in root.iter("mesh"))


def test_a_users_urdf_by_path_and_an_arm_elsewhere(tmp_path):
    path = tmp_path / "one.urdf"
    path.write_text(ONE)
    robot = find_robot(str(path))
    assert (robot.name, robot.tip, robot.joint_names) == ("one", "arm", ("turn",))
    np.testing.assert_allclose(robot.ready, [0.5])
    with SimulatedArm(robot=robot) as arm:
        arm.step(100)
        np.testing.assert_allclose(arm.state().q, [0.5], atol=1e-9)
    robot = find_robot("panda", tip="panda_link8", base_position_m=[0.1, 0.2, 0.3])
    plain = find_robot("panda", tip="panda_link8")
    with SimulatedArm(robot=robot) as moved, SimulatedArm(robot=plain) as arm:
        shift = moved.hand_pose().position - arm.hand_pose().position
    np.testing.assert_allclose(shift, [0.1, 0.2, 0.3], atol=1e-6)
    lwr = find_robot("lwr", base_position_m=[0.0, 0.0, 0.5])
    np.testing.assert_array_equal(lwr.ready, find_robot("lwr").ready)


def test_links_without_inertia_get_a_usual_one_and_frames_weigh_nothing(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(ONE.replace("inertial>", "i>"))
    robot = find_robot(str(path))
    assert robot.weighed == ("arm",) and "arm: the URDF has no mass or inertia" in robot.note
    with SimulatedArm(robot=robot) as arm:
        arm.step(100)
        np.testing.assert_allclose(arm.state().q, [0.5], atol=1e-9)
    path.write_text(robot.source)
    assert not find_robot(str(path)).weighed
    frame = '<joint name="at" type="fixed"><parent link="arm"/><child link="tool0"/></joint>'
    path.write_text(ONE.replace("</robot>", f'<link name="tool0"/>{frame}</robot>'))
    robot = find_robot(str(path))
    assert robot.tip == "tool0" and not robot.weighed
    with SimulatedArm(robot=robot) as arm:
        assert arm.client.getDynamicsInfo(arm.body, arm.hand_link)[0] == 0.0


def test_rotors_turn_about_the_axis_of_their_joint():
    """The joint's x axis is -y of the inertial frame, which is turned by 90 degrees."""
    root, rotor = ET.fromstring(ONE), 0.05
    add_rotors(root, {"turn": rotor})
    found = root.find("link/inertial/inertia")
    moments = [float(found.get(key)) for key in ("ixx", "iyy", "izz")]
    np.testing.assert_allclose(moments, [0.3 + rotor / 2, 0.2 + rotor, 0.1 + rotor / 2])
    products = [float(found.get(key)) for key in ("ixy", "ixz", "iyz")]
    np.testing.assert_allclose(products, 0.0, atol=1e-15)


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        ("pandas", "robot: expected one of lwr, panda, iiwa.* got pandas, .*Did you mean panda"),
        ("no\n", "robot: expected a URDF, got .*robot.urdf: another kind of file"),
        (ONE.replace('"revolute">', '"revolute"><mimic joint="turn"/>'), "mimic"),
        (ONE[:80], "broken XML.*xacro"),
    ],
)
def test_what_cannot_be_used_is_named(robot, message, tmp_path):
    path = robot
    if "\n" in robot:
        path = tmp_path / "robot.urdf"
        path.write_text(robot)
    with pytest.raises(ArgumentError, match=message):
        find_robot(str(path))


def test_meshes_of_installed_packages_and_of_a_clone_are_found(tmp_path, monkeypatch):
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path / 'install'}")
    (tmp_path / "a_clone").mkdir()
    (tmp_path / "a_clone/package.xml").write_text("<package><name>arm</name></package>")
    for name, place, folder in (
        ("arm_description/link.stl", "install/share/arm_description", "elsewhere"),
        ("arm/meshes/link.stl", "a_clone/meshes", "a_clone/urdf"),
        ("a_clone/meshes/link.stl", "a_clone/meshes", "a_clone/robots/arm/urdf"),
    ):
        mesh = tmp_path / place / "link.stl"
        mesh.parent.mkdir(parents=True, exist_ok=True)
        mesh.write_text("solid")
        shape = f'<visual><mesh filename="package://{name}"/></visual>'
        root = ET.fromstring(f"<robot><link>{shape}</link></robot>")
        assert find_meshes(root, tmp_path / folder) == ()
        assert root.find(".//mesh").get("filename") == str(mesh)


def test_links_too_heavy_for_physics_are_refused(tmp_path):
    """As a robot of a ton has: PyBullet wants the inertias it turns symmetric to 5e-15."""
    heavy = INERTIAL.replace("0.5", "710").replace('ixy="0" ixz="0"', 'ixy="-5e4" ixz="-2e5"')
    heavy = heavy.replace("0.002", "5e5").replace(">", '><origin xyz="0.188 0.183 -0.043"/>', 1)
    path = tmp_path / "robot.urdf"
    path.write_text(urdf((row("base", "", 3),)).replace(INERTIAL, heavy))
    with pytest.raises(ArgumentError, match="got too heavy ones"):
        SimulatedArm(robot=find_robot(str(path)))


@pytest.mark.parametrize("name", ["package://x/y.stl", "y.glb"])
def test_shapes_whose_mesh_cannot_be_used_are_left_out_and_named(name, tmp_path):
    path = tmp_path / "robot.urdf"
    (tmp_path / "y.glb").write_text("glTF")
    shape = f"<visual>{2 * MESH.replace('package://x/y.stl', name)}</visual>"
    path.write_text(ONE.replace("<inertial>", f"{shape}<inertial>"))
    robot = find_robot(str(path))
    assert f"{name}: left out, as no file of .dae, .obj, .stl is found" in robot.note
    assert name not in robot.source + robot.description
    with SimulatedArm(robot=robot) as arm:
        arm.step(1)
