# SPDX-License-Identifier: Apache-2.0
"""Demonstrations, MCAP bags and the model file."""

from intent_recognition.storage.bag_reader import BagMessage, BagReader, RawMessage
from intent_recognition.storage.bag_writer import BagWriter, DiskFullError
from intent_recognition.storage.columns import JointColumns, PoseColumns
from intent_recognition.storage.demonstration import Demonstration, Rejection
from intent_recognition.storage.demonstrations import iter_demonstrations, read_demonstrations
from intent_recognition.storage.dofs import DofEntry, DofSpec, extract, load_dofs

__all__ = [
    "BagMessage",
    "BagReader",
    "BagWriter",
    "Demonstration",
    "DiskFullError",
    "DofEntry",
    "DofSpec",
    "JointColumns",
    "PoseColumns",
    "RawMessage",
    "Rejection",
    "extract",
    "iter_demonstrations",
    "load_dofs",
    "read_demonstrations",
]
