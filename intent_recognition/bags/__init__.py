# SPDX-License-Identifier: Apache-2.0
"""Read, write, cut and recover ROS bags."""

from intent_recognition.bags.cdr.columns import (
    JOINT_STATE,
    POSE,
    Columns,
    JointColumns,
    PoseColumns,
)
from intent_recognition.bags.cdr.layout import (
    LITTLE_ENDIAN,
    NANOSECONDS,
    LayoutCache,
    header_stamp_ns,
    message_fields,
)
from intent_recognition.bags.copying import BagPart, RecoveryReport, cut_bag, recover
from intent_recognition.bags.definitions import message_class
from intent_recognition.bags.files import cure_of
from intent_recognition.bags.mcap.scan import Damage
from intent_recognition.bags.messages import RECOVER, BagMessage
from intent_recognition.bags.metadata import TopicInfo, qos_policy, read_metadata, rosbag2_profile
from intent_recognition.bags.reader import BagReader, RawMessage, decode, recordings_in
from intent_recognition.bags.writer import FLUSH_PERIOD_S, BagWriter, DiskFullError
