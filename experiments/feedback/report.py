# SPDX-License-Identifier: Apache-2.0
"""Report of the feedback experiment: findings, figures, tables."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from experiments.feedback.controller import FeedbackPolicy
from experiments.feedback.figures import (
    distribution_figure,
    push_figure,
    spread_figure,
    stiffness_figure,
)
from experiments.feedback.study import (
    CONTROLLERS,
    DESIGN,
    PUSH_S,
    WINDOW_S,
    Pushed,
    Reproduced,
    sample_times,
)
from experiments.results import Finding
from intent_recognition.report import Block, Column, Figure, Paragraph, TableBlock, to_svg

CONDITIONS = (
    "The papers name this controller as future work and show no figure of it; what stands in the"
    " column of the paper is what Paraschos et al. 2013 derive.",
    "The primitive is that of the plate's handover: mean and covariance of the weights of the 15"
    " demonstrations shipped, as they are. The library's own covariance is regularised and wider.",
    f"The disturbance is white acceleration noise of {DESIGN.disturbance:g} rad^2/s^3 on every"
    " joint, the same for both controllers.",
    "Velocities get a variance of their own beside the primitive's, so that the state can be"
    " controlled where demonstrations rest.",
)


def findings(numbers: dict, pushes: Sequence[Pushed]) -> tuple[Finding, ...]:
    """The paper's figures and ours, side by side."""
    n_runs = numbers["n_runs"]
    chance = 1.0 / np.sqrt(2.0 * (n_runs - 1))
    ratio = np.array(numbers["std_ratio_stochastic"])
    low = np.array(numbers["std_ratio_low_gain"])
    typical, worst = float(ratio.mean()), float(np.abs(ratio - 1.0).max())
    deviation = max(numbers["mean_deviation_in_std_stochastic"])
    bound = 4.0 / np.sqrt(n_runs)  # four standard errors: the largest of 7 joints and all times
    order = np.argsort([one.spread_m for one in pushes])
    least, most = pushes[order[0]].deflection_m, pushes[order[-1]].deflection_m
    stiffer = numbers["stiffness_end_after_human_ratio"]
    return (
        Finding(
            "std of the arm's joints / the primitive's, mean of 7 joints",
            "1",
            f"{typical:.2f}",
            bool(abs(typical - 1.0) <= 2.0 * chance),
            f"{n_runs} executions leave {100 * chance:.0f} % of chance per joint.",
        ),
        Finding(
            "the same of the worst joint, relative error [%]",
            "0",
            f"{100 * worst:.0f}",
            bool(worst <= 3.0 * chance),
            f"Largest of seven, each with {100 * chance:.0f} % of chance.",
        ),
        Finding(
            "largest deviation of the arm's mean [std of the primitive]",
            "0",
            f"{deviation:.2f}",
            bool(deviation <= bound),
            f"The standard error of a mean of {n_runs} is {1 / np.sqrt(n_runs):.2f}.",
        ),
        Finding(
            "std of the controlled linear system, largest relative error",
            "0",
            f"{numbers['linear_std_error']:.1e}",
            numbers["linear_std_error"] < 1e-2,
            "Without an arm and without chance: what the time grid leaves.",
        ),
        Finding.alone(
            "std of the arm under low gains / the primitive's, mean of 7 joints",
            f"{low.mean():.2f}",
            "Follows the mean whatever the demonstrations' spread, as it is meant to.",
        ),
        Finding.alone(
            "deflection by 10 N where the hand varies most / least [cm]",
            f"{100 * most[0]:.1f} / {100 * least[0]:.1f}",
            f"Low gains give {100 * most[1]:.1f} / {100 * least[1]:.1f}; no figure in the papers.",
        ),
        Finding.alone(
            "stiffness at the end after seeing the human / before, median of 7 joints",
            f"{np.median(stiffer):.1f}",
            "Of the library's primitive: a prediction is surer, so the arm holds it more firmly.",
        ),
    )


def blocks(
    policy: FeedbackPolicy,
    demonstrated: NDArray[np.float64],
    reproduced: Sequence[Reproduced],
    pushes: Sequence[Pushed],
    ratios: Sequence[NDArray[np.float64]],
) -> tuple[Block, ...]:
    """Figures, tables and remarks, in order."""
    n, times = policy.n_joints, sample_times(reproduced[0])
    n_runs = len(reproduced[0].positions_rad)
    wanted = (policy.times_s, policy.mean[:, :n], policy.std)
    chance = np.sqrt(chi2.ppf([0.025, 0.975], n_runs - 1) / (n_runs - 1))
    moments = [(one.mean, one.std) for one in reproduced]
    return (
        Figure(
            to_svg(distribution_figure(wanted, times, moments)),
            f"Mean and 2 sigma of the primitive, and of {n_runs} executions on the arm in physics"
            " by each controller, from drawn starts under the same disturbance.",
        ),
        Figure(
            to_svg(spread_figure(wanted, times, moments, chance)),
            "Standard deviation of each joint. The band is where 95 % of such samples of the"
            " primitive's own distribution would lie.",
        ),
        _ratio_table(ratios),
        Figure(
            to_svg(stiffness_figure(policy, demonstrated)),
            "Above, the spread of the demonstrations; below, the controller's stiffness (restoring"
            " acceleration per deviation of the same joint): stiff in the fetch, which all"
            " demonstrations share, soft where the handovers differ.",
        ),
        Figure(
            to_svg(
                push_figure(
                    np.array([one.start_s for one in pushes]),
                    np.array([one.spread_m for one in pushes]),
                    np.array([one.deflection_m for one in pushes]),
                )
            ),
            f"10 N sideways at the hand for {PUSH_S:g} s: how far it gives way within"
            f" {WINDOW_S:g} s, and the hand's spread in the primitive over that time. Low gains"
            " bring it back to the mean. Pushed where the demonstrations spread, the stochastic"
            " controller goes on as another of them would, and stays up to"
            f" {100 * max(one.left_m[0] for one in pushes):.0f} cm aside.",
        ),
        Paragraph(
            "The stiffness is not the demonstrations' variance alone: while the spread grows, the"
            " same law lets deviations grow with it.",
            small=True,
        ),
    )


def _ratio_table(ratios: Sequence[NDArray[np.float64]]) -> TableBlock:
    joints = (Column(f"joint {k + 1}", form=".2f") for k in range(len(ratios[0])))
    columns = (Column("std of the arm / the primitive's", align="left"), *joints)
    rows = ((name, *ratio) for name, ratio in zip(CONTROLLERS, ratios, strict=True))
    return TableBlock.of(columns, rows, "Root mean square over the movement.")
