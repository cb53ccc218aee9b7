# SPDX-License-Identifier: Apache-2.0
"""The report of a rehearsal: risk, latency, the worst moments, and what to demonstrate next."""

from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.evaluation import Rehearsal, Rehearsed, Suggestion
from intent_recognition.report import html
from intent_recognition.report.drawing import (
    INK,
    SOFT,
    Drawing,
    new_figure,
    readable,
    styled,
    svg_figure,
    task_colours,
)
from intent_recognition.report.figures_interaction import thin

EXPLANATION = (
    "Every recording is fed to the estimator and the decision that the nodes run. Missed: its task"
    " never became active. The interval is that of Clopper and Pearson and takes recordings for"
    " independent; those of one person are alike, and it is then too narrow."
)
CAPTION = (
    "Probability of each task over time since the movement began. Thick: the true task; dashed:"
    " the worst moment; bars below: what was active."
)
Tables = Mapping[str, Sequence[Sequence[str]]]
"""By title, the names of the columns and rows of texts."""


def rehearsal_tables(
    rehearsal: Rehearsal, suggestions: Sequence[Suggestion], worst: Sequence[Rehearsed]
) -> Tables:
    """Results of a rehearsal, as tables of texts."""
    n, (low, high) = len(rehearsal.runs), rehearsal.wrong_interval()
    decided_s = [run.decided_s for run in rehearsal.runs if not run.missed]
    computed_ms = 1e3 * np.concatenate([run.computed_s for run in rehearsal.runs])
    late_ms, decided = np.percentile(computed_ms, [50, 99]), "never"
    if decided_s:
        late_s = np.percentile(decided_s, [50, 90])
        decided = f"after {late_s[0]:.2f} s (median), {late_s[1]:.2f} s (90 %)"
    result = [
        ("acted on wrongly", f"{rehearsal.n_wrong} of {n} (95 %: {low:.1%} to {high:.1%})"),
        ("missed", f"{rehearsal.n_missed} of {n}"),
        ("decision", decided),
        ("computation", f"{late_ms[0]:.2f} ms (median), {late_ms[1]:.1f} ms (99 %)"),
    ]
    moments = [
        (
            run.recorded.name,
            run.task,
            ", ".join(run.activated) or "-",
            f"{run.times_s[run.worst]:.2f}",
            f"{run.labels[int(p.argmax())]} ({p.max():.0%})",
        )
        for run in worst
        for p in [run.probabilities[run.worst]]
    ]
    prevented: dict[tuple[str, int], list[float]] = {}
    for one in suggestions:  # several may be like one movement
        prevented.setdefault((one.task, one.like), []).append(one.prevented)
    shown = [
        (task, _movement(rehearsal.runs[like]), str(len(fewer)), f"{sum(fewer):.2f}")
        for (task, like), fewer in prevented.items()
    ]
    return {
        "rehearsal": [("", ""), *result],
        "what to demonstrate next": [("task", "like", ">times", ">failures fewer"), *shown],
        "the worst moments": [("recording", "task", "acted on", ">at [s]", "taken for"), *moments],
    }


def rehearsal_page(tables: Tables, worst: Sequence[Rehearsed]) -> html.ReportPage:
    """The report of a rehearsal; the worst runs come first."""
    sections = []
    for title, (names, *rows) in tables.items():
        table = html.TableBlock(html.text_columns(*names), rows)
        sections.append(html.Section(title.capitalize(), (table,)))
    if worst:
        drawn = svg_figure(worst_figure(worst), CAPTION)
        sections[-1] = html.Section(sections[-1].heading, (drawn, *sections[-1].blocks))
    explained = html.Paragraph(EXPLANATION, small=True)
    sections[0] = html.Section("Result", (*sections[0].blocks, explained))
    return html.ReportPage("Rehearsal", "before the robot moves", tuple(sections))


@styled
def worst_figure(runs: Sequence[Rehearsed]) -> Drawing:
    """A small plot for each run: probabilities over time, and the active task."""
    columns = 5
    rows = -(-len(runs) // columns)
    figure = new_figure(11.2, 0.6 + 2.2 * rows)
    grid = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    colours = task_colours(runs[0].labels)
    for axes, run in zip(grid, runs, strict=False):
        times_s, p = thin(run.times_s), thin(run.probabilities)
        for k, label in enumerate(run.labels):
            width = 2.8 if label == run.task else 1.2
            axes.plot(times_s, p[:, k], color=colours[label], linewidth=width)
        axes.axvline(run.times_s[run.worst], color=SOFT, linewidth=1.0, linestyle=(0, (3, 2)))
        for task in set(run.active) - {""}:
            where = [one == task for one in run.active]
            axes.fill_between(run.times_s, -0.09, -0.03, where=where, color=colours[task], lw=0)
        axes.axhline(0.0, color=INK, linewidth=0.6)
        verdict = "wrong" if run.wrong else "missed" if run.missed else "right"
        axes.set_title(f"{readable(run.task)}: {verdict}", fontsize=8.5)
        axes.set_xlabel(f"{run.recorded.name} [s]", fontsize=7.5)
        axes.set_ylim(-0.11, 1.04)
    for axes in grid[len(runs) :]:
        axes.set_axis_off()
    for label in runs[0].labels:
        grid[0].plot([], [], color=colours[label], label=readable(label))
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=6)
    return figure


def _movement(run: Rehearsed) -> str:
    """Name, person, and first and last position of a movement."""
    start_ns, end_ns = run.recorded.start_ns, run.recorded.end_ns
    parts = [signal.between(start_ns, end_ns).values for signal in run.recorded.observed]
    ends = (np.concatenate([part[k] for part in parts]) for k in (0, -1))
    where = " to ".join(f"({', '.join(f'{x:.2f}' for x in point)})" for point in ends)
    group = run.recorded.metadata.get("group", "")
    return f"{run.recorded.name}{f' of {group}' if group else ''}: {where}"
