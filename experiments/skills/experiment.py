# SPDX-License-Identifier: Apache-2.0
"""Skills that grow: corrected by hand, improved by practice."""

from collections.abc import Callable
from dataclasses import replace

from experiments.practice import experiment as practice
from experiments.results import ExperimentResult
from experiments.settings import Settings
from experiments.skills import correcting_report, practising_report
from experiments.skills.part import SkillPart
from intent_recognition.report import Paragraph

PartRun = Callable[[Settings], SkillPart | ExperimentResult]
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
        parts[name] = part(_of_part(settings, name, done, share))
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


def _of_part(settings: Settings, name: str, done: float, share: float) -> Settings:
    """The settings with the progress of one part."""

    def progress(part: float, what: str) -> None:
        settings.progress(done + share * part, f"{name}: {what}")

    return replace(settings, progress=progress)
