# SPDX-License-Identifier: Apache-2.0
"""Skills that grow: what a person's hand, and others, make of them."""

from collections.abc import Callable

from intent_recognition.experiments.settings import Settings
from intent_recognition.experiments.skills import correcting_report
from intent_recognition.experiments.skills.part import Part
from intent_recognition.report import ExperimentResult

PARTS: dict[str, Callable[[Settings], Part]] = {"correcting": correcting_report.run}
"""The ways by which skills grow, each run on its own."""


def run(settings: Settings) -> ExperimentResult:
    """Run every part."""
    parts = {name: part(settings) for name, part in PARTS.items()}
    return ExperimentResult(
        title="Skills that grow",
        source="no paper; beside what is wanted",
        question="A rule has moved, and a person says so with the hand: does the robot learn it?",
        findings=tuple(row for part in parts.values() for row in part.findings),
        blocks=tuple(block for part in parts.values() for block in part.blocks),
        conditions=tuple(line for part in parts.values() for line in part.conditions),
        numbers={name: part.numbers for name, part in parts.items()},
    )
