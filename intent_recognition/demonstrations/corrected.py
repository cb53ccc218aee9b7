# SPDX-License-Identifier: Apache-2.0
"""Write an execution that a person corrected as a new demonstration."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from intent_recognition.bags import JOINT_STATE, BagReader, BagWriter, decode
from intent_recognition.demonstrations.fields import to_ns
from intent_recognition.errors import BagError

CORRECTION_TOPIC, CORRECTION_TYPE = "/intent/correction", "trajectory_msgs/msg/JointTrajectory"
CORRECTED = "corrected"
"""Key of `custom_data` for the execution from which a demonstration was made."""


def write_corrected(execution: Path, target: Path, custom_data: Mapping[str, str]) -> None:
    """Copy an execution, moving the arm along the corrected path instead of its recorded one.

    The path is the last message on `CORRECTION_TOPIC` in the execution's bag. Joint messages that
    lack a position for some joint are copied unchanged.

    Raises:
        BagError: the bag has no correction, or one that lacks positions, or cannot be read.
        ResourceBusyError: the target's directory exists already.
    """
    reader = BagReader(execution)
    corrections = [message.message for message in reader.messages([CORRECTION_TOPIC])]
    if not corrections:
        cure = "Only executions that were corrected by hand can be kept."
        raise BagError.about(str(execution), "a corrected execution", "none", cure)
    path = corrections[-1]
    counts = {len(point.positions) for point in path.points}
    if counts != {len(path.joint_names)}:
        cure = "Correct the execution again."
        expected = f"positions of {len(path.joint_names)} joints at each point"
        raise BagError.about(
            f"{execution}: {CORRECTION_TOPIC}", expected, sorted(counts) or "none", cure
        )
    stamps_ns = to_ns(path.header.stamp) + np.array([to_ns(p.time_from_start) for p in path.points])
    positions = np.array([point.positions for point in path.points])
    decoders = {}
    with BagWriter(target, custom_data, flush_period_s=None) as writer:
        for raw in reader.raw_messages():
            if raw.topic == CORRECTION_TOPIC:
                continue
            if raw.type != JOINT_STATE:
                writer.write_raw(raw)
                continue
            if raw.topic not in decoders:
                decoders[raw.topic] = reader.decoder(raw.topic, raw.type)
            message = decode(raw, decoders[raw.topic]).message
            if len(message.position) != len(message.name):
                writer.write_raw(raw)
                continue
            stamp_ns = to_ns(message.header.stamp)
            if stamp_ns > stamps_ns[-1] + 500_000_000:  # keep half a second of rest
                break
            joints = dict(zip(message.name, message.position, strict=True))
            for name, column in zip(path.joint_names, positions.T, strict=True):
                if name in joints:
                    joints[name] = float(np.interp(stamp_ns, stamps_ns, column))
            header = {"stamp": stamp_ns, "frame_id": message.header.frame_id}
            fields = {"header": header, "name": [*joints], "position": [*joints.values()]}
            writer.write_message(raw.topic, raw.type, fields, raw.log_time_ns)
