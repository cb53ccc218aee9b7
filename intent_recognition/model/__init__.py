# SPDX-License-Identifier: Apache-2.0
"""Model files, and task folders that grow by one recording at a time."""

from intent_recognition.model.executions import (
    ARRIVED,
    CORRECTIONS,
    DOWN,
    OUTCOME,
    SKILL_COLUMNS,
    SPILLED,
    THUMBS,
    TO_KEEP,
    TO_UNDO,
    UP,
    WAITING,
    Executions,
    SkillPeriod,
    skill_history,
)
from intent_recognition.model.file import Model, check_dofs, load_model, load_trained, save_model
from intent_recognition.model.folder_content import LIBRARY_MODEL, is_task_folder, library_dofs
from intent_recognition.model.from_bags import (
    FRAMES,
    Frames,
    FromBags,
    Run,
    accumulate_bags,
    frames_of,
    list_bags,
    merge_frames,
    mixed_frames,
    with_frames,
)
from intent_recognition.model.pouring_skill import load_pouring_skill, save_pouring_skill
from intent_recognition.model.practised import PractisedTask, undo_practice
from intent_recognition.model.task_folder import (
    PRACTICE,
    WAIT,
    Change,
    TaskFolder,
    now,
    read_history,
    undoable,
)
