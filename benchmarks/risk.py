# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmarks.risk FOLDER...`: wrong actions and questions over the stated risk.

Each demonstration, or each person where the recordings have groups, is followed by a model that
does not know it, as the nodes do; how certain the end of the robot's motion is does not count.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.evaluation import make_folds
from intent_recognition.evaluation.folds import merge_folds
from intent_recognition.evaluation.online import where_both_were_recorded
from intent_recognition.learning import cut_to_movement, learn
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.recognition import (
    DecisionSettings,
    DecisionState,
    Estimate,
    IntentEstimator,
    decide,
    learned_risk,
    possible_tasks,
)
from intent_recognition.report import (
    DASHED,
    PALETTE,
    SOFT,
    new_figure,
    shared_legend,
    styled,
    to_png,
)
from intent_recognition.signals import Demonstration, merge

RISKS = (0.5, 0.3, 0.2, 0.1, 0.05, 0.02)
"""Largest accepted shares of wrong actions, one for each row."""
MOST_FOLDS = 6
"""Most models that are learned, to bound the time."""
ASKED_AT = 0.5
"""Share of the movement after which a question counts: most tasks are clear by then."""


class Row(NamedTuple):
    """One interaction under one risk: acted on, wrongly; asked; the bound that was stated."""

    acted: bool
    wrong: bool
    asked: bool
    bound: float


def estimates(library: TaskLibrary, recorded: Demonstration) -> list[Estimate]:
    """The estimates along a recording, up to the end of its movement."""
    estimator = IntentEstimator(library)
    return [
        estimator.update(observation)
        for observation in merge(recorded.observed)
        if observation.stamp_ns <= recorded.end_ns
    ]


def judge(library: TaskLibrary, recorded: Demonstration, seen: list[Estimate], share: float) -> Row:
    """What the decision does under a risk."""
    risk = learned_risk(library, share)
    settings = DecisionSettings(risk=risk, max_end_std_rad=np.inf, max_end_std_m=np.inf)
    state, active, asked = DecisionState(), set[str](), False
    for estimate in seen:
        current = estimate.labels, estimate.probabilities
        state, now = decide(settings, state, *current, None, estimate.log_evidence)
        active |= {now} - {""}
        passed = (estimate.stamp_ns - recorded.start_ns) / (recorded.end_ns - recorded.start_ns)
        if estimate.moving and not active and passed >= ASKED_AT and estimate.task != NONE:
            asked |= len(possible_tasks(settings, *current)) > 1
    wrong = bool(active - {str(recorded.task)})
    return Row(bool(active), wrong, asked, risk.bound if risk else np.nan)


def follow(recordings: Sequence[Demonstration], protocol: str) -> dict[float, list[Row]]:
    """What becomes of each recording under each risk."""
    rows: dict[float, list[Row]] = {share: [] for share in RISKS}
    movements = [where_both_were_recorded(one) for one in cut_to_movement(recordings)]
    for train, test in merge_folds(make_folds(recordings, protocol), MOST_FOLDS):
        library = learn([movements[i] for i in train])
        for recorded in (movements[i] for i in test):
            seen = estimates(library, recorded)
            for share in RISKS:
                rows[share].append(judge(library, recorded, seen, share))
    return rows


def lines(rows: dict[float, list[Row]]) -> list[str]:
    """A line for each risk."""
    return [
        f"max_wrong {share:4.2f}: stated {np.mean([row.bound for row in found]):4.2f}"
        f"  wrong {np.mean([row.wrong for row in found]):4.2f}"
        f"  acted on {np.mean([row.acted for row in found]):4.2f}"
        f"  asked {np.mean([row.asked for row in found]):4.2f}  of {len(found)}"
        for share, found in rows.items()
    ]


@styled
def draw(sets: Mapping[str, dict[float, list[Row]]], path: Path) -> None:
    """Share wrong over the stated bound, with its interval; acted on and asked over the risk."""
    figure = new_figure(9.6, 3.6)
    wrong, others = figure.subplots(1, 2)
    wrong.plot([0, 0.5], [0, 0.5], color=SOFT, linestyle=DASHED, label="the bound itself")
    for k, (name, rows) in enumerate(sets.items()):
        colour, shift = PALETTE[k], 0.004 * k
        for share, found in rows.items():
            n_wrong, n = sum(row.wrong for row in found), len(found)
            bound = float(np.mean([row.bound for row in found]))
            low, high = binomtest(n_wrong, n).proportion_ci(0.95, method="exact")
            at, label = bound + shift, f"{name} ({n})" if share == RISKS[0] else None
            wrong.plot([at, at], [low, high], color=colour, linewidth=1.2)
            wrong.plot(at, n_wrong / n, "o", color=colour, label=label)
        acted, asked = (
            [np.mean([getattr(row, kind) for row in found]) for found in rows.values()]
            for kind in ("acted", "asked")
        )
        others.plot(list(rows), acted, "o-", color=colour)
        others.plot(list(rows), asked, "s--", color=colour)
    wrong.set(xlabel="stated bound", ylabel="acted on wrongly, with 95 % interval")
    others.set(xlabel="max_wrong", ylabel="share", ylim=(-0.03, 1.03))
    others.set_title("acted on (solid), asked (dashed)")
    shared_legend(figure, [wrong], 5)
    path.write_bytes(to_png(figure, 110))


def main() -> None:
    """Print a table for each folder."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    by_person = "person by person where there are several (`group`), else one by one"
    parser.add_argument("--protocol", help=f"as of `intent evaluate`; by default {by_person}")
    parser.add_argument("--figure", type=Path, metavar="OUT.png")
    options = parser.parse_args()
    sets = {}
    for folder in options.folders:
        own = folder / "dofs.yaml"
        dofs = load_dofs(own) if own.exists() else load_dofs()
        recordings, _ = read_demonstrations([folder], dofs)
        people = {one.metadata.get("group") for one in recordings}
        protocol = options.protocol or ("logo:group" if len(people) > 1 else "loo")
        sets[folder.name] = follow(recordings, protocol)
        print(f"{folder.name}, {protocol}", *lines(sets[folder.name]), sep="\n", flush=True)
    if options.figure:
        draw(sets, options.figure)


if __name__ == "__main__":
    main()
