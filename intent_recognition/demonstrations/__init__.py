# SPDX-License-Identifier: Apache-2.0
"""Read demonstrations from recordings: DOF files, readers, sessions and inspection."""

from intent_recognition.demonstrations.corrected import (
    CORRECTED,
    CORRECTION_TOPIC,
    CORRECTION_TYPE,
    write_corrected,
)
from intent_recognition.demonstrations.dofs import DofSpec, is_raw_pose, load_dofs
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.fields import (
    dofs_of,
    extract,
    numbers_of,
    orientation_beside,
    position_columns,
    reference_of,
    stamp_of,
)
from intent_recognition.demonstrations.folders import check_label, find_bags, no_bag
from intent_recognition.demonstrations.hand_poses import (
    HAND_LINK,
    JOINTS_TOPIC,
    arm_in_world,
    hand_numbers,
    topics_of,
)
from intent_recognition.demonstrations.inspect import (
    BagSummary,
    TopicSummary,
    inspect_bag,
    inspect_streams,
)
from intent_recognition.demonstrations.observations import (
    ObservationReader,
    Sample,
    Source,
    iter_observations,
    iter_samples,
    observation_readers,
)
from intent_recognition.demonstrations.paths import STAMPED_ELEMENTS, is_deleted, is_path
from intent_recognition.demonstrations.reading import (
    FIRST_MESSAGES,
    iter_demonstrations,
    read_demonstrations,
    read_whole,
)
from intent_recognition.demonstrations.references import settle_orientations
from intent_recognition.demonstrations.sessions import (
    MARKER_TOPIC,
    MARKER_TYPE,
    clock_shift_ns,
    read_task_sequences,
)
