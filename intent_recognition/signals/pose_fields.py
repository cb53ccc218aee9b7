# SPDX-License-Identifier: Apache-2.0
"""Names of the numbers of a pose, as a PoseStamped message has them."""

POSITION_FIELDS = tuple(f"pose.position.{axis}" for axis in "xyz")
ORIENTATION_FIELDS = tuple(f"pose.orientation.{axis}" for axis in "xyzw")
POSE_FIELDS = (*POSITION_FIELDS, *ORIENTATION_FIELDS)
"""In the order in which arrays of poses hold them."""
