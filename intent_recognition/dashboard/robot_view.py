# SPDX-License-Identifier: Apache-2.0
"""The arm on the page, from the URDF on `robot_description`."""

import io
import re
from collections.abc import Mapping, Sequence

import numpy as np
import viser
import yourdfpy
from viser.extras import ViserUrdf

ROOT = "/robot"
LARGEST_PATH = 16
"""Points of a drawn hand path."""

LIGHTER = 0.35
"""A robot is drawn in greys, what is colourful nearer to white: colours are for tasks."""


class RobotView:
    """The robot of one URDF.

    Args:
        server: the page.
        description: text of the URDF; it must use only what yourdfpy knows (no capsules).
    """

    def __init__(self, server: viser.ViserServer, description: str):
        self._urdf = yourdfpy.URDF.load(io.StringIO(greyed(description)))
        self._view = ViserUrdf(server, self._urdf, root_node_name=ROOT)
        self._other = yourdfpy.URDF.load(io.StringIO(description), load_meshes=False)
        self._joints = tuple(self._view.get_actuated_joint_names())
        self._tip = _tip(self._urdf)
        self._shown: np.ndarray | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the moving joints."""
        return self._joints

    def update(self, positions: Mapping[str, float]) -> None:
        """Move the arm; joints that are not in `positions` [rad] stay at zero."""
        q = np.array([positions.get(name, 0.0) for name in self._joints])
        if self._shown is None or np.max(np.abs(q - self._shown)) > 1e-4:
            self._view.update_cfg(q)
            self._shown = q

    def hand_path(self, joints: Sequence[str], positions: np.ndarray) -> np.ndarray:
        """Positions of the last link (T', 3) [m] along a joint trajectory (T, d) [rad]."""
        chosen = np.unique(np.linspace(0, len(positions) - 1, LARGEST_PATH).round().astype(int))
        path = []
        for row in positions[chosen]:
            values = dict(zip(joints, row, strict=True))
            self._other.update_cfg(np.array([values.get(name, 0.0) for name in self._joints]))
            path.append(self._other.get_transform(self._tip)[:3, 3].copy())
        return np.array(path)


def _tip(urdf: yourdfpy.URDF) -> str:
    """The link at the end of the longest chain of joints."""
    parents = {joint.child: joint.parent for joint in urdf.joint_map.values()}

    def depth(link: str) -> int:
        return 1 + depth(parents[link]) if link in parents else 0

    return max(urdf.link_map, key=depth)


def greyed(description: str) -> str:
    """A URDF whose materials are grey, what was colourful a little lighter."""

    def grey(found: re.Match) -> str:
        try:
            red, green, blue, *rest = (float(number) for number in found[1].split())
        except ValueError:
            return found[0]
        bright = 0.3 * red + 0.59 * green + 0.11 * blue
        bright += LIGHTER * (1.0 - bright) * (max(red, green, blue) - min(red, green, blue))
        return 'rgba="' + " ".join(f"{number:.3f}" for number in (*[bright] * 3, *rest)) + '"'

    return re.sub(r'rgba="([^"]*)"', grey, description)
