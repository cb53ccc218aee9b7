# SPDX-License-Identifier: Apache-2.0
"""Handovers at a box that is moved from one to the next, with and without knowing its place."""

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.context.figures import outcome_figure
from experiments.context.study import (
    CONDITIONS,
    KNOWN,
    NEVER,
    SHARES,
    TURN_RAD,
    TURNS_AT,
    WITHOUT,
    DrawnSet,
    investigate,
)
from experiments.draws import spread
from experiments.results import ExperimentResult, Finding
from experiments.settings import Settings
from intent_recognition.array_types import Floats
from intent_recognition.learning import TrainingSettings
from intent_recognition.report import Block, Figure, to_svg

N_DRAWS, N_TRAIN, N_TEST = 10, 12, 8
"""Number of draws, and in each the demonstrations and tests of each task."""


CONDITIONS_TEXT = (
    "Wrist, hand and box are simulated from formulae (minimum jerk), with noise of 1 mm on the"
    " wrist and of 1 cm on where both end.",
    f"The box stands anywhere in 40 by 60 cm and is turned by up to {np.degrees(TURN_RAD):.0f}"
    " degrees; its place and its turn are the context. The hand's place turns with it, which is not"
    " linear in the context.",
    f"The wrist goes to a shelf first and turns to the box after {TURNS_AT:.0%} of the movement:"
    " before that it cannot show where the box stands.",
    "The task is given for the predicted end and the pace is not; the decision is that of the"
    " nodes, which find onset and task by themselves.",
)


def run(settings: Settings) -> ExperimentResult:
    """Learn and predict, once for each draw."""
    n_draws, n_train, n_test = (1, 6, 1) if settings.quick else (N_DRAWS, N_TRAIN, N_TEST)
    study = investigate(
        range(settings.seed, settings.seed + n_draws),
        n_train,
        n_test,
        TrainingSettings(n_basis=10, n_aligned_basis=10) if settings.quick else None,
        lambda share: settings.progress(0.97 * share, "draws"),
    )
    return ExperimentResult(
        title="A moved box",
        source="no paper; beside the same without the context",
        question=(
            "Two tasks end at a box that stands elsewhere each time, and the wrist turns to it"
            " late. What does it bring to know where the box stands, before the movement or on the"
            " way?"
        ),
        findings=findings(study),
        blocks=blocks(study),
        conditions=CONDITIONS_TEXT,
        numbers=_numbers(study),
    )


def _numbers(study: Sequence[DrawnSet]) -> Mapping[str, object]:
    """All numbers of the experiment, ready for JSON."""
    return {
        "seeds": [drawn.seed for drawn in study],
        "shares": list(SHARES),
        "end_error_m": {name: errors_m(study, name).tolist() for name in CONDITIONS},
        "inside_2_sigma": {
            name: np.mean([drawn.inside[name] for drawn in study], axis=0).tolist()
            for name in CONDITIONS
        },
        "decided_share": {
            name: [None if np.isnan(share) else float(share) for share in decided(study, name)]
            for name in CONDITIONS
        },
        "wrongly_acted_on": {
            name: sum(drawn.wrong[name] for drawn in study) for name in CONDITIONS
        },
    }


def errors_m(study: Sequence[DrawnSet], condition: str) -> Floats:
    """Mean error of the predicted end of each draw, (draws, shares) [m]."""
    return np.array([drawn.end_error_m[condition].mean(axis=0) for drawn in study])


def decided(study: Sequence[DrawnSet], condition: str) -> Floats:
    """Share of the movement at each decision, of all draws; NaN for none."""
    return np.concatenate([drawn.decided[condition] for drawn in study])


def findings(study: Sequence[DrawnSet]) -> tuple[Finding, ...]:
    """What knowing the box brings, beside not knowing it."""
    third = SHARES.index(0.3)

    def centimetres(condition: str, share: int) -> str:
        return spread(100.0 * errors_m(study, condition)[:, share])

    def at(condition: str) -> str:
        medians = [100.0 * np.nanmedian(drawn.decided[condition]) for drawn in study]
        return spread(medians, 0)

    return (
        Finding(
            "error of the hand's predicted end after 30 % of the movement, box known [cm]",
            f"{centimetres(WITHOUT, third)} without it",
            centimetres(KNOWN, third),
            None,
            "Median and range of the draws; no paper has this experiment.",
        ),
        Finding(
            "the same before the movement [cm]",
            f"{centimetres(WITHOUT, 0)} without it",
            centimetres(KNOWN, 0),
            None,
            "Of 1.6 cm no model can know: where the hand ends about its place.",
        ),
        Finding(
            "share of the movement at the decision, box known [%]",
            f"{at(WITHOUT)} without it",
            at(KNOWN),
            None,
            "The certainty asked of the end is met as soon as the task is clear.",
        ),
        Finding(
            "error after 30 %, box never known, by the model that knows of it [cm]",
            f"{centimetres(WITHOUT, third)} of the one that does not",
            centimetres(NEVER, third),
            None,
            "What a context costs where it never comes.",
        ),
    )


def blocks(study: Sequence[DrawnSet]) -> tuple[Block, ...]:
    """Figures and tables, in order."""
    outcome = outcome_figure(
        SHARES,
        {name: errors_m(study, name) for name in CONDITIONS},
        {name: decided(study, name) for name in CONDITIONS},
        TURNS_AT,
    )
    return (
        Figure(
            to_svg(outcome),
            "Left: error of the hand's predicted end, mean over the tests, band over the draws."
            " Right: share of the tests that were acted on. Dashed upright: the wrist turns to the"
            " box.",
        ),
    )
