# SPDX-License-Identifier: Apache-2.0
"""Path and markers for RViz: what was observed and is predicted of the human, +-2 sigma."""

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3
from nav_msgs.msg import Path
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from intent_recognition.gaussian import tube_faces, tube_rings
from intent_recognition.nodes.conversions import to_point, to_pose, to_stamp
from intent_recognition.recognition import Prediction
from intent_recognition.report import INK, NONE_COLOUR, readable, task_colours

TUBE_ALPHA = 0.15
"""Opacity of the tube in RViz. Convention."""

LINE_WIDTH_M = 0.006
"""Width of both paths [m]. Convention."""
TUBE_FACES = tube_faces().ravel()


def to_path(
    time_ns: int,
    frame: str,
    human: Prediction,
    positions: NDArray[np.float64],
    orientations: NDArray[np.float64] | None = None,
) -> Path:
    """The predicted rest of the movement, each pose stamped with the time it is expected at.

    Args:
        time_ns: stamp of the whole.
        frame: frame of the positions.
        human: the prediction they are of.
        positions: (T, 3) [m].
        orientations: quaternions (T, 4) xyzw; None for no rotation.
    """
    turned = np.tile([0.0, 0.0, 0.0, 1.0], (len(positions), 1))
    turned = turned if orientations is None else orientations
    message = Path()
    message.header.stamp = to_stamp(time_ns)
    message.header.frame_id = frame
    at_s = human.trajectory.times_s
    for elapsed_s, position, quaternion in zip(at_s, positions, turned, strict=True):
        pose = PoseStamped()
        pose.header.frame_id = frame
        pose.header.stamp = to_stamp(human.onset_ns + round(float(elapsed_s) * 1e9))
        pose.pose = to_pose(position, quaternion)
        message.poses.append(pose)
    return message


def colour(name: str, opacity: float = 1.0) -> ColorRGBA:
    """The colour "#rrggbb"."""
    r, g, b = (int(name[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return ColorRGBA(r=r, g=g, b=b, a=opacity)


class MarkerBuilder:
    """Remembers the observed path of the movement under way and draws both paths.

    What is predicted has the colour that its task has on the page and in the reports.
    """

    def __init__(self, labels: Sequence[str]):
        self._colours = task_colours(labels)
        self._observed: list[NDArray[np.float64]] = []
        self._last_ns = 0

    def set_labels(self, labels: Sequence[str]) -> None:
        """Go on with other tasks; those that stay keep their colours."""
        self._colours = task_colours(labels, self._colours)

    def forget(self) -> None:
        """Begin a new path."""
        self._observed.clear()

    def observe(self, stamp_ns: int, position: NDArray[np.float64]) -> None:
        """Remember one observed position (3,) [m]; half a second without begins a new path."""
        if abs(stamp_ns - self._last_ns) > 500_000_000:
            self._observed.clear()
        self._last_ns = stamp_ns
        self._observed.append(position)
        del self._observed[:-500]

    def build(
        self,
        time_ns: int,
        frame: str,
        task: str,
        probability: float,
        predicted: NDArray[np.float64],
        std: NDArray[np.float64],
    ) -> MarkerArray:
        """Draw both paths, the tube and the label.

        Args:
            time_ns: stamp.
            frame: frame of all positions.
            task: the most probable one, or none; written beside the predicted end.
            probability: of it.
            predicted: rest of the path, (T, 3) [m].
            std: its standard deviation, (T, 3) [m].
        """
        own = self._colours.get(task, NONE_COLOUR)
        kinds = (
            Marker.LINE_STRIP,
            Marker.LINE_STRIP,
            Marker.TRIANGLE_LIST,
            Marker.TEXT_VIEW_FACING,
        )
        observed, future, tube, text = (
            self._marker(time_ns, frame, number, kind) for number, kind in enumerate(kinds)
        )
        observed.points = [to_point(position) for position in self._observed]
        observed.scale.x, observed.color = LINE_WIDTH_M, colour(INK)
        future.points = [to_point(position) for position in predicted]
        future.scale.x, future.color = LINE_WIDTH_M, colour(own)
        tube.ns, tube.color = "tube", colour(own, TUBE_ALPHA)
        corners = tube_rings(predicted, std).reshape(-1, 3)[TUBE_FACES]
        tube.points = [to_point(corner) for corner in corners]
        tube.scale = Vector3(x=1.0, y=1.0, z=1.0)
        text.text, text.scale.z = f"{readable(task)} {probability:.0%}", 0.06
        text.color = colour(own)
        text.pose.position = to_point(predicted[-1] + np.array([0.0, 0.0, 0.1]))
        return MarkerArray(markers=[observed, future, tube, text])

    @staticmethod
    def _marker(time_ns: int, frame: str, number: int, kind: int) -> Marker:
        marker = Marker(ns="intent", id=number, type=kind, action=Marker.ADD)
        marker.header.stamp = to_stamp(time_ns)
        marker.header.frame_id = frame
        marker.pose.orientation.w = 1.0
        marker.lifetime.sec = 2
        return marker
