# SPDX-License-Identifier: Apache-2.0
"""Markers for RViz: the observed and the predicted path of the human, with its +-2 sigma tube."""

import numpy as np
from geometry_msgs.msg import Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from intent_recognition.nodes.conversions import to_point, to_stamp
from intent_recognition.promp.observations import Observation
from intent_recognition.storage.dofs import DofEntry
from intent_recognition.storage.stream import POSITION_FIELDS

OBSERVED = ColorRGBA(r=0.15, g=0.15, b=0.15, a=1.0)
PREDICTED = ColorRGBA(r=0.0, g=0.45, b=0.7, a=1.0)
TUBE = ColorRGBA(r=0.0, g=0.45, b=0.7, a=0.15)
LINE_WIDTH_M = 0.006
TEXT_HEIGHT_M = 0.06
MAX_OBSERVED = 500
NEW_MOVEMENT_NS = 500_000_000


class MarkerBuilder:
    """Remembers the observed path of the movement under way and draws both paths."""

    def __init__(self):
        self._observed: list[np.ndarray] = []
        self._last_ns = 0

    def observe(self, observation: Observation, entry: DofEntry) -> None:
        """Remember one observed position; a pause in the observations begins a new path."""
        if not set(POSITION_FIELDS) <= set(entry.fields):
            return
        if observation.stamp_ns - self._last_ns > NEW_MOVEMENT_NS:
            self._observed.clear()
        self._last_ns = observation.stamp_ns
        columns = [entry.fields.index(field) for field in POSITION_FIELDS]
        self._observed.append(observation.values[columns])
        del self._observed[:-MAX_OBSERVED]

    def build(
        self, time_ns: int, frame: str, label: str, predicted: np.ndarray, std: np.ndarray
    ) -> MarkerArray:
        """Draw both paths, the tube and the label.

        Args:
            time_ns: stamp.
            frame: frame of all positions.
            label: text beside the predicted end.
            predicted: rest of the path, (T, 3) [m].
            std: its standard deviation, (T, 3) [m].
        """
        kinds = (Marker.LINE_STRIP, Marker.LINE_STRIP, Marker.SPHERE_LIST, Marker.TEXT_VIEW_FACING)
        observed, future, tube, text = (
            self._marker(time_ns, frame, number, kind) for number, kind in enumerate(kinds)
        )
        observed.points = [to_point(position) for position in self._observed]
        observed.scale.x, observed.color = LINE_WIDTH_M, OBSERVED
        future.points = [to_point(position) for position in predicted]
        future.scale.x, future.color = LINE_WIDTH_M, PREDICTED
        tube.type, tube.ns = Marker.SPHERE_LIST, "tube"
        tube.points = future.points
        # One size for all spheres of a list: the root mean square over the rest of the path.
        tube.scale = Vector3(**dict(zip("xyz", (4.0 * rms(std)).tolist(), strict=True)))
        tube.color = TUBE
        text.text, text.scale.z, text.color = label, TEXT_HEIGHT_M, PREDICTED
        text.pose.position = to_point(predicted[-1] + np.array([0.0, 0.0, 0.1]))
        return MarkerArray(markers=[observed, future, tube, text])

    @staticmethod
    def _marker(time_ns: int, frame: str, number: int, kind: int) -> Marker:
        marker = Marker(ns="intent", id=number, type=kind, action=Marker.ADD)
        marker.header.stamp = to_stamp(time_ns)
        marker.header.frame_id = frame
        marker.pose.orientation.w = 1.0
        return marker


def rms(std: np.ndarray) -> np.ndarray:
    """Root mean square over the first axis."""
    return np.sqrt(np.mean(std**2, axis=0))
