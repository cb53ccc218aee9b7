# SPDX-License-Identifier: Apache-2.0
"""Model files, and folders of tasks that grow by one recording at a time."""

from intent_recognition.model.file import Model, check_dofs, load_model, load_trained, save_model
from intent_recognition.model.from_bags import FromBags, Run, accumulate_bags, list_bags
from intent_recognition.model.task_folder import WAIT, Change, TaskFolder

__all__ = [
    "WAIT",
    "Change",
    "FromBags",
    "Model",
    "Run",
    "TaskFolder",
    "accumulate_bags",
    "check_dofs",
    "list_bags",
    "load_model",
    "load_trained",
    "save_model",
]
