# SPDX-License-Identifier: Apache-2.0
"""The first map of a file: bodies, their places and orientations."""

import numpy as np
import pytest
import yaml
from bag_builder import JOINTS, START_NS
from tables.imports import suggested, suggested_csv
from tables.odd_files import PLACE, ROWS, SHARE, TIMES_S, cells, csv_of, table

from intent_recognition.bags import POSE, BagReader, BagWriter
from intent_recognition.demonstrations import extract
from intent_recognition.tables import suggest_map
from intent_recognition.tables.import_map import ImportMap

PATH, TF = "nav_msgs/msg/Path", "tf2_msgs/msg/TFMessage"


ONE = {
    "geometry_msgs/msg/TransformStamped": "transform.translation",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose.position",
    "nav_msgs/msg/Odometry": "pose.pose.position",
    "geometry_msgs/msg/PointStamped": "point",
    "geometry_msgs/msg/Pose": "position",
    "geometry_msgs/msg/Point": "",
    "visualization_msgs/msg/Marker": "pose.position",
    "lab_msgs/msg/Hand": "palm_center",
}
ARRAYS = {
    "geometry_msgs/msg/PoseArray": ("poses", "position", ""),
    "tf2_msgs/msg/TFMessage": ("transforms", "transform.translation", "child_frame_id"),
    "visualization_msgs/msg/MarkerArray": ("markers", "pose.position", "id"),
    "lab_msgs/msg/Bodies": ("bodies", "pose.position", "rigid_body_name"),
    "lab_msgs/msg/Marks": ("bodies", "", "marker_id"),
    "lab_msgs/msg/Markers": ("markers", "translation", "marker_index"),
}
"""By type: the array, the path to a position in each element, and what names the element."""
LAB = {
    "lab_msgs/msg/Body": "string rigid_body_name\ngeometry_msgs/Pose pose\n",
    "lab_msgs/msg/Bodies": "std_msgs/Header header\nlab_msgs/Body[] bodies\n",
    "lab_msgs/msg/Mark": "int32 marker_id\nfloat64 x\nfloat64 y\nfloat64 z\n",
    "lab_msgs/msg/Marks": "std_msgs/Header header\nlab_msgs/Mark[] bodies\n",
    "lab_msgs/msg/Marker": "string name\nint32 marker_index\ngeometry_msgs/Point translation\n",
    "lab_msgs/msg/Markers": "std_msgs/Header header\nlab_msgs/Marker[] markers\n",
    "lab_msgs/msg/Person": "string name\nlab_msgs/Marker[] joints\n",
    "lab_msgs/msg/People": "std_msgs/Header header\nlab_msgs/Person[] people\n",
    "lab_msgs/msg/Hand": "bool seen\ngeometry_msgs/Point palm_center\n",
}


@pytest.fixture
def _lab_msgs(tmp_path, monkeypatch):
    """An installed package of messages that are not ROS's."""
    folder = tmp_path / "share/lab_msgs/msg"
    folder.mkdir(parents=True)
    for name, text in LAB.items():
        (folder / f"{name.rpartition('/')[2]}.msg").write_text(text)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path), prepend=":")


@pytest.mark.usefixtures("_lab_msgs")
@pytest.mark.parametrize("kind", [*ARRAYS, *ONE])
def test_bodies_in_any_message_that_holds_their_places_are_suggested(kind, tmp_path):
    array, path, key = ARRAYS.get(kind) or ("", ONE[kind], "")

    def body(n, k):
        found: dict = {"x": float(k), "y": 2.0, "z": float(n)}
        for part in reversed(path.split(".") if path else ()):
            found = {part: found}
        return found | (
            {key: n if key.endswith(("id", "index")) and "frame" not in key else str(n)}
            if key
            else {}
        )

    count = 2 if array else 1
    with BagWriter(tmp_path / "bags/give_00", flush_period_s=None) as writer:
        for k in range(5):
            states = {"header": {"stamp": START_NS + k}, "name": ["q"], "position": [k / 10]}
            writer.write_message("/q", JOINTS, states, START_NS + k)
            there = [body(n, k) for n in range(count)][:: -1 if k % 2 and key else 1]
            content = {array: there} if array else there[0]  # in any order
            writer.write_message("/bodies", kind, content, START_NS + k)
            writer.write_message("/path", PATH, {"poses": [{}] * k}, START_NS + k)
    mapping = ImportMap.from_dict(yaml.safe_load(suggest_map(tmp_path / "bags")))
    *places, arm = (*mapping.dofs.observed, *mapping.dofs.controlled)
    assert arm.joints == ("q",) and {place.type for place in places} == {kind}
    for k, one in enumerate(BagReader(tmp_path / "bags/give_00").messages(["/bodies"])):
        found = [extract(place, one.message).tolist() for place in places]
        assert found == [[k, 2.0, n] for n in range(count)]


@pytest.mark.usefixtures("_lab_msgs")
def test_the_joints_of_each_person_in_nested_arrays_are_suggested(tmp_path):
    def person(name, k):
        places = [{"x": k / 10, "y": 1.0}, {"y": k / 5}]
        joints = [{"name": n, "translation": at} for n, at in zip(("hand", "foot"), places)]
        return {"name": name, "joints": joints[:: -1 if k % 2 else 1]}

    with BagWriter(tmp_path / "give_00", flush_period_s=None) as writer:
        for k in range(5):
            people = [person(name, k) for name in ("ann", "ben")][:: -1 if k % 2 else 1]
            content = {"header": {"stamp": START_NS + k}, "people": people}
            writer.write_message("/people", "lab_msgs/msg/People", content, START_NS + k)
    mapping = ImportMap.from_dict(yaml.safe_load(suggest_map(tmp_path)))
    entries = (*mapping.dofs.observed, *mapping.dofs.controlled)
    assert entries[0].fields[0] == "people[name=ann].joints[name=hand].translation.x"
    for k, one in enumerate(BagReader(tmp_path / "give_00").messages(["/people"])):
        found = [extract(entry, one.message).tolist() for entry in entries]
        assert found == [[k / 10, 1.0, 0.0], [0.0, k / 5, 0.0]] * 2


def test_of_many_bodies_those_that_move_are_suggested_first(tmp_path):
    kind, still = "visualization_msgs/msg/MarkerArray", [{"id": k} for k in range(20)]
    with BagWriter(tmp_path / "give_00", flush_period_s=None) as writer:
        for k in range(5):
            wrist = {"id": 99, "pose": {"position": {"x": k / 10}}}
            markers = [{"ns": "gone", "id": 98, "action": 2}, *still, wrist]
            writer.write_message("/bodies", kind, {"markers": markers}, START_NS + k)
            frame = {"child_frame_id": "a [1]", "transform": {"translation": {"x": k / 10}}}
            writer.write_message("/tf", TF, {"transforms": [frame]}, START_NS + k)
            writer.write("/path", PATH, b"no CDR", START_NS + k)
            writer.write_message("/goal", POSE, {}, START_NS + k)
            writer.write_message("/map", "nav_msgs/msg/OccupancyGrid", {}, START_NS + k)
    content = yaml.safe_load(suggest_map(tmp_path))
    fields = [one["fields"][0] for one in content["observed"] + content["controlled"]]
    assert fields[0] == "markers[id=99].pose.position.x" and len(fields) == 10
    assert "markers[id=98].pose.position.x" not in fields
    assert fields[-2:] == ["transforms[0].transform.translation.x", "pose.position.x"]
    with BagWriter(tmp_path / "a", flush_period_s=None) as writer:
        for k in range(5):
            hands = [{"ns": n, "pose": {"position": {"x": k / 10}}} for n in "lr"]
            writer.write_message("/bodies", kind, {"markers": hands}, START_NS + k)
    assert "markers[l/0].pose.position.x" in suggest_map(tmp_path / "a")


def test_the_person_is_observed_though_the_robot_comes_first(tmp_path):
    with BagWriter(tmp_path / "x_00", {"task": "give"}, flush_period_s=None) as writer:
        for k in range(5):
            states = {"header": {"stamp": START_NS + k}, "name": ["q"], "position": [k / 10]}
            writer.write_message("/joint_states", JOINTS, states, START_NS + k)
            pose = {"pose": {"position": {"x": k / 10}}}
            for topic in ("/mocap/gripper/pose", "/mocap/wrist/pose"):
                writer.write_message(topic, POSE, pose, START_NS + k)
    of_bag = yaml.safe_load(suggest_map(tmp_path / "x_00"))
    assert "task" not in of_bag and "files" not in of_bag  # it has its label
    with BagWriter(tmp_path / "q_00", flush_period_s=None) as writer:
        writer.write_message("/joint_states", JOINTS, states, START_NS)
    assert "# Note: no places were found, only joints." in suggest_map(tmp_path / "q_00")
    head = "t,tcp_x,tcp_y,tcp_z,wrist_x,wrist_y,wrist_z"
    of_table, *_ = suggested_csv(tmp_path, csv_of(head, TIMES_S, PLACE, PLACE))
    for content in (of_bag, of_table):
        assert [one["topic"] for one in content["observed"]] == ["/mocap/wrist/pose"]
        assert len(content["controlled"]) == (2 if content is of_bag else 1)


def test_bodies_of_one_name_have_topics_of_their_own(tmp_path):
    names = "t,obs.x,obs.y,obs.z,pose.x,pose.y,pose.z"
    content, *_ = suggested_csv(tmp_path, csv_of(names, TIMES_S, PLACE, PLACE))
    assert content["observed"][0]["topic"] == "/mocap/wrist/pose"
    assert content["controlled"][0]["topic"] == "/mocap/wrist_2/pose"


def test_angles_of_bodies_are_named_with_their_bodies(tmp_path):
    """QTM writes a residual and a matrix for each, which are no angles of joints."""
    axes = "X\tY\tZ\tRoll\tPitch\tYaw\tResidual\t" + "\t".join(f"Rot[{k}]" for k in range(9))
    head = f"NO_OF_FRAMES\t{ROWS}\nFREQUENCY\t100\nBODY_NAMES\tcup\twrist\ncup {axes}\twrist {axes}"
    rows = np.arange(ROWS)[:, None]
    angles = np.hstack([0 * rows + [10, 5], rows / 10, rows / 1e3, rows / ([1e4] * 9)])
    path = tmp_path / "a.tsv"
    path.write_text(csv_of(head, PLACE, angles, PLACE, angles).replace(",", "\t"))
    content, text, _ = suggested(path)
    assert not any("joints" in one for one in content["controlled"])
    assert "# Orientations: cup.Roll, cup.Pitch, cup.Yaw, cup.Rot[0]" in text


@pytest.mark.parametrize(
    "names", [["x_cm", "y_cm", "z_cm", "roll_deg", "pitch_deg", "yaw_deg"], [*"XYZWPR"]]
)
def test_three_angles_beside_a_place_are_of_its_body(names, tmp_path):
    """Also FANUC's W, which makes no quaternion of its place."""
    head, angles = ",".join(["t", *names]), 10 + SHARE * [1, 2, 3]
    content, text, _ = suggested_csv(tmp_path, csv_of(head, TIMES_S, PLACE, angles))
    assert [entry["columns"] for entry in content["observed"]] == [names[:3]]
    assert "controlled" not in content and f"# Orientations: {', '.join(names[3:])}" in text


def test_places_are_known_by_their_units_and_as_parts_of_a_pose(tmp_path):
    """Of a robot's pose only its place; of a length that is no place nothing."""
    names = ["t_s", "x_m", "y_m", "z_m", *(f"tcp_pose_{k}" for k in range(6)), "gripper [mm]"]
    columns = TIMES_S, *[PLACE / 1000] * 3, 80 * SHARE
    content, text, _ = suggested_csv(tmp_path, csv_of(",".join(names), *columns))
    entries = content["observed"] + content["controlled"]
    assert [entry["columns"] for entry in entries] == [names[1:4], names[4:7]]
    assert "# They move, and are no positions: gripper [mm]" in text


@pytest.mark.parametrize("unit", ["_m", ""])
def test_metres_beside_a_body_in_millimetres_are_no_millimetres(unit, tmp_path):
    names = [f"hand_{axis}_mm" for axis in "xyz"] + [f"tcp_{axis}{unit}" for axis in "xyz"]
    rows = csv_of(",".join(["t", *names]), TIMES_S, PLACE, PLACE / 1000)
    _, _, (found,) = suggested_csv(tmp_path, rows)
    for samples in found.samples:
        np.testing.assert_allclose(samples.values, PLACE / 1000, atol=1e-6)


def test_landmarks_of_an_image_are_places_of_two_axes_and_a_likelihood_is_no_joint(tmp_path):
    head = "bodyparts,Händ,Händ,Händ,2nd,2nd,2nd\ncoords,x,y,likelihood,x,y,likelihood"
    content = table(head, lambda k: [str(k), *(*cells(k)[:2], f"{0.9 + k / 1e4}") * 2])
    content, text, _ = suggested_csv(tmp_path, content)
    assert "are no positions: Händ.likelihood" in text
    entries = content["observed"] + content["controlled"]
    assert [entry["topic"] for entry in entries] == ["/mocap/hand/pose", "/mocap/body_2nd/pose"]
    assert all(entry["fields"] == ["pose.position.x", "pose.position.y"] for entry in entries)


@pytest.mark.parametrize(
    ("head", "place"),
    [
        ("t,tx,ty,tz,qx,qy,qz,qw", "tx"),
        ("t,x,y,z,rx,ry,rz", "x"),
        ("t,vx,vy,vz,p_x,p_y,p_z", "p_x"),
        ("t,p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],v_x [m s^-1],v_y [m s^-1],v_z [m s^-1]", "p_RS"),
        ("t,elbow_angles.x,elbow_angles.y,elbow_angles.z,hand.x,hand.y,hand.z", "hand"),
        ("t,posX,posY,posZ,rotX,rotY,rotZ,rotW", "posX"),
        ("elapsed,lin_acc_x,lin_acc_y,lin_acc_z,hand_x,hand_y,hand_z", "hand_x"),
        ("t,vel.x,vel.y,vel.z,hand.x,hand.y,hand.z", "hand"),
        ("t,FreeAcc_X,FreeAcc_Y,FreeAcc_Z,Hand_X,Hand_Y,Hand_Z", "Hand"),
        ("t,gaze_dir_x,gaze_dir_y,gaze_dir_z,hand_x,hand_y,hand_z", "hand"),
        ("t,palm_normal_x,palm_normal_y,palm_normal_z,palm_x,palm_y,palm_z", "palm_x"),
        ("t,hand_x,hand_y,hand_z,hand_jerk_x,hand_jerk_y,hand_jerk_z", "hand_x"),
        ("t,tool_theta_x,tool_theta_y,tool_theta_z,tool_x,tool_y,tool_z", "tool_x"),
        ("t,magnet_x,magnet_y,magnet_z,image_x,image_y,image_z", "image"),
        ("t,w.1.0,w.1.1,w.1.2,w.2.0,w.2.1,w.2.2,w.2.3", "w.1.0"),
        ("t,cartesian_position.0,cartesian_position.1,cartesian_position.2,a.3,a.4,a.5", "cart"),
        ("t,action.x,action.y,action.z,state.x,state.y,state.z", "state.x"),
        ("t,x_dot,y_dot,z_dot,x_cup,y_cup,z_cup", "x_cup"),
        ("t,x_2,y_2,z_2,v_2", "x_2"),
        ("us,tx_cup,ty_cup,tz_cup,qx_cup,qy_cup,qz_cup,qw_cup", "tx_cup"),
        ("t,xForce,yForce,zForce,xCup,yCup,zCup", "xCup"),
        ("t,q.0,q.1,q.2,cup.0,cup.1,cup.2", "cup"),
        ("t,wrench.0,wrench.1,wrench.2,cup.0,cup.1,cup.2", "cup"),
        ("t,arm_joints.0,arm_joints.1,arm_joints.2,RWRA[0],RWRA[1],RWRA[2]", "RWRA"),
        ("t,hand_px,hand_py,hand_pz", "hand_px"),
        ("t,Px1,Py1,Pz1", "Px1"),
    ],
)
def test_a_place_is_told_from_a_rotation_a_speed_and_a_command(head, place, tmp_path):
    columns = np.column_stack([TIMES_S, PLACE / 1000, PLACE / 1000, 0.5 + 0.0 * TIMES_S])
    content, *_ = suggested_csv(tmp_path, csv_of(head, columns[:, : head.count(",") + 1]))
    entries = content["observed"] + content.get("controlled", [])
    (body,) = [entry for entry in entries if "PoseStamped" in entry["type"]]
    assert body["columns"][0].startswith(place) and "_p/" not in body["topic"]


def test_landmarks_of_an_array_alone_are_places(tmp_path):
    np.save(tmp_path / "a.npy", np.stack([np.zeros_like(PLACE), PLACE], axis=1))
    content, _, (found,) = suggested(tmp_path / "a.npy")
    assert content["observed"][0]["columns"] == ["1.0", "1.1", "1.2"]
    np.testing.assert_allclose(found.samples[0].values, PLACE / 1000)
