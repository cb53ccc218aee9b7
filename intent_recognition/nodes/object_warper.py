# SPDX-License-Identifier: Apache-2.0
"""Node: warps an annotated object onto each seen one.

`object/cloud` gives `object/labelled_cloud` and `object/parameters`.
"""

import time
from collections.abc import Sequence

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState, PointCloud2

from intent_recognition.errors import ArgumentError, IntentError, describe
from intent_recognition.nodes import qos
from intent_recognition.nodes.clouds import cloud_arrays, to_labelled_cloud
from intent_recognition.nodes.runtime import Diagnostics, parameter, run
from intent_recognition.objects import find_object, load_object
from intent_recognition.warping import (
    ObjectCloud,
    PouringParameters,
    pouring_parameters,
    prepare_source,
    warp,
    with_estimated_normals,
)

INPUT = "object/cloud"
CLOUD = "object/labelled_cloud"
PARAMETERS = "object/parameters"


class ObjectWarper(Node):
    """Translates clouds to `warping.warp` and back; keeps nothing from cloud to cloud."""

    def __init__(self, **kwargs):
        super().__init__("object_warper", **kwargs)

        def read(name, default, description, **bounds):
            return parameter(self, name, default, description, read_only=True, **bounds)

        self._source = prepare_source(
            load_object(
                find_object(read("source", "mug", "Annotated object: a file, or a shipped one."))
            )
        )
        self._mapping = read("mapping", "label", "Label the cloud's points, or move the source's.")
        if self._mapping not in ("label", "point"):
            cure = "Use label unless points must be told apart."
            raise ArgumentError(describe("mapping", "label or point", self._mapping, cure))
        self._neighbours = read("neighbours", 1, "How many vote.", minimum=1, maximum=50)
        self._n_points = read(
            "n_points", 2000, "Clouds are thinned to so many.", minimum=200, maximum=100000
        )
        self._viewpoint = _place(
            read("viewpoint", [0.0, 0.0, 0.0], "Camera in the cloud's frame [m]: turns normals.")
        )
        self._diagnostics = Diagnostics(self)
        self._cloud = self.create_publisher(PointCloud2, CLOUD, qos.STATE)
        self._vector = self.create_publisher(JointState, PARAMETERS, qos.STATE)
        self._input = self.create_subscription(PointCloud2, INPUT, self._on_cloud, qos.SENSOR)

    def _on_cloud(self, message: PointCloud2) -> None:
        start_s = time.perf_counter()
        self._diagnostics.tick(INPUT)
        try:
            target = self._target(*cloud_arrays(message))
            warped = warp(self._source, target, self._mapping, self._neighbours)
            parameters = pouring_parameters(warped)
        except IntentError as error:
            self._diagnostics.reject(type(error).__name__, " ".join(str(error).split()))
            return
        self._cloud.publish(
            to_labelled_cloud(message.header, warped.points, warped.normals, warped.labels)
        )
        self._vector.publish(to_named_vector(message.header, parameters))
        self._diagnostics.tick(PARAMETERS)
        self._diagnostics.latency(time.perf_counter() - start_s)

    def _target(self, points: np.ndarray, normals: np.ndarray | None) -> ObjectCloud:
        """The object; pixels without depth are left out, and every n-th kept of many."""
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


def to_named_vector(header, parameters: PouringParameters) -> JointState:
    """Parameters as a stamped named vector: a point has three entries, `_x`, `_y` and `_z`."""
    message = JointState(header=header)
    for name, value in parameters._asdict().items():
        values = np.atleast_1d(value)
        endings = ("",) if len(values) == 1 else ("_x", "_y", "_z")
        message.name.extend(name + ending for ending in endings)
        message.position.extend(float(one) for one in values)
    return message


def _place(values: Sequence[float]) -> np.ndarray:
    place = np.array(values, dtype=float)
    if place.shape != (3,) or not np.isfinite(place).all():
        cure = "Give x, y and z in metres."
        raise ArgumentError(describe("viewpoint", "three numbers", list(values), cure))
    return place


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(ObjectWarper, args)
