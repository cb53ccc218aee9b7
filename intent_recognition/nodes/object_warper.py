# SPDX-License-Identifier: Apache-2.0
"""Node: warps an annotated object onto each seen one.

`object/cloud` gives `object/labelled_cloud` and `object/parameters`.
"""

import time
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Header

from intent_recognition.errors import ArgumentError, IntentError, describe, one_line
from intent_recognition.nodes import qos
from intent_recognition.nodes.clouds import cloud_arrays, to_labelled_cloud
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.parameters import fixed_parameter
from intent_recognition.nodes.runtime import run
from intent_recognition.objects import find_object, load_object
from intent_recognition.warping import (
    ObjectCloud,
    ObjectModel,
    PouringParameters,
    pouring_parameters,
    warp_object,
    with_estimated_normals,
)

INPUT = "object/cloud"
CLOUD = "object/labelled_cloud"
PARAMETERS = "object/parameters"


class ObjectWarper(Node):
    """Translates clouds to `warping.warp_object` and back; stateless between clouds."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("object_warper", **kwargs)

        source = fixed_parameter(
            self, "source", "mug", "Annotated object: a file, or a shipped one."
        )
        self._source = ObjectModel.learn(load_object(find_object(source)))
        mapping = fixed_parameter(
            self, "mapping", "label", "Label the cloud's points, or move the source's."
        )
        if mapping not in ("label", "point"):
            cure = "Use label unless points must be identified one by one."
            raise ArgumentError(describe("mapping", "label or point", mapping, cure))
        self._mapping: Literal["label", "point"] = "point" if mapping == "point" else "label"
        self._neighbours = fixed_parameter(
            self, "neighbours", 1, "Nearest points that vote on a label.", 1, 50
        )
        self._n_points = fixed_parameter(
            self, "n_points", 2000, "Points to which larger clouds are thinned.", 200, 100000
        )
        self._viewpoint = _position(
            fixed_parameter(
                self,
                "viewpoint",
                [0.0, 0.0, 0.0],
                "Camera position in the cloud's frame [m]; normals are turned toward it.",
            )
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
            warped = warp_object(self._source, target, self._mapping, self._neighbours)
            parameters = pouring_parameters(warped)
        except IntentError as error:
            self._diagnostics.reject(type(error).__name__, one_line(error))
            return
        self._cloud.publish(
            to_labelled_cloud(message.header, warped.points, warped.normals, warped.labels)
        )
        self._vector.publish(to_named_vector(message.header, parameters))
        self._diagnostics.tick(PARAMETERS)
        self._diagnostics.latency(time.perf_counter() - start_s)

    def _target(
        self, points: NDArray[np.float64], normals: NDArray[np.float64] | None
    ) -> ObjectCloud:
        """The object, without pixels that have no depth, thinned evenly to `n_points`."""
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


def to_named_vector(header: Header, parameters: PouringParameters) -> JointState:
    """Parameters as a stamped named vector: a point has three entries, `_x`, `_y` and `_z`."""
    message = JointState(header=header)
    for name, value in parameters._asdict().items():
        values = np.atleast_1d(value)
        endings = ("",) if len(values) == 1 else ("_x", "_y", "_z")
        message.name.extend(name + ending for ending in endings)
        message.position.extend(float(one) for one in values)
    return message


def _position(values: Sequence[float]) -> NDArray[np.float64]:
    position = np.array(values, dtype=float)
    if position.shape != (3,) or not np.isfinite(position).all():
        cure = "Give x, y and z in metres."
        raise ArgumentError(describe("viewpoint", "three numbers", list(values), cure))
    return position


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(ObjectWarper, args)
