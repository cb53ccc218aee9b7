# SPDX-License-Identifier: Apache-2.0
"""Figures and tables of the box assembly by two humans."""

from collections.abc import Sequence

import numpy as np

from experiments.assembly.figures import (
    Tube,
    ambiguity_figure,
    certainty_figure,
    overlap_figure,
    workspace_figure,
)
from experiments.assembly.numbers import NAMES, PAPER_OBSERVATIONS, aligned_paths, probabilities
from experiments.assembly.scores import LAST, at_phase, spread_observations
from experiments.assembly.study import AssemblyStudy
from intent_recognition.promp import TaskLibrary
from intent_recognition.report import Block, Column, Figure, Paragraph, TableBlock, readable, to_svg
from sim_bridge.scenarios.assembly import FASTENING, HAND_OVER

TUBE_PHASES = np.linspace(0.0, 1.0, 101)


def blocks_of(found: AssemblyStudy, numbers: dict) -> tuple[Block, ...]:
    """Figures and tables."""
    labels = found.first.library.labels
    return (
        _workspace(found),
        _overlap(found),
        _recognition(found, labels),
        _ambiguity(found, labels),
        _prediction_table(numbers),
        Paragraph(
            "The arm in the assistant's place: the predicted path of the wrist becomes that of the"
            " hand, by inverse kinematics; estimator, decision and planning are the nodes' own, at"
            " 100 Hz, and a new plan is made every 80 ms."
        ),
        _arm_table(numbers),
    )


def _workspace(found: AssemblyStudy) -> Figure:
    figure = workspace_figure(aligned_paths(found))
    return Figure(
        to_svg(figure),
        "As the paper's Fig. 7: aligned demonstrations of both wrists, with ellipses of two"
        " standard deviations along the way.",
    )


def _overlap(found: AssemblyStudy) -> Figure:
    """The left-out fastening whose end comes nearest to the hand-over's."""
    library = found.first.library
    tubes = {task: _tube(library, task) for task in (HAND_OVER, FASTENING)}
    shown = [d for d in found.first.left_out if d.task == FASTENING]
    ends = [np.linalg.norm(d.observed[0].values[-1] - tubes[HAND_OVER].mean[-1]) for d in shown]
    observations = spread_observations(shown[int(np.argmin(ends))])
    values = np.array([observation.values for observation in observations])
    return Figure(
        to_svg(overlap_figure(tubes, values, FASTENING, LAST)),
        "As the paper's Fig. 8: observations of a left-out fastening over the primitives of two"
        f" tasks. The last {LAST} fit both.",
    )


def _tube(library: TaskLibrary, task: str) -> Tube:
    """The worker's wrist in the primitive of a task."""
    along = [at_phase(library, library.labels.index(task), phase) for phase in TUBE_PHASES]
    return Tube(np.array([g.mean for g in along]), np.array([g.covariance for g in along]))


def _recognition(found: AssemblyStudy, labels: Sequence[str]) -> Figure:
    rows = {
        name: {
            task: np.array([probabilities(s, way) for s in found.scored if s.task == task])
            for task in labels
        }
        for way, name in NAMES.items()
    }
    return Figure(
        to_svg(certainty_figure(labels, rows, PAPER_OBSERVATIONS)),
        "As the paper's Fig. 9: probabilities of the tasks over the number of observations, median"
        " and central 90 % of the left-out demonstrations. Above, all are aligned, as in the paper;"
        " then only the share of the movement's time is known; then only its beginning.",
    )


def _ambiguity(found: AssemblyStudy, labels: Sequence[str]) -> Figure:
    of = [s for s in found.scored if s.task == FASTENING]
    ways = {
        "each by itself": np.array([s.single for s in of]),
        "Eq. 11 as printed": np.array([s.forgetting for s in of]),
        "all so far": np.array([s.known.probabilities[1:] for s in of]),
    }
    return Figure(
        to_svg(ambiguity_figure(labels, ways, FASTENING)),
        "The ambiguous end of the fastening task: each observation by itself; each given those"
        " before, but with the prior over tasks anew (Eq. 11 as printed); and all so far.",
    )


def _prediction_table(numbers: dict) -> TableBlock:
    columns = (
        Column("task", align="left"),
        *(Column(f"after {count}", "cm") for count in (3, 5, 10, 15)),
        Column("duration unknown, 15", "cm"),
        Column("mean of task", "cm"),
        Column("nearest demonstration", "cm"),
    )
    rows = []
    for task, n in numbers["prediction"].items():
        cells = [
            f"{n['known_path_cm'][k]:.1f} / {n['known_end_cm'][k]:.1f}" for k in (3, 5, 10, 15)
        ]
        cells.append(f"{n['unknown_path_cm'][15]:.1f} / {n['unknown_end_cm'][15]:.1f}")
        cells += [f"{n[k][0]:.1f} / {n[k][1]:.1f}" for k in ("mean_of_task_cm", "nearest_cm")]
        rows.append((readable(task), *cells))
    caption = (
        "Distance of the assistant's predicted wrist from where it was, after so many observations:"
        " root mean square over the movement / at its end, means over left-out demonstrations. The"
        " task's mean and the nearest demonstration know the task and the elapsed share."
    )
    return TableBlock(columns, tuple(rows), caption)


def _arm_table(numbers: dict) -> TableBlock:
    columns = (
        Column("task", align="left"),
        Column("interactions"),
        Column("hand from wrist, end", "cm", form=".1f"),
        Column("largest", "cm", form=".1f"),
        Column("over the interaction", "cm", form=".1f"),
        Column("arrives after the wrist", "s"),
        Column("begins after", "s", form=".2f"),
    )
    rows = []
    for task in numbers["prediction"]:
        n = {key: np.array(values) for key, values in numbers["arm"][task].items()}
        end, late = n["end_cm"], n["late_s"]
        arrives = f"{np.median(late):+.2f} ({late.min():+.2f} to {late.max():+.2f})"
        errors = end.mean(), end.max(), n["path_cm"].mean()
        rows.append((readable(task), len(end), *errors, arrives, np.median(n["began_s"])))
    caption = (
        "The arm's hand against where the assistant's wrist was; times from the start of the"
        " recording, 0.4 s before the worker's onset."
    )
    return TableBlock(columns, rows, caption)
