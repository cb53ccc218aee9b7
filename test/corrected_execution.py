# SPDX-License-Identifier: Apache-2.0
"""An execution in a folder of tasks that was corrected by hand."""

from datetime import datetime, timezone

import numpy as np
from model_builder import message_of, messages_of
from simulation import minimum_jerk

from intent_recognition.bags import BagWriter
from intent_recognition.demonstrations import CORRECTION_TOPIC, CORRECTION_TYPE
from intent_recognition.model import Executions

NOON = datetime(2026, 1, 1, 12, tzinfo=timezone.utc)
OFFSET = np.linspace(0.3, -0.2, 7)


def execute(folder, recording):
    """Record an execution whose arm was led aside, and how it should have been."""
    executions = Executions(folder.path, lambda: NOON)
    bag = executions.new_bag(recording.task)
    (robot,) = recording.controlled
    start_ns = recording.start_ns + 800_000_000
    phase = np.linspace(0.0, 1.0, 41)
    duration_s = (recording.end_ns - recording.start_ns) * 1e-9 - 1.6
    at_ns = start_ns + phase * duration_s * 1e9
    asked = np.stack([np.interp(at_ns, robot.stamps_ns, column) for column in robot.values.T], 1)
    asked += minimum_jerk(phase)[:, None] * OFFSET
    points = [
        {"positions": q, "time_from_start": round(t * duration_s * 1e9)}
        for q, t in zip(asked, phase, strict=True)
    ]
    header = {"stamp": start_ns, "frame_id": recording.task}
    correction = {"header": header, "joint_names": list(robot.names), "points": points}
    with BagWriter(bag, {"task": recording.task}) as writer:
        for entry, stamp_ns, values in messages_of(recording, folder.dofs):
            pushed = values + 1.0 * (entry in folder.dofs.controlled)
            writer.write_message(
                entry.topic, entry.type, message_of(entry, stamp_ns, pushed), stamp_ns
            )
        writer.write_message(CORRECTION_TOPIC, CORRECTION_TYPE, correction, recording.end_ns)
    executions.add(bag, {"corrections": "1"}, "models/0005.npz")
    return bag
