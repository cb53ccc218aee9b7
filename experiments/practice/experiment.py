# SPDX-License-Identifier: Apache-2.0
"""A pour that spills much gets better by practice, beside random search."""

from collections.abc import Sequence

import numpy as np

from experiments.practice.study import (
    CMA,
    METHODS,
    N_CHECKS,
    N_ROLLOUTS,
    RANDOM,
    SHORT_RADII,
    Practised,
    best_so_far,
    investigate,
    of_method,
    share_left,
)
from experiments.results import ExperimentPart, Finding
from experiments.settings import Settings
from intent_recognition.report import (
    NONE_COLOUR,
    PALETTE,
    Drawing,
    Figure,
    new_figure,
    shared_legend,
    styled,
    to_svg,
)
from sim_bridge.scenarios.pouring import SHORT_STD_RADII

N_SEEDS = 10
WANTED_SHARE = 0.8
"""Share of the seeds in which practice has to halve the cost."""
COLOURS = {CMA: PALETTE[0], RANDOM: NONE_COLOUR}
CONDITIONS = (
    f"The shipped demonstrations are moved {SHORT_RADII:g} radii of the second opening too short,"
    f" each by another {SHORT_STD_RADII:g} radii (standard deviation), anew for each seed.",
    "The cost is the number of balls spilled, and of balls missing in the second container: 80 if"
    " all forty are spilled.",
    "A rollout is the balls' physics alone, without the arm's: the cup's path is checked against"
    " the arm's reach and limits.",
    f"Both searches draw from the primitive itself, within two standard deviations. What they have"
    f" come to is compared with the start in {N_CHECKS} fresh pours each: of CMA-ES the mean of its"
    " distribution, of random search the cheapest rollout.",
)


def run(settings: Settings) -> ExperimentPart:
    """Practise with several seeds by each method."""
    n_seeds, n_rollouts = (1, 2) if settings.quick else (N_SEEDS, N_ROLLOUTS)
    done = investigate(
        settings.recordings("pouring/train"),
        range(settings.seed, settings.seed + n_seeds),
        METHODS,
        n_rollouts,
        lambda share: settings.progress(0.97 * share, "pouring"),
    )
    return ExperimentPart(
        findings=findings(done),
        blocks=(
            Figure(
                to_svg(learning_figure(done)),
                "Left, the cheapest rollout so far over the first one's cost, median and quartiles"
                " of the seeds. Right, the cost of fresh pours before and after, a line a seed.",
            ),
        ),
        conditions=CONDITIONS,
        numbers=_numbers(done),
    )


def findings(done: Sequence[Practised]) -> tuple[Finding, ...]:
    """How often the cost was halved, and what is left of it."""
    cma, rand = (of_method(done, method) for method in (CMA, RANDOM))
    halved = sum(one.halved for one in cma)
    return (
        Finding(
            f"seeds in which practice halves the cost, of {len(cma)}",
            f">= {WANTED_SHARE * len(cma):g}; {sum(one.halved for one in rand)} by random search",
            str(halved),
            halved >= WANTED_SHARE * len(cma),
            "By fresh pours with what the search has come to; no paper has this experiment.",
        ),
        Finding(
            "cost left, share of the start's (median)",
            f"{share_left(rand):.2f} by random search",
            f"{share_left(cma):.2f}",
            None,
            f"The start spills {np.mean([one.spilled[0] for one in cma]):.1f} balls of 40 on"
            f" average, afterwards {np.mean([one.spilled[1] for one in cma]):.1f}, by random"
            f" search {np.mean([one.spilled[1] for one in rand]):.1f}.",
        ),
    )


@styled
def learning_figure(done: Sequence[Practised]) -> Drawing:
    """Cheapest rollout so far with its spread, and the cost before and after of each seed."""
    figure = new_figure(8.6, 3.4)
    left, right = figure.subplots(1, 2)
    for place, method in enumerate(METHODS):
        some, colour = of_method(done, method), COLOURS[method]
        curve = best_so_far(some)
        low, middle, high = np.percentile(curve, [25, 50, 75], axis=0)
        number = np.arange(1, curve.shape[1] + 1)
        left.fill_between(number, low, high, color=colour, alpha=0.2, lw=0)
        left.plot(number, middle, color=colour, label=method)
        for one in some:
            right.plot(
                [2 * place, 2 * place + 1], [one.start, one.settled], color=colour, marker="o"
            )
    left.axhline(0.5, color=NONE_COLOUR, lw=0.8, linestyle=":")
    left.set(xlabel="rollouts", ylabel="cheapest so far / first", ylim=(0.0, None))
    right.set_xticks(range(4), ["start", "after"] * 2)
    right.set(ylabel="cost of fresh pours", ylim=(0.0, None))
    shared_legend(figure, [left], 2)
    return figure


def _numbers(done: Sequence[Practised]) -> dict[str, object]:
    """All numbers of the experiment, ready for JSON."""
    return {
        method: [
            {
                "seed": one.seed,
                "costs": one.costs.tolist(),
                "start": one.start,
                "settled": one.settled,
                "spilled_before_and_after": list(one.spilled),
                "halved": one.halved,
            }
            for one in of_method(done, method)
        ]
        for method in METHODS
    }
