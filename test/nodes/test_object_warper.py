# SPDX-License-Identifier: Apache-2.0
"""The node object_warper on its topics."""

from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from scan_builder import scanned
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from intent_recognition.errors import ArgumentError, MessageError, ModelError
from intent_recognition.nodes.conversions import (
    orientation_array,
    position_array,
    stamp_ns,
    to_pose,
    to_stamp,
)
from intent_recognition.nodes.graph import NODES as GRAPH_NODES
from intent_recognition.nodes.object_messages import LABEL, cloud_arrays, to_labelled_cloud
from intent_recognition.nodes.object_warper import ObjectWarper
from intent_recognition.objects.file import find_object, load_object, save_object
from intent_recognition.registry import FRAMES, NODES
from intent_recognition.warping.grasp_warp import warp_grasp
from intent_recognition.warping.object_model import Grasp, ObjectCloud
from intent_recognition.warping.object_warp import ObjectModel, warp_object
from intent_recognition.warping.parameters import pouring_parameters
from intent_recognition.warping.pour_level import emptying

T0 = 1_700_000_000_123_456_789


def header(index=0):
    return Header(frame_id="camera", stamp=to_stamp(T0 + index))


def message_of(cloud, index=0):
    """A cloud with points and normals, as a camera's node would publish it."""
    return to_labelled_cloud(
        header(index), cloud.points, cloud.normals, np.zeros(len(cloud.points))
    )


def organised(points, height):
    """An organised cloud of positions only, with padding, big-endian doubles."""
    message = PointCloud2(header=header(), height=height, width=len(points) // height)
    message.fields = [
        PointField(name=n, offset=4 + 8 * i, datatype=PointField.FLOAT64, count=1)
        for i, n in enumerate("xyz")
    ]
    message.is_bigendian, message.point_step = True, 32
    table = np.zeros((len(points), 32), np.uint8)
    table[:, 4:28] = points.astype(">f8").view(np.uint8).reshape(-1, 24)
    rows = table.reshape(height, -1)
    rows = np.concatenate([rows, np.zeros((height, 7), np.uint8)], 1)
    message.row_step, message.data = rows.shape[1], rows.tobytes()
    return message


def test_clouds_survive_the_wire():
    """Positions and normals to 32 bits; other layouts are read as well."""
    cloud = scanned("tumbler")
    points, normals = cloud_arrays(message_of(cloud))
    np.testing.assert_allclose(points, cloud.points, atol=1e-7)
    np.testing.assert_allclose(normals, cloud.normals, atol=1e-6)
    points, normals = cloud_arrays(organised(cloud.points, 40))
    np.testing.assert_array_equal(points, cloud.points)
    assert normals is None


def test_malformed_clouds_are_named():
    for spoil, reason in (
        (lambda m: m.fields.pop(0), "no x"),
        (lambda m: setattr(m, "data", b"1234"), "bytes"),
        (lambda m: setattr(m, "point_step", 40), "bytes"),
        (lambda m: setattr(m.fields[1], "datatype", 99), "known type"),
        (lambda m: setattr(m.fields[2], "offset", 27), "requires 31 bytes"),
    ):
        message = message_of(scanned("tumbler"))
        spoil(message)
        with pytest.raises(MessageError, match=reason):
            cloud_arrays(message)


@pytest.mark.slow
def test_parameters_and_labels_are_those_of_the_library(harness):
    """One cloud in, the library's numbers out, with the cloud's stamp and frame.

    With another container's place, the lip is toward it.
    """
    node = harness.node(ObjectWarper)
    offered = {p.topic_name[1:] for p in node.publishers if p.topic_name.startswith("/object/")}
    assert offered == set(NODES["object_warper"].publishes) - set(FRAMES)
    assert offered <= set(GRAPH_NODES["cup_warper"].topics)  # where there are two
    cloud = scanned("tall_mug")
    clouds, vectors, poses, grasps = (
        harness.said(node, f"object/{name}")
        for name in ("labelled_cloud", "parameters", "pose", "grasp")
    )
    harness.hear(node, "object/cloud", message_of(cloud))
    source = ObjectModel.learn(load_object(find_object("mug")))
    sent = ObjectCloud(*cloud_arrays(message_of(cloud)))
    warped = warp_object(source, sent)
    expected = pouring_parameters(warped)
    found = dict(zip(vectors[0].name, vectors[0].position, strict=True))
    assert found["opening_radius_m"] == pytest.approx(expected.opening_radius_m)
    assert found["volume_m3"] == pytest.approx(expected.volume_m3)
    assert found["tilt_reference_rad"] == pytest.approx(expected.tilt_reference_rad)
    lip = [found[f"lip_point_{axis}"] for axis in "xyz"]
    np.testing.assert_allclose(lip, expected.lip_point)
    for message in (clouds[0], vectors[0]):
        assert stamp_ns(message) == T0
        assert message.header.frame_id == "camera"
    frame = Rotation.from_quat(orientation_array(poses[0].pose)).as_matrix()
    np.testing.assert_allclose(position_array(poses[0].pose), expected.opening_centre)
    np.testing.assert_allclose(frame[:, 2], warped.rim.up)
    grasp = warp_grasp(source, warped)
    assert found["grasp_width_m"] == grasp.width_m
    np.testing.assert_allclose(position_array(grasps[0].pose), grasp.centre)
    turn = Rotation.from_quat(orientation_array(grasps[0].pose)).as_matrix()
    np.testing.assert_allclose(turn, grasp.pose[:3, :3], atol=1e-12)
    assert grasps[0].header == vectors[0].header
    holds = emptying(warped, expected.lip_point)
    assert found["tilt_leaving_40_percent_rad"] == pytest.approx(holds.tilt_leaving(0.4))
    there = np.array([0.1, 0.5, 0.1])
    place = PoseStamped(header=header(), pose=to_pose(there, np.array([0.0, 0.0, 0.0, 1.0])))
    harness.hear(node, "object/toward", place)
    harness.hear(node, "object/cloud", message_of(cloud, 1))
    nearest = pouring_parameters(warped, toward=there).lip_point
    found = dict(zip(vectors[1].name, vectors[1].position, strict=True))
    np.testing.assert_allclose([found[f"lip_point_{axis}"] for axis in "xyz"], nearest)
    labels = np.frombuffer(bytes(clouds[0].data), np.uint8).reshape(-1, 28)[:, 24]
    assert clouds[0].fields[-1].name == LABEL
    np.testing.assert_array_equal(labels, warped.labels)


@pytest.mark.slow
def test_bad_clouds_are_counted_and_harm_nothing(harness):
    """Empty, no container, malformed; then a good one with pixels without depth."""
    node = harness.node(ObjectWarper)
    vectors = harness.said(node, "object/parameters")
    cloud = scanned("tumbler")
    malformed = message_of(cloud)
    malformed.fields.pop()
    malformed.fields.pop(0)
    points = np.concatenate([cloud.points, np.full((80, 3), np.nan)])
    normals = np.concatenate([cloud.normals, np.zeros((80, 3))])
    good = to_labelled_cloud(header(9), points, normals, np.zeros(len(points)))
    large = ObjectCloud(1000.0 * cloud.points, cloud.normals)
    for message in (PointCloud2(header=header()), malformed, message_of(large), good):
        harness.hear(node, "object/cloud", message)
    assert [stamp_ns(vector) for vector in vectors] == [T0 + 9]
    counted = {"pixel_without_depth": 80, "malformed": 2, "not_warped": 1}
    assert node._diagnostics._counts == counted
    often = node._n_points // len(cloud.points) + 2
    thinned = node._target(*(np.tile(part, (often, 1)) for part in (cloud.points, cloud.normals)))
    assert len(thinned.points) == node._n_points


@pytest.mark.slow
def test_a_grasp_that_does_not_fit_costs_no_parameters(harness, tmp_path):
    """The mug held by its handle, and a tumbler."""
    mug = load_object(find_object("mug"))
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    grip = mug.points[np.argmin(mug.points[:, 0])]
    pose[:3, 3] = [grip[0] + 0.004, 0.0, grip[2]]
    path = save_object(tmp_path / "held.npz", replace(mug, grasp=Grasp(pose, 0.009)))
    node = harness.node(ObjectWarper, source=str(path))
    vectors = harness.said(node, "object/parameters")
    harness.hear(node, "object/cloud", message_of(scanned("tumbler")))
    assert "volume_m3" in vectors[0].name and "grasp_width_m" not in vectors[0].name
    assert node._diagnostics.rejected("no_grasp") == 1


@pytest.mark.parametrize(
    ("overrides", "error"),
    [
        ({"source": "bucket"}, ModelError),
        ({"mapping": "both"}, ArgumentError),
        ({"viewpoint": [1.0, 2.0]}, ArgumentError),
    ],
)
def test_wrong_parameters_stop_the_node(harness, overrides, error):
    with pytest.raises(error):
        harness.node(ObjectWarper, **overrides)
