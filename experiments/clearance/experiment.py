# SPDX-License-Identifier: Apache-2.0
"""Boxes in the arm's way: none is touched, and what keeping clear costs."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from experiments.clearance.figures import nearest_figure
from experiments.clearance.study import CLEARANCE_M, ClearanceRun, ClearanceStudy, investigate
from experiments.results import ExperimentResult, Finding
from experiments.settings import Settings
from intent_recognition.report import Block, Column, Figure, TableBlock, to_svg

LEAST_TOUCHING, LARGEST_LOSS_S = 20, 0.3
"""Wanted number of runs in which the unguarded arm touches, and median time lost [s]."""
LEAST_ARRIVING = 0.8
"""Wanted share of arrivals, of runs that touch unguarded and that bending alone refuses."""
OUTCOMES = ("as before", "bent", "replanned", "refused")
CONDITIONS = (
    "No paper gives figures of this; what stands in the column of the paper is what is wanted.",
    "Reaches are the simulated coworker's, recognised and predicted on line; one or two boxes of 5"
    " to 20 cm stand at random beside or in the hand's way, none where it begins or ends.",
    f"The guard keeps {100 * CLEARANCE_M:g} cm, bends by 3 standard deviations at most, and plans"
    " anew what lies beyond. Runs that it plans anew are run once more with a guard that does not.",
    "The arm is the simulated LWR with its low gains and noisy sensors, which boxes stop; touches"
    " are its own contacts at 1 kHz. Distances are PyBullet's, every 10 ms; the guard asks coal.",
)


def run(settings: Settings) -> ExperimentResult:
    """Run every reach without and with the guard."""
    study = investigate(settings)
    settings.progress(0.97, "figures")
    return ExperimentResult(
        title="Clear of boxes",
        source="no paper; beside what is wanted",
        question="Boxes stand in the arm's way. Does it touch one, and how much later is it there?",
        findings=_findings(study),
        blocks=_blocks(study.runs),
        conditions=CONDITIONS,
        numbers=_numbers(study),
    )


def _findings(study: ClearanceStudy) -> tuple[Finding, ...]:
    runs = study.runs
    touching = [one for one in runs if one.unguarded.touches]
    touched = sum(one.guarded.touches > 0 for one in runs)
    counts = Counter(one.outcome for one in touching)
    loss = _median([one.lost_s for one in runs])
    moved = [one.lost_s for one in runs if one.outcome in ("bent", "replanned")]
    hard = [runs[k] for k in study.refused if runs[k].unguarded.touches]
    arriving = [one for one in hard if math.isfinite(one.lost_s)]
    share = len(arriving) / len(hard) if hard else math.nan
    return (
        Finding(
            f"runs of {len(runs)} in which the unguarded arm touches",
            f">= {LEAST_TOUCHING}",
            str(len(touching)),
            len(touching) >= LEAST_TOUCHING,
            "Fewer in a quick run.",
        ),
        Finding(
            "runs in which the guarded arm touches a box, or itself",
            "0",
            f"{touched}, {study.self_contacts}",
            touched == study.self_contacts == 0,
            "Each is a failure of the guard.",
        ),
        Finding(
            "arrival lost, median of all runs [s]",
            f"<= {LARGEST_LOSS_S}",
            f"{loss:.2f}",
            loss <= LARGEST_LOSS_S,
            "Runs that were refused count as infinite.",
        ),
        Finding(
            "of those that would touch and are refused without planning anew, arrive",
            f">= {100 * LEAST_ARRIVING:g} %",
            f"{len(arriving)} of {len(hard)}, {_median([one.lost_s for one in hard]):.2f} s later",
            not hard or share >= LEAST_ARRIVING,
            "Later in the median, infinite for those that do not arrive.",
        ),
        Finding.alone(
            "arrival lost where the path was bent or replanned, median (worst) [s]",
            f"{_median(moved):.2f} ({max(moved, default=math.nan):.2f})",
            f"{len(moved)} runs.",
        ),
        Finding.alone(
            "of those that would touch: bent / replanned / refused",
            " / ".join(
                str(n)
                for n in (
                    counts["bent"] + counts["as before"],
                    counts["replanned"],
                    counts["refused"],
                )
            ),
            "What lies beyond the spread of what was taught is planned anew.",
        ),
    )


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else math.nan


def _row(outcome: str, runs: Sequence[ClearanceRun]) -> tuple[str | float, ...]:
    there = [one for one in runs if one.guarded.interacting]
    return (
        outcome,
        len(runs),
        sum(one.unguarded.touches > 0 for one in runs),
        sum(one.guarded.touches > 0 for one in runs),
        100 * min(one.guarded_m for one in runs),
        _median([one.lost_s for one in there]) if there else "never there",
        100 * max(one.off_m for one in there) if there else "-",
    )


def _blocks(runs: Sequence[ClearanceRun]) -> tuple[Block, ...]:
    of_outcome = {name: [one for one in runs if one.outcome == name] for name in OUTCOMES}
    rows = [_row(name, own) for name, own in of_outcome.items() if own]
    columns = (
        Column("outcome", align="left"),
        Column("runs"),
        Column("unguarded arm touches"),
        Column("guarded arm touches"),
        Column("nearest", "cm", form=".1f"),
        Column("lost, median", "s", form=".2f"),
        Column("end off, largest", "cm", form=".1f"),
    )
    nearest = Figure(
        to_svg(nearest_figure(runs, CLEARANCE_M)),
        "Least distance between the arm and a box in each run, by PyBullet. Left of the line the"
        " arm would be inside a box.",
    )
    return nearest, TableBlock(columns, rows, "What became of the runs.")


def _numbers(study: ClearanceStudy) -> Mapping[str, object]:
    """All numbers of the experiment, ready for JSON."""
    return {
        "self_contacts": study.self_contacts,
        "refused_without_replanning": list(study.refused),
        "runs": [
            {
                "task": one.task,
                "outcome": one.outcome,
                "without_boxes_nearest_m": one.free_m,
                "guarded_nearest_m": one.guarded_m,
                "unguarded_touches": one.unguarded.touches,
                "guarded_touches": one.guarded.touches,
                "end_off_m": one.off_m if math.isfinite(one.off_m) else None,
                "lost_s": one.lost_s if math.isfinite(one.lost_s) else None,
                "boxes": [box._asdict() for box in one.boxes],
                "refusals": list(one.guarded.refusals),
                "waited": one.guarded.counts.get("waited", 0),
            }
            for one in study.runs
        ],
    }
