# SPDX-License-Identifier: Apache-2.0
"""Rows and figure of practised tasks."""

import numpy as np

from experiments.practice.study import CMA, RANDOM, share_left
from experiments.results import ExperimentPart, Finding
from experiments.settings import Settings
from experiments.skills.practising import (
    COSTS,
    DISTANCE,
    MOVED_M,
    N_ROLLOUTS,
    TIME,
    PractisingStudy,
    investigate,
)
from intent_recognition.report import (
    Column,
    Drawing,
    Figure,
    TableBlock,
    new_figure,
    readable,
    styled,
    task_colours,
    to_svg,
)

SHOWN = {DISTANCE: (100.0, "cm"), TIME: (1.0, "s")}
"""Factor and unit in which each cost is shown."""
CONDITIONS = (
    f"Practised tasks: {N_ROLLOUTS} rollouts of each of the toolbox's tasks, by `distance` with the"
    f" place {100 * MOVED_M:g} cm from where the demonstrations had it, in another direction for"
    " each seed, and by `time` at the place itself. A rollout is the arm's kinematics beside up to"
    " eight recorded people; start and result are compared beside the other recorded people.",
)


def run(settings: Settings) -> ExperimentPart:
    """Practise, and report."""
    study = investigate(settings)
    return ExperimentPart(_findings(study), _blocks(study), CONDITIONS, _numbers(study))


def _findings(study: PractisingStudy) -> tuple[Finding, ...]:
    rows = []
    for cost in COSTS:
        by = {m: [one.done for one in study.of(cost, m)] for m in (CMA, RANDOM)}
        halved = {method: sum(one.halved for one in some) for method, some in by.items()}
        factor, unit = SHOWN[cost]
        start, end = (
            factor * np.mean([getattr(one, name) for one in by[CMA]])
            for name in ("start", "settled")
        )
        rows.append(
            Finding(
                f"practice of a task by {cost}: cost left, share of the start's (median)",
                f"{share_left(by[RANDOM]):.2f} by random search",
                f"{share_left(by[CMA]):.2f}",
                None,
                f"{start:.2f} before and {end:.2f} {unit} after on average; halved in"
                f" {halved[CMA]} of {len(by[CMA])}, by random search in {halved[RANDOM]}.",
            )
        )
    late = [np.median([t for one in study.waited for t in one.late_s[k]]) for k in (0, 1)]
    off = [100 * np.median([d for one in study.waited for d in one.off_m[k]]) for k in (0, 1)]
    rows.append(
        Finding.alone(
            "hand there after the person, in physics, before / after practice by time [s], median",
            f"{late[0]:.2f} / {late[1]:.2f}",
            f"Reaches that no model has seen; the hand ends {off[0]:.1f} / {off[1]:.1f} cm off.",
        )
    )
    return tuple(rows)


def _blocks(study: PractisingStudy) -> tuple[Figure | TableBlock, ...]:
    columns = [Column("task", align="left")]
    columns += [
        Column(f"{cost}: {when}", SHOWN[cost][1], form=".2f") for cost in COSTS for when in _WHEN
    ]
    columns += [Column(f"in physics: {when}", "s", form=".2f") for when in _WHEN[:2]]
    rows = []
    for one in study.waited:
        cells = []
        for cost in COSTS:
            some, rand = (
                [p.done for p in study.of(cost, method) if p.task == one.task]
                for method in (CMA, RANDOM)
            )
            means = [[p.start for p in some], [p.settled for p in some], [p.settled for p in rand]]
            cells += [SHOWN[cost][0] * np.mean(values) for values in means]
        rows.append((readable(one.task), *cells, *(np.median(late) for late in one.late_s)))
    caption = "Cheapest rollout so far over the first's, mean of the seeds; dashed: random search."
    table = TableBlock(columns, rows, "Mean costs of executions beside other people.")
    return Figure(to_svg(curves_figure(study)), caption), table


_WHEN = ("before", "after", "after random search")


@styled
def curves_figure(study: PractisingStudy) -> Drawing:
    """Learning curves by both costs, a line for each task; dashed: random search."""
    figure = new_figure(8.6, 3.2)
    tasks = [one.task for one in study.waited]
    colours = task_colours(set(tasks))
    for axes, cost in zip(figure.subplots(1, 2), COSTS, strict=True):
        for method, line in ((CMA, "-"), (RANDOM, "--")):
            for task in tasks:
                costs = [p.done.costs for p in study.of(cost, method) if p.task == task]
                best = np.minimum.accumulate(np.array(costs), axis=1)
                curve = (best / np.maximum(best[:, :1], 1e-9)).mean(axis=0)
                label = readable(task) if method == CMA else None
                numbers = np.arange(1, len(curve) + 1)
                axes.plot(numbers, curve, line, color=colours[task], label=label)
        axes.set(ylim=(0.0, 1.05), xlabel="rollouts", ylabel=f"{cost}: cheapest so far / first")
    axes.legend()
    return figure


def _numbers(study: PractisingStudy) -> dict[str, object]:
    """All numbers, ready for JSON."""
    return {
        "practised": [
            {
                "task": one.task,
                "cost": one.cost,
                "method": one.done.method,
                "seed": one.done.seed,
                "costs": one.done.costs.tolist(),
                "start": one.done.start,
                "settled": one.done.settled,
            }
            for one in study.practised
        ],
        "in_physics": [one._asdict() for one in study.waited],
    }
