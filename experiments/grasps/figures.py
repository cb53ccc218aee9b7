# SPDX-License-Identifier: Apache-2.0
"""The figure of grasps: cuts through the containers with the fingers."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from experiments.grasps.gripper import CLEARANCE_M, FINGER_M, PAD_M
from experiments.grasps.study import CARRIED, MANNERS, WARPED, Trial
from intent_recognition.array_types import Floats
from intent_recognition.report import INK, PALETTE, Drawing, new_figure, shared_legend, styled
from intent_recognition.warping import Grasp

COLOURS = {WARPED: PALETTE[2], CARRIED: PALETTE[1]}
N_COLUMNS = 4
"""Axes beside one another."""
MM = 1e3
"""Millimetres in a metre."""


@styled
def cuts_figure(trials: Sequence[Trial]) -> Drawing:
    """Each container cut where the warped grasp is, with the fingers before they close."""
    drawn = [
        pair
        for t in trials
        if t.manner == WARPED and t.grasp is not None
        for pair in [[t, *(o for o in trials if o.subject is t.subject and o is not t)]]
    ]
    rows = -(-len(drawn) // N_COLUMNS)
    figure = new_figure(2.9 * N_COLUMNS, 2.6 * rows)
    grid = np.ravel(figure.subplots(rows, N_COLUMNS))
    for axes, lifts in zip(grid, drawn, strict=False):
        _cut(axes, lifts)
    for axes in grid[len(drawn) :]:
        axes.set_axis_off()
    shared_legend(figure, list(grid[: len(drawn)]), len(MANNERS))
    return figure


def _cut(axes: Axes, lifts: Sequence[Trial]) -> None:
    """One container with the grasps of its lifts; the first gives the plane."""
    mesh, plane = lifts[0].subject.mesh, lifts[0].grasp
    assert plane is not None
    along = plane.closing * [1.0, 1.0, 0.0]
    onto = np.stack([along / np.linalg.norm(along), [0.0, 0.0, 1.0]])
    middle = mesh.bounds.mean(0)
    section = mesh.section(plane.pose[:3, 0], plane.centre)
    for line in section.discrete if section else ():
        axes.plot(*(MM * (line - middle) @ onto.T).T, color=INK, lw=1.2)
    for lift in lifts:
        label = lift.manner
        for corners in _fingers(lift.grasp) if lift.grasp else ():
            where, colour = MM * (corners - middle) @ onto.T, COLOURS[lift.manner]
            axes.add_patch(
                Polygon(where, color=colour, fill=lift.held, alpha=0.8, lw=1.4, label=label)
            )
            label = "_"
    axes.set_title(lifts[0].subject.name.replace("_", " "))
    axes.set_aspect("equal")
    axes.autoscale_view()


def _fingers(grasp: Grasp) -> list[Floats]:
    """Corners (4, 3) of both fingers as they come, open, in the plane of closing and approach."""
    inner = 0.5 * grasp.width_m + CLEARANCE_M
    tip, end = 0.5 * PAD_M[2], 0.5 * PAD_M[2] - FINGER_M
    return [
        grasp.centre
        + np.array(
            [
                side * across * grasp.closing + ahead * grasp.approach
                for across, ahead in (
                    (inner, tip),
                    (inner + PAD_M[1], tip),
                    (inner + PAD_M[1], end),
                    (inner, end),
                )
            ]
        )
        for side in (1.0, -1.0)
    ]
