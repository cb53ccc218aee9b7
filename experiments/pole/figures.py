# SPDX-License-Identifier: Apache-2.0
"""Figures of the pole: paths from above, error over the number of components, distance kept."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.report import (
    DASHED,
    INK,
    PALETTE,
    PAPER_COLOUR,
    SOFT,
    Drawing,
    fill_two_sigma,
    new_axes,
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
    paths_m: NDArray[np.float64]
    ways: Sequence[str]
    hits: Sequence[bool]


@styled
def paths_figure(
    panels: Sequence[PolePaths],
    spots_m: NDArray[np.float64],
    both_ways: NDArray[np.bool_],
    pole_m: NDArray[np.float64],
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
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle

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
    errors: Mapping[str, NDArray[np.float64]],
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
    from matplotlib.ticker import MaxNLocator

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
def clearance_figure(
    motions: Mapping[str, tuple[NDArray[np.float64], NDArray[np.bool_]]],
) -> Drawing:
    """Least distance from the pole of every motion, one row of dots per kind of motion.

    Args:
        motions: per kind, the least distance of each motion [m] (n,), negative inside the pole,
            and whether it touched the pole (n,).
    """
    figure, axes = new_axes(8.2, 0.9 + 0.55 * len(motions))
    lowest = min(100.0 * float(np.min(values)) for values, _ in motions.values())
    left = min(lowest - 1.0, -1.5)
    axes.axvspan(left, 0.0, color=HIT_COLOUR, alpha=0.08, lw=0)
    axes.axvline(0.0, color=HIT_COLOUR, linewidth=1.3)
    rng = np.random.default_rng(0)
    for row, (values, touched) in enumerate(motions.values()):
        values = 100.0 * values
        jitter = row + rng.uniform(-0.16, 0.16, len(values))
        for chosen, colour in ((~touched, PALETTE[2]), (touched, HIT_COLOUR)):
            axes.scatter(
                values[chosen], jitter[chosen], s=20, color=colour, alpha=0.7, linewidths=0
            )
        axes.plot([np.median(values)] * 2, [row - 0.27, row + 0.27], color=INK, linewidth=1.6)
    axes.set_yticks(range(len(motions)), list(motions))
    axes.set(ylim=(len(motions) - 0.5, -0.5), xlim=(left, None))
    axes.grid(visible=False, axis="y")
    axes.text(left, -0.42, " in the pole", color=HIT_COLOUR, fontsize=9, va="top")
    axes.set_xlabel("least distance of the arm from the pole's surface [cm]")
    return figure


@styled
def two_answers_figure(
    phase: NDArray[np.float64],
    answers: Sequence[tuple[str, NDArray[np.float64], NDArray[np.float64]]],
    truths: Mapping[str, NDArray[np.float64]],
    names: Sequence[str],
) -> Drawing:
    """Joints over phase: what each component and a single Gaussian predict, with ±2 sigma.

    Args:
        phase: (S,).
        answers: (label, mean (S, Q), standard deviation (S, Q)), at most three.
        truths: per way, what was shown there (S, Q).
        names: of the Q joints drawn.
    """
    figure = new_figure(3.4 * len(names), 3.7)
    grid = figure.subplots(1, len(names), squeeze=False)[0]
    colours = (WAY_COLOURS["left"], WAY_COLOURS["right"], SOFT)
    for q, (axes, name) in enumerate(zip(grid, names, strict=True)):
        for (label, mean, std), colour in zip(answers, colours, strict=False):
            fill_two_sigma(axes, phase, mean[:, q], std[:, q], colour)
            axes.plot(phase, mean[:, q], color=colour, label=label)
        for way, truth in truths.items():
            axes.plot(
                phase, truth[:, q], color=INK, linewidth=1.2,
                linestyle=DASHED if way == "left" else (0, (1, 1.5)), label=f"shown: {way}",
            )  # fmt: skip
        axes.set(xlabel="phase", ylabel=f"{name} [rad]", xlim=(0.0, 1.0))
    shared_legend(figure, grid[:1], 5)
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
