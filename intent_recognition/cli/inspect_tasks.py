# SPDX-License-Identifier: Apache-2.0
"""Folders of tasks in `intent inspect`: how each task has done over time."""

from pathlib import Path

from rich.console import Console

from intent_recognition.cli.console import escape, plain_table, print_facts
from intent_recognition.model import (
    SKILL_COLUMNS,
    Executions,
    SkillPeriod,
    now,
    read_history,
    skill_history,
)


def skills_of(path: Path) -> dict[str, list[SkillPeriod]]:
    """The periods of each task of a folder."""
    return skill_history(read_history(path), Executions(path, now).all())


def tasks_json(path: Path, skills: dict[str, list[SkillPeriod]]) -> dict:
    """The same as plain values."""
    tasks = {label: [one._asdict() for one in periods] for label, periods in skills.items()}
    return {"path": str(path), "tasks": tasks}


def print_tasks(console: Console, path: Path, skills: dict[str, list[SkillPeriod]]) -> None:
    """A row for each change of each task, with what became of the executions since."""
    n = sum(one.n_executions for periods in skills.values() for one in periods)
    print_facts(console, {"tasks": str(path), "executions": str(n)})
    table = plain_table(
        "task", "since", "change", ">demonstrations", *(f">{name}" for name in SKILL_COLUMNS)
    )
    for label, periods in skills.items():
        for k, one in enumerate(periods):
            table.add_row(
                escape(label) if k == 0 else "",
                one.since[:16].replace("T", " "),
                escape(one.what),
                str(one.n_demonstrations) if one.since else "-",
                *one.texts(),
            )
    console.print(table)
