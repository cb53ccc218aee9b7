# SPDX-License-Identifier: Apache-2.0
"""Skills that grow: corrected by hand, improved by practice."""

from collections.abc import Callable

from experiments.practice import experiment as practice
from experiments.results import ExperimentPart, ExperimentResult
from experiments.settings import Settings
from experiments.skills import correcting_report, practising_report
from intent_recognition.report import Paragraph

PartRun = Callable[[Settings], ExperimentPart]
PARTS: dict[str, tuple[float, PartRun]] = {
    "correcting": (0.45, correcting_report.run),
    "practising a task": (0.25, practising_report.run),
    "practising to pour": (0.3, practice.run),
}
"""The ways by which skills grow, each with its share of the time."""


def run(settings: Settings) -> ExperimentResult:
    """Run every part."""
    parts, done = {}, 0.0
    for name, (share, part) in PARTS.items():
        parts[name] = part(settings.part(done, done + share, f"{name}: "))
        done += share
    blocks = [
        block
        for name, part in parts.items()
        for block in (Paragraph(name.capitalize()), *part.blocks)
    ]
    return ExperimentResult(
        title="Skills that grow",
        source="no paper; beside what is wanted",
        question="What was shown once: does it hold where a person says with the hand that it has"
        " moved, and does it get better by practice?",
        findings=tuple(row for part in parts.values() for row in part.findings),
        blocks=tuple(blocks),
        conditions=tuple(line for part in parts.values() for line in part.conditions),
        numbers={name: part.numbers for name, part in parts.items()},
    )
