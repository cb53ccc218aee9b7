# SPDX-License-Identifier: Apache-2.0
"""Figures of the pointing experiment: the table from above, errors, conditioned trajectories."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.patches import Circle, Ellipse

from intent_recognition.array_types import Floats
from intent_recognition.promp import Trajectory
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
    styled,
)

TRAINED, POINTED, POSTERIOR, PRIOR = PALETTE[0], PALETTE[1], PALETTE[2], PALETTE[0]
WRIST = ("wrist x [m]", "wrist y [m]", "wrist z [m]")
N_JOINTS_SHOWN = 4
"""Joints that are drawn, the first ones."""


class PointedSpot(NamedTuple):
    """A test spot on the table, all positions (2,) [m] in the world.

    Attributes:
        number: as in the text.
        spot_m: where the person pointed.
        pointed_m: where the arm's finger pointed.
        predicted_m: where it was predicted to point.
        spread_m2: covariance of the prediction (2, 2).
    """

    number: int
    spot_m: Floats
    pointed_m: Floats
    predicted_m: Floats
    spread_m2: Floats


@styled
def table_figure(
    trained_m: Floats, spots: Sequence[PointedSpot], centre_m: Floats, diameter_m: float
) -> Drawing:
    """The table from above: x away from the robot upward, y to the left.

    Args:
        trained_m: spots of the demonstrations (n, 2).
        spots: the tests.
        centre_m: of the circle (2,).
        diameter_m: of the circle.
    """
    figure, axes = new_axes(5.4, 5.2)
    axes.set_aspect("equal")

    def plane(points: Floats) -> tuple[Floats, Floats]:
        centred = 100.0 * (np.atleast_2d(points) - centre_m)
        return -centred[:, 1], centred[:, 0]

    axes.add_patch(Circle((0, 0), 50.0 * diameter_m, fill=False, color=SOFT, linestyle=(0, (4, 3))))
    for one in spots:
        turn = np.array([[0.0, -1.0], [1.0, 0.0]])
        values, vectors = np.linalg.eigh(turn @ one.spread_m2 @ turn.T)
        (u,), (v,) = plane(one.predicted_m)
        width, height = 400.0 * np.sqrt(values)
        angle = np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0]))
        axes.add_patch(Ellipse((u, v), width, height, angle=angle, color=POINTED, alpha=0.13, lw=0))
        ends = np.stack((one.spot_m, one.pointed_m))
        axes.plot(*plane(ends), color=POINTED, linewidth=1.4, zorder=3)
    axes.plot(*plane(trained_m), "o", color=TRAINED, markersize=7, label="demonstrated", zorder=4)
    tests = np.array([one.spot_m for one in spots])
    pointed = np.array([one.pointed_m for one in spots])
    axes.plot(
        *plane(tests), "x", color=INK, markersize=8, markeredgewidth=2, label="test spot", zorder=5
    )
    axes.plot(
        *plane(pointed), "s", color=POINTED, markersize=5.5, markeredgecolor="white",
        label="arm pointed at", zorder=6,
    )  # fmt: skip
    for one in spots:
        (u,), (v,) = plane(one.spot_m)
        (pu,), (pv,) = plane(one.pointed_m)
        away = np.array([u - pu, v - pv])
        away = away / max(np.linalg.norm(away), 1e-9) * 13.0
        axes.annotate(
            f"#{one.number}", (u, v), xytext=tuple(away), textcoords="offset points",
            ha="center", va="center", fontsize=9, fontweight="bold",
        )  # fmt: skip
    reach = 50.0 * diameter_m + 3.5
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("to the right of the circle's centre, as the robot sees it [cm]")
    axes.set_ylabel("away from the robot [cm]")
    figure.legend(loc="outside upper center", ncols=3)
    return figure


@styled
def errors_figure(
    numbers: Sequence[int], errors_m: Floats, nearest_m: Floats, paper_m: float
) -> Drawing:
    """Error of each test spot, with that of the nearest demonstration and the paper's largest."""
    figure, axes = new_axes(5.4, 3.4)
    at = np.arange(len(numbers))
    axes.bar(at, 100.0 * errors_m, width=0.55, color=POINTED, label="arm", zorder=2)
    axes.plot(
        at,
        100.0 * nearest_m,
        "D",
        color=SOFT,
        markersize=5,
        label="nearest demonstration",
        zorder=3,
    )
    axes.axhline(
        100.0 * paper_m, color=PAPER_COLOUR, linestyle=DASHED, linewidth=1.3,
        label="largest error in the paper",
    )  # fmt: skip
    for u, error in enumerate(errors_m):
        axes.text(u, 100.0 * error + 0.12, f"{100 * error:.1f}", ha="center", fontsize=8.5)
    axes.set_xticks(at, [f"#{number}" for number in numbers])
    axes.grid(axis="x", visible=False)
    axes.set(xlabel="test spot", ylabel="error on the table [cm]", ylim=(0.0, None))
    figure.legend(loc="outside upper center", ncols=3)
    return figure


@styled
def conditioned_figure(
    phase: Floats,
    prior: Trajectory,
    posterior: Trajectory,
    seen: tuple[Floats, Floats],
    observation: Floats,
    done: tuple[Floats, Floats],
) -> Drawing:
    """Prior and posterior of the wrist (above) and of the first joints (below), +-2 sigma.

    Args:
        phase: of the trajectories (T,).
        prior: of all DOFs, three of the wrist first.
        posterior: likewise.
        seen: phases (n,) and positions (n, 3) of the wrist as measured.
        observation: what was conditioned on (3,), at phase 1.
        done: phases (m,) and joints (m, 7) of the arm as it moved.
    """
    figure = new_figure(9.6, 5.2)
    top, bottom = figure.subfigures(2, 1, squeeze=False)[:, 0]
    upper, lower = top.subplots(1, 3), bottom.subplots(1, N_JOINTS_SHOWN)
    for k, axes in enumerate((*upper, *lower)):
        for one, colour, name in ((prior, PRIOR, "prior"), (posterior, POSTERIOR, "conditioned")):
            fill_two_sigma(axes, phase, one.positions[:, k], one.std[:, k], colour)
            axes.plot(phase, one.positions[:, k], color=colour, label=f"{name}, +-2 sigma")
        if k < 3:
            axes.plot(
                seen[0], seen[1][:, k], color=INK, linewidth=1.0, linestyle=(0, (3, 2)),
                label="wrist, not used",
            )  # fmt: skip
            axes.plot([1.0], observation[k], "o", color=INK, label="observed", clip_on=False)
            axes.set_ylabel(WRIST[k])
        else:
            axes.plot(
                done[0], done[1][:, k - 3], color=POINTED, linewidth=1.2, linestyle=DASHED,
                label="arm as it moved",
            )  # fmt: skip
            axes.set(ylabel=f"joint {k - 2} [rad]", xlabel="phase")
        axes.set_xlim(0.0, 1.0)
        axes.set_xticks([0.0, 0.5, 1.0])
    handles, labels = upper[0].get_legend_handles_labels()
    more = lower[0].get_legend_handles_labels()
    figure.legend(handles + more[0][2:], labels + more[1][2:], loc="outside upper center", ncols=5)
    return figure
