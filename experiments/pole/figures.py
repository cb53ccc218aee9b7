# SPDX-License-Identifier: Apache-2.0
"""Figures of the pole: the scene, paths from above, error over the number of components."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from intent_recognition.array_types import Flags, Floats
from intent_recognition.report import (
    DASHED,
    INK,
    PALETTE,
    PAPER_COLOUR,
    Drawing,
    fill_two_sigma,
    new_figure,
    shared_legend,
    styled,
)

WAY_COLOURS = {"left": PALETTE[0], "right": PALETTE[1]}
HIT_COLOUR = "#c2185b"
POLE_COLOUR = "#4a3b32"


class PolePaths(NamedTuple):
    """Fingertip paths of one panel.

    Attributes:
        title: of the panel.
        paths_m: (n, T, 2 or 3), world.
        ways: "left" or "right" of each.
        hits: whether the motion touched the pole.
    """

    title: str
    paths_m: Floats
    ways: Sequence[str]
    hits: Sequence[bool]


@styled
def paths_figure(
    panels: Sequence[PolePaths],
    spots_m: Floats,
    both_ways: Flags,
    pole_m: Floats,
    pole_radius_m: float,
) -> Drawing:
    """The table from above, the robot below: fingertip paths around the pole, panel by panel.

    Args:
        panels: sets of paths.
        spots_m: spots pointed at (k, 2).
        both_ways: which of them can be reached on both sides, bool (k,).
        pole_m: where the pole is (2,).
        pole_radius_m: its radius.
    """
    figure = new_figure(3.3 * len(panels), 3.2)
    grid = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
    for axes, panel in zip(grid, panels, strict=True):
        axes.set_aspect("equal")
        axes.set_title(panel.title)
        for path, way, hit in zip(panel.paths_m, panel.ways, panel.hits, strict=True):
            colour = HIT_COLOUR if hit else WAY_COLOURS[way]
            axes.plot(
                -100.0 * path[:, 1],
                100.0 * path[:, 0],
                color=colour,
                linewidth=1.9 if hit else 1.2,
                alpha=0.95 if hit else 0.7,
                zorder=4 if hit else 3,
            )
        for wanted, marker in ((True, "o"), (False, "^")):
            chosen = spots_m[both_ways == wanted]
            axes.plot(
                -100.0 * chosen[:, 1], 100.0 * chosen[:, 0], marker, color="white",
                markeredgecolor=INK, markersize=5, zorder=5,
            )  # fmt: skip
        place = (-100.0 * pole_m[1], 100.0 * pole_m[0])
        axes.add_patch(Circle(place, 100.0 * pole_radius_m, color=POLE_COLOUR, zorder=6))
        axes.set_xlabel("to the robot's right [cm]")
    grid[0].set_ylabel("away from the robot [cm]")
    handles = [
        Line2D([], [], color=WAY_COLOURS["left"], label="by the robot's left"),
        Line2D([], [], color=WAY_COLOURS["right"], label="by its right"),
        Line2D([], [], color=HIT_COLOUR, label="the arm hits the pole"),
        Line2D([], [], marker="o", color=POLE_COLOUR, linestyle="", markersize=8, label="pole"),
        Line2D([], [], marker="o", color="white", markeredgecolor=INK, linestyle="",
               label="spot reached both ways"),
        Line2D([], [], marker="^", color="white", markeredgecolor=INK, linestyle="",
               label="spot reached one way"),
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=6)
    return figure


@styled
def components_figure(
    numbers: Sequence[int],
    errors: Mapping[str, Floats],
    chosen: int,
    paper: Mapping[str, float] | None = None,
) -> Drawing:
    """Left-out error over the number of components, one panel per unit.

    Args:
        numbers: of components (k,).
        errors: per axis label, errors of each test (k, n).
        chosen: number of components taken.
        paper: per axis label, the paper's plateau.
    """
    paper = paper or {}
    figure = new_figure(5.0 * len(errors), 3.7)
    grid = figure.subplots(1, len(errors), squeeze=False)[0]
    at = np.asarray(numbers)
    for axes, (label, values) in zip(grid, errors.items(), strict=True):
        mean = values.mean(axis=1)
        spread = values.std(axis=1, ddof=1)
        error = spread / np.sqrt(values.shape[1])
        axes.fill_between(
            at, np.maximum(mean - spread, 0.0), mean + spread, color=PALETTE[0], alpha=0.12, lw=0,
            label="± standard deviation of the tests",
        )  # fmt: skip
        fill_two_sigma(axes, at, mean, error, PALETTE[0], alpha=0.28, label="± 2 sigma of the mean")
        axes.plot(at, mean, "o-", color=PALETTE[0], markersize=4, label="mean of the tests")
        taken = list(numbers).index(chosen)
        axes.plot(
            chosen, mean[taken], "o", color="none", markeredgecolor=PALETTE[1], markersize=13,
            markeredgewidth=2, label=f"chosen: {chosen}",
        )  # fmt: skip
        if label in paper:
            axes.axhline(
                paper[label], color=PAPER_COLOUR, linestyle=DASHED, linewidth=1.3,
                label="paper, plateau",
            )  # fmt: skip
        axes.set_ylim(bottom=0.0)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set(xlabel="components", ylabel=label)
    shared_legend(figure, grid, 5)
    return figure


@styled
def scene_figure(images: Sequence[tuple[str, NDArray[np.uint8]]]) -> Drawing:
    """Pictures side by side, each (title, RGB image (H, W, 3))."""
    figure = new_figure(4.4 * len(images), 3.7)
    for axes, (title, image) in zip(
        figure.subplots(1, len(images), squeeze=False)[0], images, strict=True
    ):
        axes.imshow(image)
        axes.set_axis_off()
        axes.set_title(title)
    return figure
