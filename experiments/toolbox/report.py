# SPDX-License-Identifier: Apache-2.0
"""The toolbox's findings, figures and tables, from the results of `study.investigate`."""

import numpy as np

from experiments.draws import also, drawn, draws_tables
from experiments.left_out import PHASES, majority_names
from experiments.pole.figures import components_figure
from experiments.results import Finding
from experiments.toolbox.figures import components_found_figure, conditioned_figure
from experiments.toolbox.session import HAND_TASKS
from experiments.toolbox.study import END_NAME, WHOLE_NAME, ToolboxStudy
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import JOINT_NAMES
from intent_recognition.learning import purity
from intent_recognition.report import Block, Figure, Row, hand_error_figure, readable, to_svg

PAPER_CM = {"plate_handover": (3.2, 2.6), "hold_screwdriver": (2.1, 2.3)}
"""Mean error of the hand and two standard deviations [cm]."""
WHY_END_ALONE = (
    "In the paper each interaction ends in a region of its own, so the final wrist tells the"
    " component; here the regions overlap on purpose."
)
DRAWS_CAPTION = (
    "The 48 recordings drawn again from other seeds, the shipped ones first: components taken,"
    " demonstrations in a component of their own, components right from the final wrist alone,"
    " and the hand's mean error with the component from the whole movement or from the end"
    " alone; below median and range."
)
N_JOINTS_SHOWN = 4
"""Joints that are drawn, the first ones."""
WRIST = ("wrist x [m]", "wrist y [m]", "wrist z [m]")


def findings(study: ToolboxStudy) -> tuple[Finding, ...]:
    """The paper's figures and ours, side by side."""
    found = purity(study.tasks.tolist(), study.taken.labels)
    right, n = study.n_right, len(study.executions)
    seen = int(study.recognised(study.from_end).sum())
    return (
        Finding.wanted(
            "components, by left-out prediction",
            "3",
            f"{study.chosen}{also(study.draws, 'components', 0)}",
            np.all(drawn(study.draws, "components") == 3),
            "There are three interactions.",
        ),
        Finding.wanted(
            "demonstrations in a component of their own interaction",
            "48 of 48 (Fig. 7)",
            f"{round(found * len(study.tasks))} of {len(study.tasks)}"
            f"{also(study.draws, 'in their own', 0)}",
            np.all(drawn(study.draws, "in their own") == len(study.tasks)),
            "Some recordings lie between two components.",
        ),
        *(_hand_finding(study, task) for task in HAND_TASKS),
        *(_end_alone_finding(study, task) for task in HAND_TASKS),
        Finding.alone(
            "left-out demonstrations recognised",
            f"{seen} of {len(study.tasks)}",
            "Not in the paper, where executions were counted.",
        ),
        Finding.wanted(
            "executions with the right component",
            "100 % of more than 40",
            f"{right} of {n}",
            right == n,
            "The paper's component is chosen once, ours at each moment.",
        ),
    )


def _hand_finding(study: ToolboxStudy, task: str) -> Finding:
    errors = 100.0 * study.hand_error_m(study.from_end)[study.tasks == task]
    mean, spread = PAPER_CM[task]
    return Finding(
        f"error of the hand, {readable(task)}, component from the whole movement [cm]",
        f"{mean} ± {spread}",
        f"{two_sigma(errors)}{also(study.draws, f'{readable(task)}, {WHOLE_NAME}')}",
        None,
        "The paper's component comes from the final wrist: see the row below. Mean ± 2 sigma.",
    )


def _end_alone_finding(study: ToolboxStudy, task: str) -> Finding:
    errors = 100.0 * study.hand_error_m(study.end_alone)[study.tasks == task]
    right, n = int(study.recognised(study.end_alone).sum()), len(study.tasks)
    name, (mean, spread) = f"{readable(task)}, {END_NAME}", PAPER_CM[task]
    return Finding(
        f"error of the hand, {readable(task)}, from the final wrist alone [cm]",
        f"{mean} ± {spread}",
        f"{two_sigma(errors)}{also(study.draws, name)}",
        bool(np.median(drawn(study.draws, name)) <= mean),
        f"{WHY_END_ALONE} It is right in {right} of {n}.",
    )


def two_sigma(values: Floats) -> str:
    """Mean ± two standard deviations; of one value itself."""
    spread = f" ± {2 * values.std(ddof=1):.1f}" if values.size > 1 else ""
    return f"{values.mean():.1f}{spread}"


def blocks(study: ToolboxStudy) -> tuple[Block, ...]:
    """Figures and tables."""
    return (
        _components(study),
        _found(study),
        *_conditioned(study),
        _hand(study),
        *draws_tables(study.draws, lambda name: "cm" if "," in name else "", DRAWS_CAPTION),
    )


def _components(study: ToolboxStudy) -> Figure:
    figure = components_figure(
        [t.number for t in study.tried],
        {
            "joints, whole movement seen [rad]": np.array([t.joint_rms_rad for t in study.tried]),
            "joints, from the final wrist [rad]": study.end_rms_rad,
        },
        study.chosen,
    )
    return Figure(
        to_svg(figure),
        "Root mean square error of the predicted joints over the number of components, each of"
        f" the {len(study.tasks)} demonstrations left out in turn (the paper's Fig. 6).",
    )


def _found(study: ToolboxStudy) -> Figure:
    figure = components_found_figure(
        PHASES,
        study.pairs.observed,
        study.pairs.controlled[..., :N_JOINTS_SHOWN],
        study.taken.labels,
        (*WRIST, *_joints()),
        majority_names(study.tasks, study.taken.labels),
    )
    return Figure(
        to_svg(figure),
        "The components: mean and ± 2 sigma of their members (the paper's Fig. 7, upper row).",
    )


def _joints() -> tuple[str, ...]:
    return tuple(f"{n.removesuffix('_joint')} [rad]" for n in JOINT_NAMES[:N_JOINTS_SHOWN])


def _conditioned(study: ToolboxStudy) -> list[Figure]:
    """One test of each interaction whose handover follows the wrist."""
    errors = study.hand_error_m(study.from_end)
    figures = []
    for task in HAND_TASKS:
        members = np.flatnonzero(study.tasks == task)
        index = int(members[np.argsort(errors[members])[len(members) // 2]])
        component = int(study.from_end.component[index])
        own = (study.taken.labels == component) & (np.arange(len(study.tasks)) != index)
        figure = conditioned_figure(
            PHASES,
            study.pairs.observed[own],
            study.pairs.controlled[own][..., :N_JOINTS_SHOWN],
            study.pairs.observed[index],
            study.pairs.controlled[index][:, :N_JOINTS_SHOWN],
            study.from_end.mean[index][:, :N_JOINTS_SHOWN],
            study.from_end.std[index][:, :N_JOINTS_SHOWN],
            (*WRIST, *_joints()),
        )
        caption = (
            f"{readable(task).capitalize()}, one test with a median error: the component learned"
            " without it (grey), the observed final wrist (asterisk), the predicted joints ± 2"
            " sigma and the truth (the paper's Fig. 7, lower row)."
        )
        figures.append(Figure(to_svg(figure), caption))
    return figures


def _hand(study: ToolboxStudy) -> Row:
    errors = 100.0 * study.hand_error_m(study.from_end)
    tasks = (*HAND_TASKS, *sorted(set(study.tasks.tolist()) - set(HAND_TASKS)))
    remarks = {task: "always at one place" for task in tasks if task not in HAND_TASKS}
    left_out = hand_error_figure(
        {task: errors[study.tasks == task] for task in tasks}, PAPER_CM, remarks
    )
    online = {
        task: [
            100.0 * e.hand_error_m
            for e in study.executions
            if e.task == task and np.isfinite(e.hand_error_m)
        ]
        for task in tasks
    }
    return Row(
        (
            Figure(
                to_svg(left_out),
                "Distance of the predicted final hand from the demonstrated one, by forward"
                " kinematics: leave-one-out, conditioned on the final wrist.",
            ),
            Figure(
                to_svg(hand_error_figure(online, PAPER_CM, remarks)),
                "The same in the executions, predicted online when the worker's movement ends,"
                " from where the demonstrator's rule puts the hand.",
            ),
        )
    )
