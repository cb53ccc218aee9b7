# SPDX-License-Identifier: Apache-2.0
"""Figures of the feedback controllers: distributions and pushes."""

from collections.abc import Sequence

from intent_recognition.array_types import Floats
from intent_recognition.report import PALETTE, Drawing, fill_two_sigma, new_figure, styled

PRIMITIVE, STOCHASTIC, LOW_GAIN = PALETTE[0], PALETTE[1], PALETTE[2]
NAMES = ("stochastic feedback", "low gain")
COLOURS = (STOCHASTIC, LOW_GAIN)
DASHES = ((0, (5, 2)), (0, (1.5, 1.5)))
"""Dashes of the two controllers' lines."""

Wanted = tuple[Floats, Floats, Floats]
"""Times (T,), mean (T, 7) [rad] and standard deviation (T, 7) [rad] of the primitive."""


@styled
def distribution_figure(
    wanted: Wanted, times_s: Floats, moments: Sequence[tuple[Floats, Floats]]
) -> Drawing:
    """Mean and 2 sigma of each joint: of the primitive, and of the arm by either controller.

    Args:
        wanted: of the primitive.
        times_s: of the arm's samples (S,).
        moments: mean and std (S, 7) by the stochastic feedback and by the low-gain controller.
    """
    figure = new_figure(9.8, 4.9)
    *panels, corner = figure.subplots(2, 4, sharex=True).ravel()
    grid, mean, std = wanted
    for k, axes in enumerate(panels):
        fill_two_sigma(axes, grid, mean[:, k], std[:, k], PRIMITIVE, label="primitive, +-2 sigma")
        axes.plot(grid, mean[:, k], color=PRIMITIVE, label="primitive, mean")
        for (centre, spread), name, colour, dash in zip(
            moments, NAMES, COLOURS, DASHES, strict=True
        ):
            for side in (-2, 2):
                label = f"arm, {name}, +-2 sigma" if side < 0 else None
                axes.plot(
                    times_s, centre[:, k] + side * spread[:, k],
                    color=colour, linestyle=dash, linewidth=1.4, label=label,
                )  # fmt: skip
        axes.plot(times_s, moments[0][0][:, k], color=STOCHASTIC, lw=1.0, label="arm, mean")
        axes.set(ylabel=f"joint {k + 1} [rad]", xlim=(0.0, grid[-1]))
    for axes in panels[3:]:
        axes.set_xlabel("time [s]")
        axes.tick_params(labelbottom=True)
    corner.set_axis_off()
    corner.legend(*panels[0].get_legend_handles_labels(), loc="center")
    return figure


@styled
def push_figure(start_s: Floats, spread_m: Floats, deflection_m: Floats) -> Drawing:
    """Largest deflection of the hand for pushes at several times, above the hand's spread there.

    Args:
        start_s: of each push (n,).
        spread_m: std of the hand along the push in the primitive meanwhile (n,).
        deflection_m: by the stochastic feedback and the low-gain controller (n, 2).
    """
    figure = new_figure(7.0, 4.4)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for k, (name, colour, marker) in enumerate(zip(NAMES, COLOURS, "os", strict=True)):
        upper.plot(
            start_s, 100 * deflection_m[:, k], color=colour, marker=marker, label=name,
            markeredgecolor="white", markersize=7,
        )  # fmt: skip
    upper.set(ylabel="deflection of the hand [cm]", ylim=(0.0, None))
    lower.plot(
        start_s, 100 * spread_m, color=PRIMITIVE, marker="D", markersize=5, label="primitive"
    )
    lower.set_ylabel("std of the hand\nalong it [cm]")
    lower.set_ylim(0.0, None)
    lower.set_xlabel("start of the push [s]")
    upper.legend(loc="upper left")
    return figure
