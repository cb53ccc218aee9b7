# SPDX-License-Identifier: Apache-2.0
"""Check raw tracker poses and transform them to the world frame."""

from intent_recognition.tracking.identity import LOST_S, NOBODY, Identities, identify
from intent_recognition.tracking.ingest import (
    JUMP,
    NOT_FINITE,
    STAMP_NOT_INCREASING,
    ZERO_STAMP,
    IngestState,
    Rejected,
    StampWatch,
    TrackedPose,
    Velocity,
    ingest_pose,
    ingest_poses,
)
from intent_recognition.tracking.settings import (
    UNKNOWN_VARIANCE,
    Extrinsics,
    IngestSettings,
    frame_name,
    parse_extrinsics,
)
from intent_recognition.tracking.transform_tree import NoTransformError, TransformTree
from intent_recognition.tracking.transforms import RigidTransform, multiply_quaternions
