# SPDX-License-Identifier: Apache-2.0
"""Node: warps an annotated object onto each seen one.

Each `object/cloud` yields `object/labelled_cloud`, `object/parameters` and `object/pose`, and
`object/grasp` if a grasp is annotated. The lip point faces `object/toward`, if that is known.
"""

import time
from functools import partial
from typing import Any, Literal

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState, PointCloud2

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, IntentError, MessageError, one_line
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import position_array, stamp_ns, to_pose
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.frames import FrameOutput
from intent_recognition.nodes.object_messages import (
    cloud_arrays,
    to_labelled_cloud,
    to_named_vector,
)
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.runtime import run
from intent_recognition.objects import find_object, load_object
from intent_recognition.warping import (
    Grasp,
    ObjectCloud,
    ObjectModel,
    WarpedObject,
    emptying,
    pouring_parameters,
    warp_grasp,
    warp_object,
    with_estimated_normals,
)

PARAMETERS, TOWARD = "object/parameters", "object/toward"


class ObjectWarper(Node):
    """Passes clouds to `warping.warp_object` and publishes the results."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("object_warper", **kwargs)

        values = declare(self, "object_warper")
        self._source = ObjectModel.learn(load_object(find_object(values["source"])))
        self._mapping: Literal["label", "point"] = values["mapping"]
        self._neighbours, self._n_points = values["neighbours"], values["n_points"]
        self._viewpoint = np.array(values["viewpoint"], dtype=float)
        if self._viewpoint.shape != (3,) or not np.isfinite(self._viewpoint).all():
            expected, cure = "three numbers", "Give x, y and z in metres."
            raise ArgumentError.about("viewpoint", expected, values["viewpoint"], cure)
        self._above_m = values["stands_above"]
        self._toward: PoseStamped | None = None
        self._frames = FrameOutput(self)
        self._diagnostics = Diagnostics(self)
        self._cloud = self.create_publisher(PointCloud2, "object/labelled_cloud", qos.STATE)
        self._vector = self.create_publisher(JointState, PARAMETERS, qos.STATE)
        self._pose = self.create_publisher(PoseStamped, "object/pose", qos.STATE)
        self._grasp = self.create_publisher(PoseStamped, "object/grasp", qos.STATE)
        self._diagnostics.subscribe(PoseStamped, TOWARD, self._on_toward, qos.STATE)
        self._diagnostics.subscribe(PointCloud2, "object/cloud", self._on_cloud, qos.SENSOR)

    def _on_cloud(self, message: PointCloud2) -> None:
        start_s = time.perf_counter()
        try:
            target = self._target(*cloud_arrays(message))
            warped = warp_object(self._source, target, self._mapping, self._neighbours)
            parameters = pouring_parameters(warped, self._other_m(message.header.frame_id))
            holds = emptying(warped, parameters.lip_point, self._above_m)
        except IntentError as error:
            reason = "malformed" if isinstance(error, MessageError) else "not_warped"
            self._diagnostics.reject(reason, one_line(error))
            return
        self._cloud.publish(
            to_labelled_cloud(message.header, warped.points, warped.normals, warped.labels)
        )
        vector = to_named_vector(message.header, parameters, holds)
        grasp = self._grasp_on(warped)
        if grasp is not None:
            vector.name.append("grasp_width_m")
            vector.position.append(grasp.width_m)
            held = to_pose(grasp.centre, Rotation.from_matrix(grasp.pose[:3, :3]).as_quat())
            self._grasp.publish(PoseStamped(header=message.header, pose=held))
        self._vector.publish(vector)
        outward = warped.rim.outward(parameters.lip_point)
        axes = np.column_stack([outward, np.cross(warped.rim.up, outward), warped.rim.up])
        turn = Rotation.from_matrix(axes).as_quat()
        pose = to_pose(parameters.opening_centre, turn)
        self._pose.publish(PoseStamped(header=message.header, pose=pose))
        self._frames.send(stamp_ns(message), message.header.frame_id, self.get_name(), pose)
        self._diagnostics.tick(PARAMETERS)
        self._diagnostics.latency(time.perf_counter() - start_s)

    def _grasp_on(self, warped: WarpedObject) -> Grasp | None:
        """The annotated grasp on the seen object; None without one, or if it does not fit."""
        if self._source.annotated.grasp is None:
            return None
        with self._diagnostics.rejecting("no_grasp"):
            return warp_grasp(self._source, warped)
        return None

    def _on_toward(self, message: PoseStamped) -> None:
        if np.isfinite(position_array(message.pose)).all():
            self._toward = message
        else:
            self._diagnostics.reject("not_finite", f"{TOWARD} holds NaN or infinity")

    def _other_m(self, frame: str) -> Floats | None:
        """Position (3,) [m] of the other container; None unless it is known in this frame."""
        if self._toward is None:
            return None
        if self._toward.header.frame_id != frame:
            known = self._toward.header.frame_id
            self._diagnostics.reject("unknown_frame", f"{TOWARD} in {known!r}, cloud in {frame!r}")
            return None
        return position_array(self._toward.pose)

    def _target(self, points: Floats, normals: Floats | None) -> ObjectCloud:
        """The seen object without pixels that lack depth, thinned evenly to `n_points`."""
        seen = np.isfinite(points).all(1)
        if normals is not None:
            seen &= np.isfinite(normals).all(1)
        self._diagnostics.count("pixel_without_depth", int((~seen).sum()))
        kept = np.flatnonzero(seen)
        if len(kept) > self._n_points:
            even = np.linspace(0, len(kept) - 1, self._n_points)
            kept = kept[np.rint(even).astype(int)]
        if normals is not None:
            return ObjectCloud(points[kept], normals[kept])
        return with_estimated_normals(points[kept], self._viewpoint)


main = partial(run, ObjectWarper)
