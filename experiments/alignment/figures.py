# SPDX-License-Identifier: Apache-2.0
"""Figures of the experiment on time alignment: one warp in detail, and recordings warped."""

from collections.abc import Mapping

from intent_recognition.array_types import Floats
from intent_recognition.report import (
    DASHED,
    INK,
    PALETTE,
    Drawing,
    fill_two_sigma,
    new_figure,
    styled,
)


@styled
def warp_figure(
    phase: Floats, errors: Mapping[str, Floats], velocities: Mapping[str, Floats]
) -> Drawing:
    """One demonstration: the errors of its warps, and its velocity along each of them.

    Args:
        phase: of the reference, (T,).
        errors: by name, the truth first: recorded phase minus the true one, (T,).
        velocities: by the same names, velocity of the warped trajectory, (T,).
    """
    figure = new_figure(9.2, 4.2)
    left, right = figure.subplots(1, 2)
    for axes, curves in ((left, errors), (right, velocities)):
        for number, (name, values) in enumerate(curves.items()):
            truth = number == 0
            axes.plot(
                phase,
                values,
                color=INK if truth else PALETTE[number - 1],
                linestyle=DASHED if truth else "-",
                linewidth=(1.8, 1.8, 2.4, 1.0)[number],
                alpha=0.55 if number == 2 else 1.0,
                zorder=(5.0, 4.0, 2.5, 3.0)[number],
                label=name,
            )
        axes.set(xlabel="phase of the reference", xlim=(0.0, 1.0))
    left.set(ylabel="recorded phase less the true one", title="error of the timing")
    right.set_ylabel("velocity [range of the movement / phase]")
    right.set_title("velocity of the warped movement")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


@styled
def recordings_figure(phase: Floats, panels: Mapping[str, Floats], quantity: str) -> Drawing:
    """Recordings of one task as recorded and warped: each a line, mean +- two standard deviations.

    Args:
        phase: (T,).
        panels: per title, (n, T).
        quantity: what is drawn, with its unit.
    """
    figure = new_figure(3.1 * len(panels), 3.3)
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, (title, values) in zip(grid, panels.items(), strict=True):
        mean, std = values.mean(axis=0), values.std(axis=0, ddof=1)
        fill_two_sigma(axes, phase, mean, std, PALETTE[0])
        axes.plot(phase, values.T, color=PALETTE[0], linewidth=0.7, alpha=0.6)
        axes.plot(phase, mean, color=INK, linewidth=1.6)
        axes.set(title=title, xlabel="phase", xlim=(0.0, 1.0))
    grid[0].set_ylabel(quantity)
    return figure
