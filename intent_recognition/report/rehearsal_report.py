# SPDX-License-Identifier: Apache-2.0
"""The report of a rehearsal: risk, latency, the worst moments, and what to demonstrate next."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from intent_recognition.evaluation import Rehearsal, Rehearsed
from intent_recognition.report.drawing import (
    INK,
    SOFT,
    new_figure,
    readable,
    styled,
    task_colours,
    to_svg,
)
from intent_recognition.report.figures_interaction import thin
from intent_recognition.report.html import (
    Block,
    Column,
    Figure,
    KeyNumber,
    KeyNumbers,
    Paragraph,
    ReportPage,
    Section,
    TableBlock,
    write_page,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

PANELS = 5
"""Small plots side by side. Convention."""
EXPLANATION = (
    "Every recording is fed to the estimator and the decision that the nodes run. Missed: its task"
    " never became active. The interval is that of Clopper and Pearson and takes recordings for"
    " independent; those of one person are alike, and it is then too narrow."
)


def write_rehearsal_report(
    path: str | Path,
    rehearsal: Rehearsal,
    summary: Mapping[str, str],
    suggestions: Sequence[Sequence[object]],
    worst: Sequence[Rehearsed],
) -> Path:
    """Write the report as one HTML file.

    Args:
        path: of the file; its folder is made if it is missing.
        rehearsal: what came of the recordings.
        summary: numbers as texts, by name.
        suggestions: rows of task, movement to be like, and failures prevented.
        worst: the runs with the worst moments, the worst first.

    Raises:
        ResourceBusyError: the file cannot be written.
    """
    numbers = KeyNumbers(tuple(KeyNumber(name, text) for name, text in summary.items()))
    columns = (
        Column("task", align="left"),
        Column("like", align="left"),
        Column("failures fewer, expected", form=".2f"),
    )
    drawn: tuple[Block, ...] = ()
    if worst:
        caption = (
            "Probability of each task over time since the movement began. Thick: the true task;"
            " dashed: the worst moment; bars below: what was active."
        )
        drawn = (Figure(to_svg(worst_figure(worst)), caption),)
    sections = (
        Section("Result", (numbers, Paragraph(EXPLANATION, small=True))),
        Section("What to demonstrate next", (TableBlock.of(columns, suggestions),)),
        Section("The worst moments", drawn),
    )
    subtitle = f"{len(rehearsal.runs)} recordings"
    return write_page(path, ReportPage("Rehearsal", subtitle, sections))


@styled
def worst_figure(runs: Sequence[Rehearsed]) -> "Drawing":
    """A small plot for each run: probabilities over time, and what was active."""
    rows = -(-len(runs) // PANELS)
    figure = new_figure(11.2, 0.6 + 2.2 * rows)
    grid = figure.subplots(rows, PANELS, sharey=True, squeeze=False).ravel()
    colours = task_colours(runs[0].labels)
    for axes, run in zip(grid, runs, strict=False):
        times_s, p = thin(run.times_s), thin(run.probabilities)
        for k, label in enumerate(run.labels):
            width = 2.8 if label == run.task else 1.2
            axes.plot(times_s, p[:, k], color=colours[label], linewidth=width, label=label)
        axes.axvline(run.times_s[run.worst], color=SOFT, linewidth=1.0, linestyle=(0, (3, 2)))
        for task in set(run.active) - {""}:
            where = np.array([one == task for one in run.active])
            axes.fill_between(
                run.times_s, -0.09, -0.03, where=where, color=colours[task], linewidth=0
            )
        axes.axhline(0.0, color=INK, linewidth=0.6)
        verdict = "wrong" if run.wrong else "missed" if run.missed else "right"
        axes.set_title(f"{readable(run.task)}: {verdict}", fontsize=8.5)
        axes.set_xlabel(run.recorded.name, fontsize=7.5)
        axes.set_ylim(-0.11, 1.04)
        axes.locator_params(axis="x", nbins=4)
    for axes in grid[len(runs) :]:
        axes.set_axis_off()
    handles, labels = grid[0].get_legend_handles_labels()
    names = [readable(label) for label in labels]
    figure.legend(handles, names, loc="outside lower center", ncols=6)
    return figure
