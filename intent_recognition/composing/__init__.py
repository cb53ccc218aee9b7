# SPDX-License-Identifier: Apache-2.0
"""Skills composed of learned tasks: via points, and sequences of tasks."""

from intent_recognition.composing.bending import (
    BentLibrary,
    bend_all,
    check_via_points,
    hand_columns,
)
from intent_recognition.composing.sequences import (
    Moment,
    SequenceProgress,
    Step,
    advance,
    awaited,
    read_sequences,
)
from intent_recognition.composing.via_points import (
    HAND,
    ViaPoint,
    read_via_points,
    write_via_points,
)
