# SPDX-License-Identifier: Apache-2.0
"""The DOF file: what it says is what is read, and what is wrong with it is named."""

from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.bags.definitions import make_message
from intent_recognition.demonstrations import DofEntry, DofSpec, extract, load_dofs
from intent_recognition.errors import DofError, MessageError
from intent_recognition.share import share_path

ENTRY = {"topic": "/a", "type": "geometry_msgs/msg/PoseStamped", "fields": ["pose.x"], "unit": "m"}
STATE = "sensor_msgs/msg/JointState"
JOINT_ENTRY = {"topic": "/j", "type": STATE, "joints": ["a", "b"], "unit": "rad"}
VALUES = {
    "geometry_msgs/msg/PoseStamped": ("pose.position.y", {"pose": {"position": {"y": 3.0}}}),
    "geometry_msgs/msg/PoseWithCovarianceStamped": (
        "pose.pose.position.z",
        {"pose": {"pose": {"position": {"z": 3.0}}}},
    ),
    "nav_msgs/msg/Odometry": ("twist.twist.linear.x", {"twist": {"twist": {"linear": {"x": 3.0}}}}),
    "geometry_msgs/msg/PointStamped": ("point.z", {"point": {"z": 3.0}}),
    "geometry_msgs/msg/Vector3Stamped": ("vector.x", {"vector": {"x": 3.0}}),
    "sensor_msgs/msg/JointState": ("position.1", {"name": ["a", "b"], "position": [1.0, 3.0]}),
    "sensor_msgs/msg/Range": ("range", {"range": 3.0}),
    "std_msgs/msg/Float64MultiArray": ("data.2", {"data": [1.0, 2.0, 3.0]}),
}


def spec(**changes) -> dict:
    return {"observed": [ENTRY | changes], "controlled": [JOINT_ENTRY]}


@pytest.mark.parametrize("kind", VALUES)
def test_any_field_of_any_type(kind):
    field, fields = VALUES[kind]
    entry = DofEntry("t", kind, fields=(field,), unit="m")
    found = extract(entry, make_message(kind, fields))
    assert found.tolist() == [3.0] and found.dtype == np.float64
    assert entry.names == (f"t.{field}",)


@given(order=st.permutations(["a", "b", "c", "d"]))
def test_joints_are_found_in_any_order(order):
    entry = DofEntry("j", "sensor_msgs/msg/JointState", joints=("c", "a"), unit="rad")
    message = SimpleNamespace(name=order, position=[float(ord(n)) for n in order])
    assert extract(entry, message).tolist() == [ord("c"), ord("a")]


def test_velocity_and_effort_have_names_of_their_own():
    content = spec()
    content["controlled"].append(JOINT_ENTRY | {"quantity": "velocity"})
    dofs = DofSpec.from_dict(content)
    assert dofs.controlled_names == ("a", "b", "a.velocity", "b.velocity")
    message = SimpleNamespace(name=["a", "b"], position=[1.0, 2.0], velocity=[3.0, 4.0])
    assert extract(dofs.controlled[1], message).tolist() == [3.0, 4.0]


@pytest.mark.parametrize(
    "message",
    [
        SimpleNamespace(name=["a"], position=[1.0]),
        SimpleNamespace(name=["a", "b"], position=[1.0]),
        SimpleNamespace(name=["a", "b", "a"], position=[1.0, 2.0, 3.0]),
        SimpleNamespace(name=[], position=[]),
        SimpleNamespace(pose=1),
    ],
)
def test_missing_joint_is_a_message_error(message):
    with pytest.raises(MessageError, match=r"^j"):
        extract(DofEntry("j", "sensor_msgs/msg/JointState", joints=("a", "b")), message)


def test_shipped_file_is_the_contract_and_is_written_back():
    dofs = load_dofs()
    assert dofs.observed_names == tuple(f"mocap/wrist/pose.pose.position.{a}" for a in "xyz")
    assert dofs.controlled_names == tuple(f"lwr_a{i}_joint" for i in range(1, 8))
    assert dofs.observed[0].topic == "mocap/wrist/pose"
    dofs = load_dofs()
    assert DofSpec.from_dict(dofs.to_dict()) == dofs
    assert DofSpec.from_dict(yaml.safe_load(yaml.safe_dump(dofs.to_dict()))) == dofs


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ([], "mapping"),
        ({}, "observed"),
        ({"observed": []}, "observed"),
        (spec() | {"extra": 1}, "extra"),
        (spec(colour="red"), "colour"),
        (spec(topic=""), "topic"),
        (spec(topic="/"), "topic"),
        (spec(topic=3), "topic"),
        (spec(type="PoseStamped"), "type"),
        (spec(unit=None), "unit"),
        (spec(unit="Metres"), "unit: expected m, the only spelling"),
        (spec(fields=[]), "fields"),
        (spec(fields="pose.x"), "fields"),
        (spec(fields=["pose..x"]), "fields"),
        (spec(joints=["a"]), "both"),
        (spec(fields=["pose.x", "pose.x"]), "twice"),
        (spec(quantity="velocity"), "quantity"),
        ({"observed": [JOINT_ENTRY], "controlled": [JOINT_ENTRY]}, "twice a, b"),
        ({"observed": [ENTRY], "controlled": [JOINT_ENTRY | {"quantity": "x"}]}, "quantity"),
        ({"observed": [ENTRY], "controlled": [ENTRY | {"type": "a/msg/B", "fields": ["q"]}]}, "a"),
    ],
)
def test_mistakes_are_named(tmp_path, content, named):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(DofError, match=named) as caught:
        load_dofs(path)
    assert "mine.yaml" in str(caught.value)
    assert f"{share_path('config/dofs.yaml')} is an example." in str(caught.value)


NAME = ENTRY["type"]
TURN = {"type": NAME, "fields": [f"pose.orientation.{axis}" for axis in "xyzw"], "unit": "rad"}
TURN |= {"orientation": "quaternion"}
(PLACE, TURNED) = load_dofs(share_path("config/examples/link_pose.dofs.yaml")).to_dict()[
    "controlled"
]
RATE = {
    "topic": "r",
    "type": NAME,
    "fields": ["v.x"],
    "unit": "m/s",
    "of": ["a.pose.x"],
    "std": 0.1,
}
FRAME = "tracker 1 0.5 0 0 0 0 1"


def controlled(*entries) -> dict:
    return {"observed": [ENTRY], "controlled": list(entries)}


def velocity(**changes) -> dict:
    return spec() | {"velocities": [RATE | changes]}


def extrinsics(*listed) -> dict:
    return spec() | {"extrinsics": list(listed)}


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (spec(context=True), "observed: expected an entry of the human"),
        (spec(context=1), r"observed\[0\]: context: expected true or false, got 1"),
        (spec(link="hand"), r"observed\[0\]: .*only the keys .*, got link"),
        (spec(std=0.1), r"observed\[0\]: .*only the keys .*, got std"),
        (
            controlled(ENTRY | {"context": True}),
            r"controlled\[0\]: .*only the keys .*, got context",
        ),
        (controlled(PLACE | {"unit": "mm"}), r"controlled\[0\]: link: expected type .*unit m"),
        (controlled(PLACE | {"topic": "/mocap/a/pose", "unit": "mm"}), ".* metres; .* in a map"),
        (controlled(PLACE | {"fields": ["pose.x"]}), r"controlled\[0\]: link: .*pose.position.z"),
        (controlled(PLACE | {"link": ""}), r"controlled\[0\]: link: expected a text"),
        *(
            (
                controlled(PLACE, TURNED | change),
                r"controlled\[1\]: expected the position before it",
            )
            for change in ({"link": "other"}, {"topic": "/other"}, {"robot": "x.urdf"})
        ),
        (spec(**TURN | {"orientation": "euler"}), r".*orientation: expected quaternion"),
        (spec(**TURN | {"unit": "m"}), ".*unit: expected rad"),
        (spec(**TURN | {"fields": TURN["fields"][:3]}), ".*fields: expected the fields x, y, z, w"),
        (spec(**TURN | {"fields": TURN["fields"][::-1]}), ".*fields: expected the fields x, y, z"),
        (spec(**TURN, reference=[0, 0, 0, 2.0]), ".*reference: expected a unit quaternion"),
        (spec(**TURN, reference="north"), ".*reference: expected a unit quaternion"),
        (velocity(of=["nothing"]), r"velocities\[0\]: of: .*got nothing"),
        (velocity(of=["a.pose.x", "a"]), r"velocities\[0\]: of: expected 1 different names"),
        (velocity(of=None), r"velocities\[0\]: of: expected a list of names"),
        *(
            (velocity(std=std), r"velocities\[0\]: std: expected a positive number")
            for std in (0.0, "much", True)
        ),
        (velocity(rate=1), r"velocities\[0\]: expected only the keys .*got rate"),
        (spec() | {"extrinsics": FRAME}, "extrinsics: expected a list"),
        (extrinsics(FRAME, 3), r"extrinsics\[1\]: expected a text"),
        (extrinsics(FRAME, "cam 1 2 3"), r"extrinsics\[1\]: expected one 'frame x y.*'cam 1 2 3'"),
        (extrinsics(FRAME, FRAME), r"extrinsics\[1\]: .*Give each frame once"),
        (extrinsics("cam 0 0 0 0 0 0 0"), r"extrinsics\[0\]: .*a quaternion"),
    ],
)
def test_mistakes_in_entries_of_any_kind_name_file_and_place(content, named):
    with pytest.raises(DofError, match=f"^mine.yaml: {named}"):
        DofSpec.from_dict(content, "mine.yaml")


@pytest.mark.parametrize("text", ["observed: [", "\x00", ": :", "\udce4"])
def test_no_yaml_is_named(tmp_path, text):
    (tmp_path / "bad.yaml").write_text(text, errors="surrogateescape")
    with pytest.raises(DofError, match=r"bad\.yaml(?!.*codec)"):
        load_dofs(tmp_path / "bad.yaml")
    with pytest.raises(DofError, match=r"nowhere.* Check the path; /.*config/dofs\.yaml is"):
        load_dofs(tmp_path / "nowhere.yaml")
