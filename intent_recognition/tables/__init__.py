# SPDX-License-Identifier: Apache-2.0
"""Recordings from tables and to tables: CSV, NPZ, Parquet, LeRobot datasets and C3D."""

from intent_recognition.tables.exporting import export_columns, export_map, write_table
from intent_recognition.tables.import_map import ImportMap, load_map
from intent_recognition.tables.imported import ImportedDemonstration, Samples, write_demonstration
from intent_recognition.tables.importing import import_demonstrations

__all__ = [
    "ImportMap",
    "ImportedDemonstration",
    "Samples",
    "export_columns",
    "export_map",
    "import_demonstrations",
    "load_map",
    "write_demonstration",
    "write_table",
]
