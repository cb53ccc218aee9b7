# SPDX-License-Identifier: Apache-2.0
"""Bags of simulated people for the tests of the commands."""

from dataclasses import replace
from pathlib import Path

import yaml
from bag_builder import write_bag
from model_builder import make_dofs, perform, true_library, write_recording

DOFS = make_dofs()
TRUTH = true_library(DOFS, n_tasks=2)
PER_TASK = 4


def write_all(folder: Path) -> None:
    """`bags` with four good recordings of two tasks, and `dofs.yaml`."""
    for number in range(PER_TASK * 2):
        recording = perform(TRUTH, number % 2, number, rate_hz=25.0)
        write_recording(folder / "bags" / recording.name, recording, DOFS)
    (folder / "dofs.yaml").write_text(yaml.safe_dump(DOFS.to_dict()))


def spoil(folder: Path) -> dict[str, str]:
    """Bags that cannot be used, each with a word of the reason why."""
    cut = write_recording(folder / "cut", perform(TRUTH, 0, 20), DOFS)
    data = (cut / "cut_0.mcap").read_bytes()
    (cut / "cut_0.mcap").write_bytes(data[: len(data) // 2])
    write_recording(folder / "nameless", perform(TRUTH, 0, 21), DOFS, task="")
    one_sided = replace(perform(TRUTH, 0, 22), controlled=())
    write_recording(folder / "alone", one_sided, type(DOFS)(DOFS.observed, ()))
    write_bag(folder / "short", count=3)
    (folder / "void").mkdir()
    (folder / "void" / "void_0.mcap").write_bytes(b"")
    return {"cut": "", "nameless": "label", "alone": "missing topic", "short": "", "void": ""}
