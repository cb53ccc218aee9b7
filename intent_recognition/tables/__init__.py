# SPDX-License-Identifier: Apache-2.0
"""Import recordings from files of motion capture and robot learning, and export tables."""

from intent_recognition.tables.doubts import Doubt
from intent_recognition.tables.exporting import (
    export_columns,
    export_map,
    write_lerobot,
    write_table,
)
from intent_recognition.tables.import_map import load_map
from intent_recognition.tables.imported import EntrySamples, ImportedDemonstration
from intent_recognition.tables.importing import import_demonstrations
from intent_recognition.tables.suggesting import suggest_map
