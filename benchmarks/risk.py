# SPDX-License-Identifier: Apache-2.0
"""`python -m benchmarks.risk FOLDER...`: wrong actions and questions over the stated risk.

Each demonstration, or each person where the recordings have groups, is followed by a model that
does not know it, as the nodes do; how certain the end of the robot's motion is does not count.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

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
from intent_recognition.signals import Demonstration, merge

RISKS = (0.2, 0.1, 0.05, 0.02)
"""Shares of wrong actions that are asked for."""
MOST_FOLDS = 6
"""Models that are learned. Convention: it bounds the time."""
ASKED_AT = 0.5
"""Share of the movement after which a question counts: until then most are settled."""


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


def table(recordings: Sequence[Demonstration], protocol: str) -> list[str]:
    """A line for each risk."""
    rows: dict[float, list[Row]] = {share: [] for share in RISKS}
    movements = [where_both_were_recorded(one) for one in cut_to_movement(recordings)]
    for train, test in merge_folds(make_folds(recordings, protocol), MOST_FOLDS):
        library = learn([movements[i] for i in train])
        for recorded in (movements[i] for i in test):
            seen = estimates(library, recorded)
            for share in RISKS:
                rows[share].append(judge(library, recorded, seen, share))
    return [
        f"max_wrong {share:4.2f}: stated {np.mean([row.bound for row in found]):4.2f}"
        f"  wrong {np.mean([row.wrong for row in found]):4.2f}"
        f"  acted on {np.mean([row.acted for row in found]):4.2f}"
        f"  asked {np.mean([row.asked for row in found]):4.2f}  of {len(found)}"
        for share, found in rows.items()
    ]


def main() -> None:
    """Print a table for each folder."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--protocol", default="loo", help="as of `intent evaluate`")
    options = parser.parse_args()
    for folder in options.folders:
        own = folder / "dofs.yaml"
        dofs = load_dofs(own) if own.exists() else load_dofs()
        recordings, _ = read_demonstrations([folder], dofs)
        print(folder.name, *table(recordings, options.protocol), sep="\n", flush=True)


if __name__ == "__main__":
    main()
