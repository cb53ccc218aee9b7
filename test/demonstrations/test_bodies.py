# SPDX-License-Identifier: Apache-2.0
"""Bodies as trackers send them: elements of arrays by number or name, joints of any person."""

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bag_builder import START_NS, STEP_NS
from model_builder import (
    ROBOT,
    make_dofs,
    message_of,
    messages_of,
    perform,
    true_library,
    write_recording,
)

from intent_recognition.bags import BagReader, BagWriter
from intent_recognition.bags.definitions import make_message
from intent_recognition.demonstrations import extract, load_dofs, read_demonstrations
from intent_recognition.demonstrations.dofs import DofEntry, DofSpec
from intent_recognition.demonstrations.fields import extract_present, position_columns, stamp_of
from intent_recognition.demonstrations.paths import body_of
from intent_recognition.errors import DofError, MessageError
from intent_recognition.evaluation.replaying import replay
from intent_recognition.model import Model
from intent_recognition.share import share_path

NAN = float("nan")
POSES, TRANSFORMS = "geometry_msgs/msg/PoseArray", "tf2_msgs/msg/TFMessage"
SKELETON = DofEntry(
    "skeleton", POSES, fields=("poses[0].position.x", "poses[2].position.x"), unit="m"
)
WRIST = DofEntry("tf", TRANSFORMS, fields=("transforms[wrist].transform.translation.x",), unit="m")
BODY = DofEntry("humans/bodies/a/joint_states", ROBOT.type, joints=("knee_*", "elbow"), unit="rad")


def skeleton(*xs):
    return make_message(POSES, {"poses": [{"position": {"x": x}} for x in xs]})


def transform(frame, x, stamp_ns=0):
    moved = {"translation": {"x": x}}
    return {"header": {"stamp": stamp_ns}, "child_frame_id": frame, "transform": moved}


def transforms(*listed):
    return make_message(TRANSFORMS, {"transforms": list(listed)})


def test_an_element_by_what_one_of_its_fields_says():
    order = [("wrist", 7, 1.0), ("tool", 9, 2.0)]
    elements = [
        SimpleNamespace(rigid_body_name=name, id=number, pose=SimpleNamespace(x=x))
        for name, number, x in order
    ]
    path = "rigidbodies[{}].pose.x".format
    entry = DofEntry(
        "bodies", "a/msg/B", fields=(path("rigid_body_name=wrist"), path("id=9")), unit="m"
    )
    for listed in (elements, elements[::-1]):
        found = extract(entry, SimpleNamespace(rigidbodies=listed))
        np.testing.assert_array_equal(found, [1.0, 2.0])
    found = extract_present(entry, SimpleNamespace(rigidbodies=elements[:1]))
    np.testing.assert_array_equal(found, [1.0, NAN])


@pytest.mark.parametrize(
    ("xs", "expected"),
    [((1.0, 2.0, 3.0), (1.0, 3.0)), ((1.0, 2.0), (1.0, NAN)), ((NAN, 0.0, 3.0), (NAN, 3.0))],
)
def test_an_element_that_is_not_there_is_not_measured(xs, expected):
    np.testing.assert_array_equal(extract_present(SKELETON, skeleton(*xs)), expected)


def test_elements_and_fields_that_are_missing_are_named():
    with pytest.raises(MessageError, match=r"poses\[0\].position.x: .*element 0 of 0"):
        extract_present(SKELETON, skeleton())
    with pytest.raises(MessageError, match=r"element 2 of 1"):
        extract(SKELETON, skeleton(1.0))
    wrong = replace(SKELETON, fields=("poses[0].position.x", "poses[0].place.x"))
    with pytest.raises(MessageError, match="Correct the field path"):
        extract_present(wrong, skeleton(1.0))
    assert position_columns(SKELETON) is None
    axes = [f"transforms[wrist].transform.translation.{axis}" for axis in "yzx"]
    assert position_columns(replace(WRIST, fields=("other", *axes))) == [3, 1, 2]


def test_markers_and_transforms_are_found_and_stars_stand_for_persons():
    message = transforms(transform("elbow", 1.0, 5), transform("/wrist", 2.0, 7))
    assert extract(WRIST, message).tolist() == [2.0]
    assert stamp_of(WRIST, message, 9) == 7
    assert stamp_of(WRIST, transforms(transform("elbow", 1.0, 5)), 9) is None
    assert stamp_of(WRIST, transforms(transform("wrist", 1.0)), 9) == 9
    fields = ("markers[body/3].pose.position.y",)
    entry = DofEntry("markers", "visualization_msgs/msg/MarkerArray", fields=fields, unit="m")
    listed = [
        {"ns": ns, "id": k, "pose": {"position": {"y": k}}}
        for ns, k in (("body", 1), ("b", 3), ("body", 3))
    ]
    for order in (listed, listed[::-1]):
        assert extract(entry, make_message(entry.type, {"markers": order})).tolist() == [3.0]
    gone = [{"action": action, "ns": "body", "id": 3} for action in (2, 3)]
    taken = make_message(entry.type, {"markers": gone})
    by_number = replace(entry, fields=("markers[0].pose.position.y",))
    for asked in (entry, by_number):
        assert stamp_of(asked, taken, 9) is None  # where a marker was is not where it is
        with pytest.raises(MessageError):
            extract(asked, taken)
    again = make_message(entry.type, {"markers": [*gone, *listed]})
    assert extract(entry, again).tolist() == [3.0]
    for person in ("rlkas", "f9bd2"):
        names = ["elbow", f"l_knee_{person}", f"knee_{person}"]
        message = make_message(BODY.type, {"name": names, "position": [1.0, 2.0, 3.0]})
        assert extract(BODY, message).tolist() == [3.0, 1.0]


@pytest.mark.parametrize(
    "field", ["poses[].x", "poses[1", "poses.[1].x", "[1].x", "poses[1]x", "a b"]
)
def test_paths_that_are_none(field):
    entry = {"topic": "a", "type": POSES, "fields": [field], "unit": "m"}
    with pytest.raises(DofError, match=r"paths such as pose.position.x or poses\[7\]"):
        DofSpec.from_dict({"observed": [entry]})


EXAMPLES = ("pose_array", "marker_array", "ros4hri", "tf")


@pytest.fixture(scope="module", params=EXAMPLES)
def body(request, tmp_path_factory):
    """DOFs, truth and a model of an example; recordings carry what the entries are read from."""
    dofs = load_dofs(share_path(f"config/examples/{request.param}.dofs.yaml"))
    return dofs, true_library(dofs), tmp_path_factory.mktemp(request.param)


def test_recordings_of_a_body_give_the_values_and_stamps_that_were_measured(body):
    dofs, truth, folder = body
    recorded = perform(truth, 1, 3)
    (found,), rejections = read_demonstrations(
        write_recording(folder / "whole", recorded, dofs), dofs
    )
    assert not rejections and not found.rejected
    for ours, theirs in zip(
        (*found.observed, *found.controlled),
        (*recorded.observed, *recorded.controlled),
        strict=True,
    ):
        np.testing.assert_array_equal(ours.stamps_ns, theirs.stamps_ns)
        np.testing.assert_array_equal(ours.values, theirs.values)


def thinned(entry, k, values):
    """An occluded body: of three messages in four one joint is not seen, or nothing is."""
    values = values.copy()
    if len(entry.names) > 3:
        values[(slice(0, 3), slice(3, None), slice(0, 0))[k // 10 % 3]] = NAN
    return values


@pytest.mark.slow
def test_joints_out_of_sight_leave_the_others_and_the_stream(body):
    dofs, truth, folder = body
    model, counted = Model(truth, dofs), Counter()
    recording, observed = perform(truth, 1, 90), {entry.topic for entry in dofs.observed}
    with BagWriter(folder / "occluded") as writer:
        for k, (entry, stamp_ns, values) in enumerate(messages_of(recording, dofs)):
            seen = thinned(entry, k, values) if entry.topic in observed else values
            writer.write_message(
                entry.topic, entry.type, message_of(entry, stamp_ns, seen), stamp_ns
            )
            if entry.type == TRANSFORMS:  # others send frames on the topic
                other = {"transforms": [transform("camera", 1.0, stamp_ns + 10**9)]}
                writer.write_message(entry.topic, entry.type, other, stamp_ns)
    rows = list(replay(BagReader(folder / "occluded"), model, counted))
    moving = [row["probabilities"] for row in rows if row["probabilities"]["none"] < 1.0]
    assert max(moving[-1], key=moving[-1].get) == "task_1"
    assert set(counted) <= {"missing_dof", "not_finite"}
    assert len(rows) > 0.5 * len(recording.observed[0].stamps_ns)


def test_frames_of_others_are_not_counted_and_names_of_frames_are_told(tmp_path):
    with BagWriter(tmp_path / "bag", {"task": "give"}) as writer:
        for i in range(60):
            at_ns = START_NS + i * STEP_NS
            for frame, x, lag_ns in (("camera", 1.0, 50), ("wrist", 0.001 * i, 0)):
                sent = transform(frame, x, at_ns - lag_ns)
                sent["header"]["frame_id"] = "/room" if i < 30 else "lens"
                writer.write_message("tf", TRANSFORMS, {"transforms": [sent]}, at_ns)
            arm = {"header": {"stamp": at_ns}, "name": list(ROBOT.joints), "position": [0.0] * 7}
            writer.write_message(ROBOT.topic, ROBOT.type, arm, at_ns)
    (found,), _ = read_demonstrations(tmp_path / "bag", make_dofs(WRIST))
    assert len(found.observed[0].stamps_ns) == 60 and not found.rejected
    assert found.frames == {"tf": ("lens", "room")}
    wrong = replace(WRIST, fields=("transforms[rist].transform.translation.x",))
    _, (rejection,) = read_demonstrations(tmp_path / "bag", make_dofs(wrong))
    assert "the topic has camera, wrist" in str(rejection)


@pytest.mark.parametrize("hidden", [{"occluded": True}, {"valid": False}, {"valid": 0}])
def test_a_body_that_is_marked_as_hidden_is_not_measured(hidden):
    """Drivers send the last place of a body, or zeros, while they do not see it."""
    entry = DofEntry("w", "lab_msgs/msg/Body", fields=("x",), unit="m")
    seen = {key: not value for key, value in hidden.items()}
    for marks, at in ((seen, 9), (hidden, None)):
        assert stamp_of(entry, SimpleNamespace(x=1.0, **marks), 9) == at
    within = replace(entry, fields=("bodies[wrist].x",))
    bodies = [SimpleNamespace(name="wrist", x=k, **m) for k, m in enumerate((hidden, seen))]
    assert extract(within, SimpleNamespace(bodies=bodies)).tolist() == [1.0]
    with pytest.raises(MessageError):
        extract(within, SimpleNamespace(bodies=bodies[:1]))
    for parts in ([], np.array([False, True])):  # marks of a body's parts
        assert stamp_of(entry, SimpleNamespace(x=1.0, valid=parts, occluded=parts), 9) == 9


@pytest.mark.parametrize(
    ("marker", "said"),
    [
        (lambda i: {"action": 2}, "no pose.position.x: the topic has none that was seen"),
        (lambda i: {"ns": "trail", "id": i}, ""),
    ],
)
def test_markers_that_are_all_deleted_or_only_numbered(marker, said, tmp_path):
    kind = "visualization_msgs/msg/Marker"
    with BagWriter(tmp_path / "bag", {"task": "give"}) as writer:
        for i in range(60):
            at_ns, place = START_NS + i * STEP_NS, {"position": {"x": i / 100}}
            sent = {"header": {"stamp": at_ns}, "pose": place, **marker(i)}
            writer.write_message("m", kind, sent, at_ns)
    entry = DofEntry("m", kind, fields=("pose.position.x",), unit="m")
    usable, rejected = read_demonstrations(tmp_path / "bag", DofSpec((entry,), ()))
    assert len(usable) == (not said) and all(said in str(one) for one in rejected)


def test_a_list_of_names_names_no_body():
    assert body_of(SimpleNamespace(name=["arm", "cup"])) == ""


@pytest.mark.parametrize("first", ["head", ""])
def test_bodies_that_share_a_topic_are_not_read_as_one(first, tmp_path):
    stamped = "geometry_msgs/msg/TransformStamped"
    with BagWriter(tmp_path / "bag", {"task": "give"}) as writer:
        for i in range(60):
            at_ns = START_NS + i * STEP_NS
            message = transform((first, "wrist")[i % 2], i % 2, at_ns)
            writer.write_message("vicon", stamped, message, at_ns)
    entry = DofEntry("vicon", stamped, fields=("transform.translation.x",), unit="m")
    _, rejected = read_demonstrations(tmp_path / "bag", DofSpec((entry,), ()))
    said = "several bodies on one topic: head, wrist" in str(rejected)
    assert said == bool(first)  # one without a name is none
    marker = "visualization_msgs/msg/Marker"
    with BagWriter(tmp_path / "markers", {"task": "give"}) as writer:
        for i in range(60):
            at_ns = START_NS + i * STEP_NS
            sent = {"header": {"stamp": at_ns}, "ns": "hand", "id": i % 2 if first else 1}
            writer.write_message("m", marker, sent, at_ns)
    entry = DofEntry("m", marker, fields=("pose.position.x",), unit="m")
    _, rejected = read_demonstrations(tmp_path / "markers", DofSpec((entry,), ()))
    assert ("several bodies on one topic: hand/0, hand/1" in str(rejected)) == bool(first)
