# SPDX-License-Identifier: Apache-2.0
"""Rows and figure of corrections by hand."""

import numpy as np

from experiments.results import ExperimentPart, Finding
from experiments.settings import Settings
from experiments.skills.correcting import (
    LARGEST_BLOW_N,
    LONGEST_BLOW_S,
    MOVED_M,
    CorrectingStudy,
    investigate,
)
from intent_recognition.report import (
    Column,
    Drawing,
    Figure,
    TableBlock,
    new_axes,
    readable,
    styled,
    task_colours,
    to_svg,
)

LEAST_FALL, UNCHANGED = 0.7, 1e-9
"""What is wanted of three kept corrections."""
CONDITIONS = (
    f"Corrections: the demonstrator's rule of one task after the other is moved by"
    f" {100 * MOVED_M:g} cm. A simulated hand, a spring of 1200 N/m in all, takes the resting arm"
    " to the new place and lets go. Arm, gripper and hand are in physics; estimator, activation and"
    " learning are those of the nodes. Each kept correction is followed by reaches that no model"
    " has seen.",
    "Without the feature the same hand leads the arm as far as its stiffness lets it.",
    f"Blows are of up to {LARGEST_BLOW_N:g} N and {LONGEST_BLOW_S:g} s while the arm moves.",
)


def run(settings: Settings) -> ExperimentPart:
    """Correct, and report."""
    study = investigate(settings)
    return ExperimentPart(_findings(study), _blocks(study), CONDITIONS, _numbers(study))


def _findings(study: CorrectingStudy) -> tuple[Finding, ...]:
    sessions = study.sessions
    falls = [study.fall(task) for task in study.tasks]
    n_moves = len(sessions) // len(study.tasks)
    changed = max(one.others_changed for one in sessions)
    led_m = np.concatenate([one.corrected_m for one in sessions])
    without_m = np.concatenate([one.without_m for one in sessions])
    rad, rad_s = (max(getattr(one, name) for one in sessions) for name in ("rad", "rad_s"))
    forces = np.max([one.force_n for one in sessions], axis=0)
    return (
        Finding(
            "error at the new place falls by, three corrections kept [%]",
            f">= {100 * LEAST_FALL:g}",
            f"{100 * np.mean(falls):.1f} ({100 * min(falls):.1f} to {100 * max(falls):.1f})",
            min(falls) >= LEAST_FALL,
            f"Mean, and range over the tasks; each is the mean of {n_moves} moves.",
        ),
        Finding(
            "largest change of any number of other tasks, or of what is recognised",
            f"<= {UNCHANGED:g}",
            f"{changed:.1g}",
            changed <= UNCHANGED,
            "Means, covariances, timing, noise, margin.",
        ),
        Finding.alone(
            "hand off the new place as a led execution ends, with / without the feature [cm]",
            f"{100 * np.mean(led_m):.1f} / {100 * np.mean(without_m):.1f}",
            "Without it nothing can be kept, and the next execution is no better.",
        ),
        Finding(
            "largest jump where commands take over [rad], [rad/s]",
            "0",
            f"{rad:.0e}, {rad_s:.0e}",
            max(rad, rad_s) < UNCHANGED,
            "Position and velocity are continuous up to rounding.",
        ),
        Finding.alone(
            "strongest pull at a point of the grip, with / without yielding [N]",
            f"{forces[0]:.0f} / {forces[1]:.0f}",
            "Three points hold the hand.",
        ),
        Finding(
            f"false alarms in {study.n_undisturbed} undisturbed executions, not calibrated with",
            f"<= {study.detector.false_alarm_rate * study.n_undisturbed:.1f} expected",
            str(study.n_false),
            study.n_false <= 2.0 * study.detector.false_alarm_rate * study.n_undisturbed,
            "What conformal prediction promises, at most.",
        ),
        Finding(
            f"blows of {study.n_bumped} that change anything (the arm yielded to)",
            "0",
            f"{study.n_lasting} ({study.n_yielded})",
            study.n_lasting == 0,
            "An arm that yields to a blow goes on as before.",
        ),
    )


def _blocks(study: CorrectingStudy) -> tuple[Figure | TableBlock, ...]:
    columns = (
        Column("task", align="left"),
        *(Column(f"{k} kept", "cm", form=".1f") for k in range(len(study.sessions[0].error_m))),
        Column("fall", "%", form=".0f"),
        Column("led to", "cm", form=".1f"),
        Column("without", "cm", form=".1f"),
    )
    rows = []
    for task in study.tasks:
        errors, led, without = (
            100 * study.of(task, name).mean(axis=-1)
            for name in ("error_m", "corrected_m", "without_m")
        )
        rows.append((readable(task), *errors, 100 * study.fall(task), led, without))
    most = 100 * (1 - LEAST_FALL) * MOVED_M
    caption = f"Dots: executions; lines: means; dashed: {most:.1f} cm, wanted at most."
    figure = Figure(to_svg(errors_figure(study)), caption)
    caption = "Mean error of the hand at the new place, of executions that nobody touched."
    return figure, TableBlock(columns, rows, caption)


@styled
def errors_figure(study: CorrectingStudy) -> Drawing:
    """Error at the new place over kept corrections, a line for each task."""
    figure, axes = new_axes(6.0, 3.6)
    colours = task_colours(set(study.tasks))
    for k, task in enumerate(study.tasks):
        errors = 100 * study.of(task, "error_m")
        kept = np.arange(len(errors))
        axes.plot(kept, errors.mean(axis=1), color=colours[task], label=readable(task))
        x = np.repeat(kept + 0.05 * (k - 1), errors.shape[1])
        axes.plot(x, errors.ravel(), "o", markersize=3.0, alpha=0.5, color=colours[task])
    axes.axhline(100 * (1 - LEAST_FALL) * MOVED_M, color="0.6", linewidth=0.8, linestyle="--")
    axes.set_xticks(range(len(study.sessions[0].error_m)))
    axes.set(xlabel="corrections kept", ylabel="hand off the new place [cm]", ylim=(0.0, None))
    axes.legend()
    return figure


def _numbers(study: CorrectingStudy) -> dict[str, object]:
    """All numbers, ready for JSON."""
    detector = study.detector
    return {
        "detector": {
            "coefficients": detector.coefficients.tolist(),
            "explained_rad": detector.explained.tolist(),
            "false_alarm_rate": detector.false_alarm_rate,
        },
        "fall": {task: study.fall(task) for task in study.tasks},
        "undisturbed": study.n_undisturbed,
        "false_alarms": study.n_false,
        "bumped": study.n_bumped,
        "bumped_yielded": study.n_yielded,
        "bumped_lasting": study.n_lasting,
        "sessions": [
            {
                "task": one.task,
                "error_m": one.error_m.tolist(),
                "corrected_m": one.corrected_m.tolist(),
                "without_m": one.without_m.tolist(),
                "others_changed": one.others_changed,
                "largest_jump": [one.rad, one.rad_s],
                "strongest_pull_n": list(one.force_n),
            }
            for one in study.sessions
        ],
    }
